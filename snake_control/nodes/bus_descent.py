"""A lowering under way: the robot sinks slowly to its pose, and then torque goes off."""

from __future__ import annotations

from collections.abc import Sequence

from snake_control.ax12.driven_joint import JointReading
from snake_control.ax12.joint import WHEEL_MODE, JointSetup
from snake_control.ax12.lowering import Lowering, Phase
from snake_control.config import BusDriverConfig


class Descent:
    """The way to the lowering pose.

    Attributes:
        phase: how far it is.
        text: the same in words.
    """

    def __init__(self, driver: BusDriverConfig, joints: Sequence[JointSetup], now: float) -> None:
        """Begin at a monotonic time [s]."""
        self._joints = joints
        # A wheel has no position to move to.
        pose = [
            None if joint.mode == WHEEL_MODE else angle
            for joint, angle in zip(joints, driver.lowering_angles_rad, strict=True)
        ]
        self._lowering = Lowering(pose, driver.lowering_speed_rad_s, now)
        self.phase = Phase.MOVING
        self.text = "lowering before torque goes off"

    def step(self, readings: Sequence[JointReading], now: float) -> tuple[float, ...]:
        """Return the velocities of this cycle [rad/s]."""
        step = self._lowering.step([reading.angle for reading in readings], now)
        self.phase = step.phase
        way = f"{self._joints[step.farthest]} is {step.distance:.2f} rad away"
        if step.phase is Phase.GIVEN_UP:
            self.text = f"lowering given up, torque stays on: {way} and does not get nearer"
        else:
            self.text = f"lowering before torque goes off: {way}"
        return step.velocities
