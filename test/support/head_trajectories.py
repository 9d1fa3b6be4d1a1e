"""Random head trajectories that the paper's robot can do, and references that it cannot do.

Written before anything that judges them: the first kind is built from what the robot is for, the
head moving forward along gentle curves about the height and attitude of the experiment (z_h =
0.2 m, R = P = 22.5 degrees), with speeds up to 0.03 m/s, three times that of the paper.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from snake_control.control.reference import Reference
from snake_control.trajectory.head_trajectory import HeadTrajectory
from snake_control.trajectory.path import Along, Circle, FigureEight
from snake_control.trajectory.waypoints import Waypoints, times_at_speed

Array = NDArray[np.float64]

SEED = 20261126
HIGHEST_SPEED = 0.03
KINDS = ("line", "arc", "circle", "eight", "waypoints")


@dataclasses.dataclass(frozen=True)
class Feasible:
    """One trajectory; it starts at ``start`` = [x, y, z, R, P, Y], at rest.

    Attributes:
        name: kind and number.
        start: first pose, (6,) [m, rad].
        duration: nominal [s].
        made: makes the motion; ``made(t)`` starts at time ``t`` [s].
    """

    name: str
    start: Array
    duration: float
    made: Callable[[float], HeadTrajectory]


def feasible(count: int = 200, seed: int = SEED) -> list[Feasible]:
    """Return trajectories, the same for the same seed whatever the ``count``."""
    streams = np.random.SeedSequence(seed).spawn(count)
    return [_feasible(i, np.random.default_rng(stream)) for i, stream in enumerate(streams)]


def _feasible(number: int, rng: np.random.Generator) -> Feasible:
    kind = KINDS[number % len(KINDS)]
    speed = float(rng.uniform(0.005, HIGHEST_SPEED))
    start = np.array(
        [
            rng.uniform(-0.02, 0.02),
            rng.uniform(-0.02, 0.02),
            rng.uniform(0.185, 0.205),
            rng.uniform(0.2, 0.5),
            rng.uniform(0.2, 0.5),
            rng.uniform(-0.1, 0.1),
        ]
    )
    length = speed * float(rng.uniform(15.0, 40.0))
    side = 1.0 if rng.random() < 0.5 else -1.0
    radius = side * float(rng.uniform(0.3, 0.6))
    if kind == "waypoints":
        poses = _walk(start, length, rng)
        times = times_at_speed(poses, speed, 0.15)
        return Feasible(
            f"{kind}_{number}",
            start,
            times[-1],
            lambda t: Waypoints(times, poses, t),
        )
    path = {
        # A line is a circle nobody sees the curvature of.
        "line": lambda: Circle(start, side * 1e4, length / (math.tau * 1e4)),
        "arc": lambda: Circle(start, radius, length / (math.tau * abs(radius))),
        "circle": lambda: Circle(start, radius, 1.0),
        "eight": lambda: FigureEight(start, radius, 0.5),
    }[kind]()
    motion = Along(path, speed, 0.02)
    return Feasible(
        f"{kind}_{number}", start, motion.duration, lambda t: Along(path, speed, 0.02, t)
    )


def _walk(start: Array, length: float, rng: np.random.Generator) -> Array:
    """Poses ahead of each other, with small changes of height and attitude."""
    legs = int(rng.integers(3, 6))
    poses = [start]
    for _ in range(legs):
        before = poses[-1]
        turn = float(rng.uniform(-0.35, 0.35))
        heading = before[5] + 0.5 * turn
        pose = before.copy()
        pose[0] += length / legs * math.cos(heading)
        pose[1] += length / legs * math.sin(heading)
        pose[2] = float(np.clip(before[2] + rng.uniform(-0.01, 0.01), 0.185, 0.205))
        pose[3:5] = np.clip(before[3:5] + rng.uniform(-0.08, 0.08, 2), 0.2, 0.5)
        pose[5] = before[5] + turn
        poses.append(pose)
    return np.array(poses)


HOSTILE_KINDS = (
    "too_high",
    "too_low",
    "too_fast",
    "jump",
    "not_a_number",
    "time_reversed",
    "straight_until_singular",
    "standing_on_the_nose",
    "sideways",
    "backwards",
    "spinning",
    "trembling",
)


@dataclasses.dataclass(frozen=True)
class Hostile:
    """A reference that the robot cannot or must not follow, from a settled posture on.

    Attributes:
        name: kind and number.
        kind: of ``HOSTILE_KINDS``.
        duration: how long it is given [s].
        reference: pose and rate at a time since its start [s]; may jump, and may be not finite.
    """

    name: str
    kind: str
    duration: float
    reference: Callable[[float], Reference]


def hostile(start: Array, count: int = 100, seed: int = SEED + 1) -> list[Hostile]:
    """Return hostile references for a head that is at ``start`` = w, (6,) [m, rad]."""
    streams = np.random.SeedSequence(seed).spawn(count)
    return [
        _hostile(i, np.array(start), np.random.default_rng(stream))
        for i, stream in enumerate(streams)
    ]


def _hostile(number: int, start: Array, rng: np.random.Generator) -> Hostile:
    kind = HOSTILE_KINDS[number % len(HOSTILE_KINDS)]
    size = float(rng.uniform(0.3, 1.0))
    rate = np.zeros(6)
    duration = 8.0
    if kind == "too_high":
        rate[2] = 0.05 * size
    elif kind == "too_low":
        rate[2] = -0.05 * size
    elif kind == "too_fast":
        rate[0] = 1.0 * size
    elif kind == "straight_until_singular":
        rate[0], duration = 0.03, 40.0
    elif kind == "standing_on_the_nose":
        rate[4] = 0.6 * size
    elif kind == "sideways":
        rate[1] = 0.15 * size * (1.0 if rng.random() < 0.5 else -1.0)
    elif kind == "backwards":
        rate[0] = -0.1 * size
    elif kind == "spinning":
        rate[5] = 1.5 * size
    jumps = rng.uniform(-0.29, 0.29, (200, 6)) * size

    def reference(t: float) -> Reference:
        w_d, w_d_dot = start + rate * t, rate
        if kind == "jump":
            w_d = start + jumps[int(t / 2.0) % len(jumps)]
        elif kind == "trembling":
            w_d = start + 0.3 * jumps[int(t / 0.1) % len(jumps)]
        elif kind == "not_a_number" and math.fmod(t, 1.0) > 0.5:
            w_d = start.copy()
            w_d[number % 6] = math.nan if size < 0.65 else math.inf
        elif kind == "time_reversed":
            w_d = start + np.array([0.02, 0, 0, 0, 0, 0]) * (4.0 - t)
            w_d_dot = np.array([0.02, 0, 0, 0, 0, 0])
        return Reference(w_d, w_d_dot)

    return Hostile(f"{kind}_{number}", kind, duration, reference)
