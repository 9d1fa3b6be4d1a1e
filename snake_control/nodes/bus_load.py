"""What gravity asks of the joints, by the model, beside what their servos should carry."""

from __future__ import annotations

import math
from collections.abc import Sequence

from snake_control.config import RobotConfig
from snake_control.model.statics import holding_torques


class StaticLoad:
    """Expected static torques of a robot whose base is level on the floor."""

    def __init__(self, robot: RobotConfig, allowed: float) -> None:
        """Prepare; ``allowed`` is what a servo should carry for long [N m]."""
        self._robot = robot
        self._allowed = allowed

    def expected(self, angles: Sequence[float]) -> tuple[float, ...]:
        """Return the torque of each joint [N m], NaN for all while an angle [rad] is unknown."""
        if not angles or not all(map(math.isfinite, angles)):
            return (math.nan,) * len(angles)
        return tuple(holding_torques(self._robot, angles).tolist())

    def too_much(self, angles: Sequence[float]) -> str:
        """Return which joints carry more than they should in a posture; empty if none does."""
        heavy = [
            f"{name} {abs(torque):.2f}"
            for name, torque in zip(self._robot.joint_names, self.expected(angles), strict=True)
            if abs(torque) > self._allowed
        ]
        if not heavy:
            return ""
        return (
            f"gravity asks more than the {self._allowed:g} N m that an AX-12 should carry for long "
            f"of {', '.join(heavy)} N m"
        )
