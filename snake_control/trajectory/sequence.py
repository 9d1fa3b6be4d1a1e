"""What the head shall do now: nothing, follow a trajectory, follow commands, or come to rest."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.trajectory.head_trajectory import HeadTrajectory
from snake_control.trajectory.hold import Hold
from snake_control.trajectory.line import Line
from snake_control.trajectory.motion_limits import MotionLimits
from snake_control.trajectory.teleop import HeadVelocityCommand, Teleop

Array = NDArray[np.float64]

_NO_HEAD = "the head pose is not known (no fresh head/odometry)"


@dataclasses.dataclass(frozen=True)
class Outcome:
    """Whether a request was carried out, and what happened, in words."""

    done: bool
    text: str


class ReferenceSequence:
    """Decides which trajectory gives the reference.

    Idle at first: there is no reference until ``start`` or ``command``, so the robot does not move
    by itself. ``stop``, or commands that cease, decelerate the head to rest; after that there is
    no reference any more. The held end of a line goes on until ``stop`` or ``command``.
    """

    def __init__(self, config: TrajectoryGeneratorConfig) -> None:
        """Create an idle sequence."""
        self._config = config
        self._limits = MotionLimits(
            linear_speed=config.max_linear_speed_m_s,
            angular_speed=config.max_angular_speed_rad_s,
            linear_acceleration=config.max_linear_acceleration_m_s2,
            angular_acceleration=config.max_angular_acceleration_rad_s2,
        )
        self._trajectory: HeadTrajectory | None = None

    @property
    def idle(self) -> bool:
        """Whether there is no reference."""
        return self._trajectory is None

    @property
    def line(self) -> Line | None:
        """The line being followed, if it is one."""
        return self._trajectory if isinstance(self._trajectory, Line) else None

    def start(self, t: float, head: Array | None) -> Outcome:
        """Follow the configured trajectory from time ``t`` [s].

        Args:
            t: now.
            head: w of the head now, shape (6,), ``None`` if it is not known.
        """
        if self._trajectory is not None:
            return Outcome(False, "a reference is being followed already; call ~/stop first")
        if self._config.trajectory == "hold":
            if head is None:
                return Outcome(False, _NO_HEAD)
            self._trajectory = Hold(head)
            return Outcome(True, "holding the head where it is")
        start_pose = np.array(self._config.start_pose)
        if self._config.start_from == "head":
            if head is None:
                return Outcome(False, _NO_HEAD)
            start_pose = head
        self._trajectory = Line(start_pose, self._config.velocity, t, self._config.duration_s)
        return Outcome(True, f"following the line from {self._config.start_from}")

    def stop(self, t: float) -> Outcome:
        """Bring the head to rest from what it does at time ``t`` [s], then give no reference."""
        if self._trajectory is None:
            return Outcome(True, "nothing to stop")
        self._trajectory = self._teleop(self._trajectory.sample(t), t)
        return Outcome(True, "coming to rest")

    def command(self, command: HeadVelocityCommand, t: float, head: Array | None) -> Outcome:
        """Follow a velocity command.

        It starts at the reference being followed, with its rate, or else at the head, at rest.

        Args:
            command: wanted velocities.
            t: now [s].
            head: w of the head now, shape (6,), ``None`` if it is not known.
        """
        if not isinstance(self._trajectory, Teleop):
            if self._trajectory is not None:
                start = self._trajectory.sample(t)
            elif head is not None:
                start = Reference(head, np.zeros(6))
            else:
                return Outcome(False, _NO_HEAD)
            self._trajectory = self._teleop(start, t)
        self._trajectory.command(command)
        return Outcome(True, "following cmd_vel")

    def sample(self, t: float) -> Reference | None:
        """Return the reference at time ``t`` [s], ``None`` if there is none."""
        if self._trajectory is None:
            return None
        reference = self._trajectory.sample(t)
        if isinstance(self._trajectory, Teleop) and self._trajectory.at_rest(t):
            self._trajectory = None
        return reference

    def _teleop(self, start: Reference, t: float) -> Teleop:
        return Teleop(start, t, self._limits, self._config.cmd_vel_timeout_s)
