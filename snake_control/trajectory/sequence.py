"""What the head shall do now: nothing, follow a trajectory, follow commands, or come to rest."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.trajectory.configured import configured_trajectory, needs_head
from snake_control.trajectory.head_trajectory import HeadTrajectory
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

    ``now`` is the time of a steady clock [s], in rising order. The motion's own time follows it
    from sample to sample, but by no more than two sample periods at once: after a stall the
    reference goes on from where it was, and does not make up for the time lost.

    Attributes:
        time_scale: how fast the motion's own time goes, 0..1, but for coming to rest, which takes
            no longer than it must. Whoever follows the reference decides it.
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
        self._longest_step = 2.0 / config.rate_hz
        self._t = 0.0
        self._sampled_at: float | None = None
        self._trajectory: HeadTrajectory | None = None
        self._command_ends = 0.0
        self.time_scale = 1.0

    @property
    def idle(self) -> bool:
        """Whether there is no reference."""
        return self._trajectory is None

    @property
    def line(self) -> Line | None:
        """The line being followed, if it is one; in the motion's own time."""
        return self._trajectory if isinstance(self._trajectory, Line) else None

    @property
    def commanded(self) -> bool:
        """Whether a velocity command is being followed."""
        return isinstance(self._trajectory, Teleop) and self._trajectory.commanded

    def motion_time(self, now: float) -> float:
        """Return the motion's own time at ``now`` [s]."""
        if self._sampled_at is None:
            return self._t
        elapsed = min(max(now - self._sampled_at, 0.0), self._longest_step)
        return self._t + self._scale * elapsed

    @property
    def _scale(self) -> float:
        braking = isinstance(self._trajectory, Teleop) and not self.commanded
        return 1.0 if braking else self.time_scale

    def start(self, now: float, head: Array | None) -> Outcome:
        """Follow the configured trajectory from now on.

        Args:
            now: time of the steady clock [s].
            head: w of the head now, shape (6,), ``None`` if it is not known.
        """
        if self._trajectory is not None:
            return Outcome(False, "a reference is being followed already; call ~/stop first")
        if needs_head(self._config) and head is None:
            return Outcome(False, _NO_HEAD)
        self._trajectory = configured_trajectory(self._config, head, self.motion_time(now))
        if self._config.trajectory == "hold":
            return Outcome(True, "holding the head where it is")
        return Outcome(True, f"following the line from {self._config.start_from}")

    def here(self, now: float, head: Array | None) -> Reference | None:
        """Return where a motion that takes over would begin: the reference, or the head at rest.

        ``None`` if there is no reference and the head is not known.
        """
        if self._trajectory is not None:
            return self._trajectory.sample(self.motion_time(now))
        return None if head is None else Reference(head, np.zeros(6))

    def follow(self, made: Callable[[float], HeadTrajectory], now: float) -> None:
        """Follow a motion from now on, whatever was followed before.

        Args:
            made: makes it for the time at which it starts; it begins ``here``.
            now: time of the steady clock [s].
        """
        self._trajectory = made(self.motion_time(now))

    def stop(self, now: float) -> Outcome:
        """Bring the head to rest from what it does at ``now`` [s], then give no reference."""
        if self._trajectory is None:
            return Outcome(True, "nothing to stop")
        self._trajectory = self._teleop(now)
        return Outcome(True, "coming to rest")

    def command(
        self, command: HeadVelocityCommand, now: float, head: Array | None, age: float = 0.0
    ) -> Outcome:
        """Follow a velocity command, until the next one or for ``cmd_vel_timeout_s`` (dead-man).

        It starts at the reference being followed, with its rate, or else at the head, at rest.
        A zero command only counts after others: a joystick at rest starts and takes over nothing.

        Args:
            command: wanted velocities.
            now: time of the steady clock [s].
            head: w of the head now, shape (6,), ``None`` if it is not known.
            age: how long ago the command was given [s].
        """
        if command.is_zero and not self.commanded:
            return Outcome(True, "a zero command changes nothing here")
        teleop = self._trajectory
        if not isinstance(teleop, Teleop):
            if teleop is None and head is None:
                return Outcome(False, _NO_HEAD)
            self._trajectory = teleop = self._teleop(now, head)
        teleop.command(command)
        self._command_ends = now - age + self._config.cmd_vel_timeout_s
        return Outcome(True, "following cmd_vel")

    def sample(self, now: float) -> Reference | None:
        """Return the reference at ``now`` [s], ``None`` if there is none."""
        self._t = self.motion_time(now)
        self._sampled_at = now
        if self._trajectory is None:
            return None
        teleop = self._trajectory if isinstance(self._trajectory, Teleop) else None
        if teleop is not None and now > self._command_ends:
            teleop.release()
        reference = dataclasses.replace(self._trajectory.sample(self._t), time_scale=self._scale)
        if teleop is not None and teleop.at_rest:
            self._trajectory = None
        return reference

    def _teleop(self, now: float, head: Array | None = None) -> Teleop:
        t = self.motion_time(now)
        if self._trajectory is not None:
            start = self._trajectory.sample(t)
        else:
            assert head is not None
            start = Reference(head, np.zeros(6))
        return Teleop(start, t, self._limits)
