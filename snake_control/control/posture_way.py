"""Ways from posture to posture that keep the robot on its wheels, off the floor and off itself.

A straight line in joint space may tip the robot or drive its head into the floor though both its
ends are good. Then the joints of head and base move one after the other, in the first order that
passes: the body before the head (to raise it on a base that is spread), the head before the body
(to lower it before the base is straightened), or the head stretched out while the body moves.

All joints of the base turn about the vertical (Assumption 2), so that no motion of the joints lifts
it off the floor. But in general its wheels slip: joint velocities that agree with all of them are
those of the control law alone.
"""

from __future__ import annotations

import dataclasses
import enum
import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig, SupervisorConfig
from snake_control.model.bodies import Bodies
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.geometry import geometry
from snake_control.model.stability import support

Array = NDArray[np.float64]

STEP_RAD = 0.02
"""A way is looked at wherever its fastest joint has turned this far."""

_NO_WORSE = 1e-6
_MOVED_RAD = 1e-6


class Obstacle(enum.Enum):
    """What can be in the way of a posture."""

    FALL = "falling"
    FLOOR = "the floor"
    ITSELF = "the robot itself"


class Order(enum.Enum):
    """In which order the joints move."""

    AT_ONCE = "all joints at once"
    BODY_FIRST = "the body first, then the head"
    HEAD_FIRST = "the head first, then the body"
    HEAD_DOWN = "the head stretched out first, then the body, then the head"


@dataclasses.dataclass(frozen=True)
class Hindrance:
    """Where a way is blocked.

    Attributes:
        obstacle: by what.
        margin: what is left there, negative [m].
        share: after which share of the way, 0..1.
    """

    obstacle: Obstacle
    margin: float
    share: float


@dataclasses.dataclass(frozen=True, eq=False)
class Found:
    """What a search for a way found.

    Attributes:
        corners: where to go straight, one after the other, the start first; empty if all orders
            are blocked, (k, n-1) [rad].
        order: the order of ``corners``, or ``None``.
        least: the smallest margins along the way.
        text: the order, and what is in the way of moving all joints at once; or of every order,
            what is in its way, and where.
    """

    corners: tuple[Array, ...]
    order: Order | None
    least: dict[Obstacle, float]
    text: str


class PostureMargins:
    """What is left, in metres, before something happens to a robot that stands level."""

    def __init__(self, robot: RobotConfig, supervisor: SupervisorConfig) -> None:
        self._robot = robot
        self._d_min = supervisor.d_min_stop_m
        self._base = np.zeros(3)

    def d_min(self, phi: ArrayLike) -> float:
        """Return d_min (30) for joint angles, (n-1,) [rad], as if nothing but wheels stood [m]."""
        w = head_pose_on_floor(self._robot, phi, self._base)
        return support(geometry(self._robot, np.concatenate((w, phi)))).d_min

    def at(self, phi: ArrayLike) -> dict[Obstacle, float]:
        """Return the margins for joint angles, (n-1,) [rad]; d_min less ``d_min_stop_m``."""
        bodies = Bodies(self._robot, phi)
        return {
            Obstacle.FALL: self.d_min(phi) - self._d_min,
            Obstacle.FLOOR: bodies.ground_clearance,
            Obstacle.ITSELF: bodies.self_clearance,
        }

    def d_min_of(self, margins: dict[Obstacle, float]) -> float:
        """Return the d_min that belongs to margins [m]."""
        return margins[Obstacle.FALL] + self._d_min

    def words(self, obstacle: Obstacle, margin: float) -> str:
        """Return what a negative margin means."""
        if obstacle is Obstacle.FALL:
            d_min, least = 1e3 * (margin + self._d_min), 1e3 * self._d_min
            return f"{obstacle.value} (d_min {d_min:.1f} mm, d_min_stop_m is {least:.1f} mm)"
        if obstacle is Obstacle.FLOOR:
            return f"{obstacle.value} (the head part would be {-1e3 * margin:.0f} mm in it)"
        return f"{obstacle.value} (two links would be {-1e3 * margin:.0f} mm in each other)"


class PostureWays:
    """Finds ways for one robot."""

    def __init__(self, robot: RobotConfig, supervisor: SupervisorConfig) -> None:
        self._robot = robot
        self._margins = PostureMargins(robot, supervisor)

    def find(self, start: Array, goal: Array) -> Found:
        """Return the first way that nothing is in.

        Where a margin is used up at the start already, it must grow until it no longer is: who
        stands badly may leave that posture, but not by a worse one.

        Args:
            start, goal: joint angles, (n-1,) [rad].
        """
        there = self._margins.at(goal)
        worst = min(there, key=there.__getitem__)
        if there[worst] < 0.0:
            what = self._margins.words(worst, there[worst])
            return Found((), None, {}, f"the posture itself: {what}")
        refused: list[str] = []
        for order, corners in self._orders(start, goal):
            least, hindrance = self._look(corners)
            if hindrance is None:
                text = f"{order.value}, because of: {refused[0]}" if refused else order.value
                return Found(tuple(corners), order, least, text)
            what = self._margins.words(hindrance.obstacle, hindrance.margin)
            refused.append(f"{order.value}: {what} after {100 * hindrance.share:.0f} % of the way")
        return Found((), None, {}, "; ".join(refused))

    def _orders(self, start: Array, goal: Array) -> Iterator[tuple[Order, list[Array]]]:
        head = self._robot.head_links
        yield Order.AT_ONCE, [start, goal]
        moved = np.abs(goal - start) > _MOVED_RAD
        if not moved[head:].any() or head == 0:
            return
        body_only = np.concatenate((start[:head], goal[head:]))
        head_only = np.concatenate((goal[:head], start[head:]))
        if moved[:head].any():
            yield Order.BODY_FIRST, [start, body_only, goal]
            yield Order.HEAD_FIRST, [start, head_only, goal]
        flat = np.zeros(head)
        down, up = (np.concatenate((flat, end[head:])) for end in (start, goal))
        yield Order.HEAD_DOWN, [start, down, up, goal]

    def _look(self, corners: list[Array]) -> tuple[dict[Obstacle, float], Hindrance | None]:
        """Return the smallest margins of a way, and what is in it."""
        points = list(_along(corners))
        least = allowed = self._margins.at(points[0])
        for i, phi in enumerate(points[1:], start=1):
            margins = self._margins.at(phi)
            for obstacle, margin in margins.items():
                if margin < min(allowed[obstacle], 0.0) - _NO_WORSE:
                    return least, Hindrance(obstacle, margin, i / (len(points) - 1))
            # What has grown since the start may not be lost again.
            allowed = {o: max(margin, allowed[o]) for o, margin in margins.items()}
            least = {o: min(margin, least[o]) for o, margin in margins.items()}
        return least, None


def _along(corners: list[Array]) -> Iterator[Array]:
    yield corners[0]
    for start, end in itertools.pairwise(corners):
        way = end - start
        steps = max(1, int(np.ceil(np.abs(way).max(initial=0.0) / STEP_RAD)))
        for k in range(1, steps + 1):
            yield start + (k / steps) * way
