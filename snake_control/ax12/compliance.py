"""How far from its goal a servo in joint mode rests under a load (manual p. 16-17, "Compliance").

Within the margin around the goal there is no output; from its edge on the output rises linearly
from the punch to the torque limit over the slope.
"""

from __future__ import annotations

import dataclasses
import math

from snake_control.ax12 import control_table as ct
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.units import compliance_step

_HALF_TICK = 0.5


@dataclasses.dataclass(frozen=True)
class Compliance:
    """One side's settings.

    Attributes:
        margin_ticks, slope_ticks: in positions.
        punch_raw, limit_raw: output at the edge of the margin and beyond the slope, of 1023.
    """

    margin_ticks: int
    slope_ticks: int
    punch_raw: int
    limit_raw: int

    @classmethod
    def configured(cls, joint: JointSetup, limit_raw: int) -> Compliance:
        """Return what a joint is configured to have."""
        return cls(joint.margin_ticks, compliance_step(joint.slope_raw), joint.punch_raw, limit_raw)

    @classmethod
    def found(cls, ram: bytes, start: int, counter_clockwise: bool) -> Compliance:
        """Return what a servo has where its goal lies (counter-)clockwise of its shaft.

        Args:
            ram: its control table from address ``start`` on.
            start: that address.
            counter_clockwise: the side.
        """
        margin = ct.CCW_COMPLIANCE_MARGIN if counter_clockwise else ct.CW_COMPLIANCE_MARGIN
        slope = ct.CCW_COMPLIANCE_SLOPE if counter_clockwise else ct.CW_COMPLIANCE_SLOPE
        return cls(
            margin.decode(ram, start),
            compliance_step(slope.decode(ram, start)),
            ct.PUNCH.decode(ram, start),
            ct.TORQUE_LIMIT.decode(ram, start),
        )

    def output_at(self, distance_ticks: float) -> float:
        """Return the output at a distance from the goal, of 1023; NaN beyond the slope.

        There the servo gives all it has, and where it rests tells nothing of its load.
        """
        beyond = distance_ticks - self.margin_ticks
        if beyond <= 0:
            return 0.0
        if beyond > self.slope_ticks:
            return math.nan
        return self.punch_raw + self._rise * beyond / self.slope_ticks

    def output_near(self, distance_ticks: float, seen_raw: float) -> float:
        """Return the output that a servo reports, as far as its distance from the goal allows it.

        Positions come in whole ticks, and at the edge of the margin the output jumps to the punch:
        the distance alone does not tell what the servo gives.

        Args:
            distance_ticks: whole ticks.
            seen_raw: what it reports (Present Load), of 1023.

        Returns:
            The output, of 1023; NaN beyond the slope.
        """
        if math.isnan(self.output_at(distance_ticks)):
            return math.nan
        least = self.output_at(max(distance_ticks - _HALF_TICK, 0.0))
        most = self.output_at(distance_ticks + _HALF_TICK)
        return min(max(seen_raw, least), self.limit_raw if math.isnan(most) else most)

    def distance_at(self, output_raw: float) -> float:
        """Return the distance from the goal at which an output is given [ticks].

        An output between none and the punch does not exist; the margin's edge is nearest to it.
        """
        if output_raw <= self.punch_raw or self._rise <= 0:
            return float(self.margin_ticks)
        share = min((output_raw - self.punch_raw) / self._rise, 1.0)
        return self.margin_ticks + share * self.slope_ticks

    @property
    def _rise(self) -> int:
        return self.limit_raw - self.punch_raw
