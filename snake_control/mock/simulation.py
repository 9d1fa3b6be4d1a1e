"""Moves servos, and the body they sit in, on in fixed steps of simulated time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.mock.servo import Servo


class BodyState(Protocol):
    """What the servos need to know of the body."""

    @property
    def effort(self) -> NDArray[np.float64]:
        """Torque that each joint has to apply to hold its angle [N m], shape (joints,)."""


State = TypeVar("State", bound=BodyState)
State_co = TypeVar("State_co", bound=BodyState, covariant=True)


class Body(Protocol[State_co]):
    """What the servos move."""

    def step(self, joint_command: ArrayLike, dt: float) -> State_co:
        """Advance by ``dt`` seconds at constant joint velocities [rad/s]."""


@dataclasses.dataclass(frozen=True)
class Mounting:
    """How one servo sits in its joint: servo angle = direction * joint angle + zero offset.

    Attributes:
        direction: +1 or -1.
        zero_offset_rad: servo angle at joint angle 0 [rad].
    """

    direction: int = 1
    zero_offset_rad: float = 0.0

    def __post_init__(self) -> None:
        if self.direction not in (1, -1) or not math.isfinite(self.zero_offset_rad):
            raise ValueError(f"no such mounting: {self}")

    def servo_angle(self, joint_angle_rad: float) -> float:
        """Servo angle at a joint angle [rad]."""
        return self.direction * joint_angle_rad + self.zero_offset_rad

    def joint_angle(self, servo_angle_rad: float) -> float:
        """Joint angle at a servo angle [rad]."""
        return self.direction * (servo_angle_rad - self.zero_offset_rad)


@dataclasses.dataclass(frozen=True)
class Snapshot(Generic[State]):
    """The body at one moment.

    Attributes:
        time: clock time that the state belongs to [s].
        state: what the body's last step returned.
    """

    time: float
    state: State


LARGEST_LAG_S = 0.1
"""Simulated time that is caught up after a stall; more is left out [s]."""


class Simulation:
    """Time for servos without a body: no load, nothing to hold them."""

    def __init__(self, servos: Sequence[Servo], step_s: float, start: float) -> None:
        """Prepare to step.

        Args:
            servos: what moves.
            step_s: length of a step [s].
            start: clock time of the state that the servos are in [s].
        """
        if not step_s > 0:
            raise ValueError(f"step_s = {step_s!r}: give more than 0")
        self._servos = tuple(servos)
        self._step_s = step_s
        self._time = start

    @property
    def time(self) -> float:
        """Clock time up to which everything has moved [s]."""
        return self._time

    @property
    def next_step_at(self) -> float:
        """Clock time at which the next step is due [s]."""
        return self._time + self._step_s

    def step_if_due(self, now: float) -> bool:
        """Do one step if its time has come; return whether it had.

        After a stall steps follow each other until time is caught up, but no more than
        ``LARGEST_LAG_S`` of it: a burst of motion would look like a fast robot.
        """
        if now < self.next_step_at:
            return False
        self._time = max(self._time, now - LARGEST_LAG_S - self._step_s)
        self._move(self._step_s)
        self._time += self._step_s
        return True

    def _move(self, dt: float) -> None:
        for servo in self._servos:
            servo.step(dt)


class BodySimulation(Simulation, Generic[State]):
    """Time for servos in a body: it loads them, they move it.

    Attributes:
        snapshot: the newest state; replaced as a whole, so any thread may read it.
    """

    snapshot: Snapshot[State]

    def __init__(
        self,
        servos: Sequence[Servo],
        mountings: Sequence[Mounting],
        body: Body[State],
        initial: State,
        step_s: float,
        start: float,
        *,
        steps_per_body_step: int = 1,
        held_until_torque_on: bool = True,
        on_snapshot: Callable[[Snapshot[State]], None] = lambda _: None,
    ) -> None:
        """Join servos and body.

        Args:
            servos: joint 1 first.
            mountings: how each sits in its joint.
            body: in the posture that the servos are in.
            initial: its state.
            step_s: length of a servo's step [s].
            start: clock time of that state [s].
            steps_per_body_step: how many steps of the servos make one of the body, which costs
                more; their load is constant meanwhile.
            held_until_torque_on: keep the body as it is until the first servo is driven, as a
                hand or a stand would; a raised head would sink meanwhile.
            on_snapshot: called with every new state, in the thread that steps.
        """
        super().__init__(servos, step_s, start)
        self._mountings = tuple(mountings)
        if len(self._mountings) != len(self._servos):
            raise ValueError("give one mounting for each servo")
        if steps_per_body_step < 1:
            raise ValueError(f"steps_per_body_step = {steps_per_body_step}: give 1 or more")
        self._body = body
        self._steps_per_body_step = steps_per_body_step
        self._steps = 0
        self._at_body_step = self._joint_angles()
        self._on_snapshot = on_snapshot
        self._held = held_until_torque_on
        self.snapshot = Snapshot(start, initial)

    @property
    def held(self) -> bool:
        """Whether something still keeps the body from moving."""
        return self._held

    def _move(self, dt: float) -> None:
        if self._held:
            self._held = not any(servo.driven for servo in self._servos)
        if not self._held:
            efforts = self.snapshot.state.effort.tolist()
            for servo, mounting, effort in zip(self._servos, self._mountings, efforts, strict=True):
                servo.step(dt, mounting.direction * effort)
        self._steps += 1
        if self._steps == self._steps_per_body_step:
            self._steps = 0
            self._move_body(dt * self._steps_per_body_step, self._time + dt)

    def _move_body(self, dt: float, time: float) -> None:
        state = self.snapshot.state
        if not self._held:
            angles = self._joint_angles()
            state = self._body.step((angles - self._at_body_step) / dt, dt)
            self._at_body_step = angles
        self.snapshot = Snapshot(time, state)
        self._on_snapshot(self.snapshot)

    def _joint_angles(self) -> NDArray[np.float64]:
        return np.array(
            [
                mounting.joint_angle(servo.motion.angle_rad)
                for servo, mounting in zip(self._servos, self._mountings, strict=True)
            ]
        )
