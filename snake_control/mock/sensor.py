"""The position sensor of a servo: 300 degrees in steps of 0.29, and a dead zone."""

from __future__ import annotations

import math

import numpy as np

from snake_control.mock import units

# Users report mid-range values while the horn crosses the dead zone.
_GARBAGE_POSITION = (400, 600)
_GARBAGE_SPEED = (0, 4096)
# Speed is computed from positions, so it stays wrong for a while after a garbage position.
_SPEED_MEMORY_S = 0.05


class Sensor:
    """What Present Position and Present Speed show of the shaft."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Make a sensor.

        Args:
            rng: source of the undefined readings of the dead zone.
        """
        self._rng = rng
        self._since_dead_zone_s = math.inf

    def step(self, angle_rad: float, dt: float) -> None:
        """Let ``dt`` seconds pass with the shaft at an angle."""
        if not units.in_sensor_range(angle_rad):
            self._since_dead_zone_s = 0.0
        else:
            self._since_dead_zone_s += dt

    def position(self, angle_rad: float) -> int:
        """Reading of Present Position; undefined in the 60 degrees without sensor."""
        if not units.in_sensor_range(angle_rad):
            return int(self._rng.integers(*_GARBAGE_POSITION))
        ticks = units.ticks_from_angle(math.remainder(angle_rad, 2 * math.pi))
        return min(max(round(ticks), 0), units.MAX_TICKS)

    def speed(self, speed_rad_s: float, unit_rad_s: float = units.SPEED_UNIT_RAD_S) -> int:
        """Reading of Present Speed in its unit; undefined in the dead zone and shortly after."""
        if self._since_dead_zone_s < _SPEED_MEMORY_S:
            return int(self._rng.integers(*_GARBAGE_SPEED))
        return units.signed_magnitude(speed_rad_s / unit_rad_s)
