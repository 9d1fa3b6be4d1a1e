"""Lowers the robot: all joints move slowly to a pose and arrive together, before torque goes off.

Velocities follow from the newest readings alone, so that a joint that lags makes the others wait:
the joint with the longest way to go moves at the given speed, each of the others at the part of it
that its own way is of the longest one. Close to the pose the speed falls with the distance.

The joint with the longest way tells whether there is progress. One that is blocked becomes the
longest sooner or later, when the others have come nearer. Then the lowering is given up: pressing
on heats the servo until it shuts itself down, and a joint that lets go there lets the robot fall.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from typing import NamedTuple

TOLERANCE_RAD = 0.03
"""So close to the pose every joint is there; an AX-12 counts in steps of 0.005 rad."""

PATIENCE_S = 2.0
"""Without progress for so long the lowering is given up."""

_PROGRESS_RAD = 0.01
_LAST_S = 0.2


class Phase(enum.Enum):
    """How far a lowering is."""

    MOVING = enum.auto()
    DONE = enum.auto()
    GIVEN_UP = enum.auto()


class Step(NamedTuple):
    """What one cycle of a lowering asks for.

    Attributes:
        phase: unless it is ``MOVING`` all velocities are 0.
        velocities: one per joint [rad/s].
        farthest: index of the joint with the longest way to go.
        distance: that way, not negative [rad].
    """

    phase: Phase
    velocities: tuple[float, ...]
    farthest: int
    distance: float


class Lowering:
    """One lowering from where the joints are to a pose."""

    def __init__(self, pose: Sequence[float | None], speed: float, now: float) -> None:
        """Begin.

        Args:
            pose: angle of each joint [rad]; ``None`` for a joint that stays (one in wheel mode
                has no position to move to).
            speed: of the joint with the longest way to go [rad/s].
            now: monotonic time [s].
        """
        self._pose = tuple(pose)
        self._speed = speed
        self._nearest = math.inf
        self._nearest_at = now

    def step(self, angles: Sequence[float], now: float) -> Step:
        """Return what to do in this cycle.

        Args:
            angles: of all joints, as last read [rad].
            now: monotonic time [s].
        """
        ways = [
            0.0 if goal is None else goal - angle
            for goal, angle in zip(self._pose, angles, strict=True)
        ]
        farthest = max(range(len(ways)), key=lambda i: abs(ways[i]))
        distance = abs(ways[farthest])
        rest = (0.0,) * len(ways)
        if distance <= TOLERANCE_RAD:
            return Step(Phase.DONE, rest, farthest, distance)
        if distance <= self._nearest - _PROGRESS_RAD:
            self._nearest, self._nearest_at = distance, now
        elif now - self._nearest_at > PATIENCE_S:
            return Step(Phase.GIVEN_UP, rest, farthest, distance)
        duration = max(distance / self._speed, _LAST_S)
        return Step(Phase.MOVING, tuple(way / duration for way in ways), farthest, distance)
