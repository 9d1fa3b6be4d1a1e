"""One servo in joint mode with gravity on its horn, simple enough to check by hand.

Output rises with the distance to the goal over margin and slope; the joint turns towards the goal
at Moving Speed at most, and is pushed back by a load that exceeds the output. At rest it hangs a
droop of margin + load * slope ticks away from its goal.
"""

from __future__ import annotations

import math

from snake_control.ax12.modulation import GoalAndSpeed, Present
from snake_control.ax12.units import RAD_PER_TICK, RAD_S_PER_SPEED_UNIT, ticks_to_rad

NO_LOAD_RAD_S = 6.0
STEPS_PER_CYCLE = 10


class ServoModel:
    """Attributes: ``angle`` [rad], ``rate`` [rad/s], ``load`` as fraction of the stall torque."""

    def __init__(
        self,
        angle: float = 0.0,
        load: float = 0.0,
        slope_ticks: int = 32,
        margin_ticks: int = 1,
        load_known: bool = True,
    ) -> None:
        self.angle = angle
        self.rate = 0.0
        self.load = load
        self.output = 0.0
        self._load_known = load_known
        self._slope = slope_ticks * RAD_PER_TICK
        self._margin = margin_ticks * RAD_PER_TICK
        self._before = angle

    def run(self, sent: GoalAndSpeed, dt: float) -> None:
        """Obey what was sent for ``dt`` seconds."""
        assert sent.goal_ticks is not None
        goal = ticks_to_rad(sent.goal_ticks)
        limit = sent.speed_raw * RAD_S_PER_SPEED_UNIT if sent.speed_raw else NO_LOAD_RAD_S
        self._before = self.angle
        for _ in range(STEPS_PER_CYCLE):
            distance = goal - self.angle
            beyond = math.copysign(max(0.0, abs(distance) - self._margin), distance)
            output = min(max(beyond / self._slope, -1.0), 1.0)
            self.rate = NO_LOAD_RAD_S * (output - self.load)
            held = self.rate
            if self.rate * output > 0:
                self.rate = min(max(self.rate, -limit), limit)
            # What the speed control leaves of it; a load in the joint's way brakes.
            self.output = output + (self.rate - held) / NO_LOAD_RAD_S
            self.angle += self.rate * dt / STEPS_PER_CYCLE

    def measured(self, age: float) -> Present:
        """What the driver knows: whole ticks, at the end of the last cycle."""
        ticks = round(self.angle / RAD_PER_TICK)
        return Present(
            ticks * RAD_PER_TICK, self.rate, age, self.output if self._load_known else math.nan
        )
