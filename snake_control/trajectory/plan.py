"""From a trajectory that somebody asks for to a motion that begins where the head is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.errors import SnakeError, TrajectoryError
from snake_control.trajectory.motion import Braking, Chain, Motion, Profile, Started
from snake_control.trajectory.motion_limits import PITCH_LIMIT_RAD
from snake_control.trajectory.segments import (
    BLEND,
    NOTHING_SAID,
    REST,
    Line,
    Place,
    Poses,
    Segment,
    Settings,
)

Array = NDArray[np.float64]

_ROUNDING = 1.0 + 1e-6
_TURN_RAD = 1.2
"""So far a head may turn in its place: on the spot, or faster than its body can follow."""


@dataclasses.dataclass(frozen=True)
class Course:
    """A trajectory, not yet bound to a place.

    Attributes:
        segments: one after the other.
        settings: of those segments that say nothing themselves.
        names: what to call each segment; empty for a course of one part.
    """

    segments: tuple[Segment, ...]
    settings: Settings = NOTHING_SAID
    names: tuple[str, ...] = ()


def course_through(
    poses: ArrayLike,
    times: Sequence[float] = (),
    frame: str = "world",
    rates: ArrayLike | None = None,
    what: str = "pose",
) -> Course:
    """Return the course through poses.

    Args:
        poses: [x, y, z, R, P, Y], (k, 6) [m, rad].
        times: when to be there, counted from the start, rising [s]; none for a speed.
        frame: what they are relative to (``Settings.frame``).
        rates: of the poses in the world, (k, 6) [m/s, rad/s], where they are known.
        what: what to call one of them.

    Raises:
        TrajectoryError: what cannot be.
    """
    rows = _rows(poses)
    if times and len(times) != len(rows):
        raise TrajectoryError(f"{len(times)} times for {len(rows)} poses: give one for each")
    part = Poses(
        poses=rows,
        times_s=tuple(times) or None,
        rates=None if rates is None else _rows(rates),
        names=tuple(f"{what} {i}" for i in range(len(rows))),
    )
    return Course((part,), Settings(frame=frame))


def timed_course(
    poses: ArrayLike,
    times: Sequence[float],
    names: Sequence[str],
    frame: str = "world",
    rates: ArrayLike | None = None,
    lead_s: float | None = None,
) -> Course:
    """Return the way to a first pose, and from rest there through the others.

    Args:
        poses: [x, y, z, R, P, Y], (k, 6) [m, rad].
        times: when to be there, rising [s], the first one being when the head leaves the first
            pose; empty for a speed.
        names: what to call each pose.
        frame: what the poses are relative to (``Settings.frame``).
        rates: of the poses in the world, (k, 6) [m/s, rad/s], where they are known.
        lead_s: how long the way to the first pose shall take [s]; ``None`` for a speed.

    Raises:
        TrajectoryError: no poses.
    """
    rows, settings = _rows(poses), Settings(frame=frame)
    first: Segment = Line(to=rows[0], settings=settings)
    if lead_s is not None:
        first = Poses(poses=rows[:1], times_s=(lead_s,), names=(names[0],), settings=settings)
    if len(rows) == 1:
        return Course((first,), names=(names[0],))
    then = Poses(
        poses=rows,
        times_s=tuple(t - times[0] for t in times) or None,
        rates=None if rates is None else _rows(rates),
        names=tuple(names),
        settings=settings,
    )
    return Course((first, then), names=(f"on the way to {names[0]}", ""))


def _rows(poses: ArrayLike) -> tuple[tuple[float, ...], ...]:
    w = np.reshape(np.asarray(poses, dtype=float), (-1, 6))
    if not len(w):
        raise TrajectoryError("no poses: give one or more")
    return tuple(tuple(row) for row in w.tolist())


def at_speed(course: Course, speed: float, turning_speed: float) -> Course:
    """Return a course with speeds for those segments that say nothing; 0 is no speed, either.

    Raises:
        TrajectoryError: a speed that is none.
    """
    for name, value in (("speed", speed), ("turning_speed", turning_speed)):
        if not 0.0 <= value < np.inf:
            raise TrajectoryError(f"{name} is {value}: give more than 0, or 0 for the default")
    said = Settings(speed_m_s=speed or None, turning_speed_rad_s=turning_speed or None)
    return dataclasses.replace(course, settings=course.settings.over(said))


class _Part(NamedTuple):
    """One segment of a plan: its name, what it is, its motion, and when that begins [s]."""

    name: str
    segment: Segment
    motion: Motion
    begin: float


class Plan:
    """A course from where the head is, checked and ready to be started.

    Attributes:
        duration: [s].
        length: of the tip's path [m].
        begin: pose at which it begins, (6,) [m, rad].
        begins: when each of its parts begins [s].
    """

    def __init__(self, config: TrajectoryGeneratorConfig, course: Course, start: Reference) -> None:
        """Plan a motion.

        Args:
            config: speeds, and what is allowed.
            course: what to do.
            start: where it begins, and with which rate; if that is not 0, the head comes to rest
                while the course begins.

        Raises:
            TrajectoryError: what cannot be, and where.
        """
        self._config = config
        self.begin = np.array(start.w_d)
        defaults = Settings(
            "start", REST, config.speed_m_s, config.turning_speed_rad_s, config.acceleration_m_s2
        )
        braking = Braking(
            start, config.max_linear_acceleration_m_s2, config.max_angular_acceleration_rad_s2
        )
        here = first = braking.sample(braking.duration).w_d
        motions: list[Motion] = []
        overlaps: list[float] = []
        names = course.names or ("",) * len(course.segments)
        for name, segment in zip(names, course.segments, strict=True):
            settings = segment.settings.over(course.settings.over(defaults))
            try:
                self._check_settings(settings)
                motion = segment.motion(Place(first, here, settings))
            except SnakeError as error:
                raise TrajectoryError(_joined(name, str(error))) from error
            if motions:
                ramp = min(motions[-1].ramp, motion.ramp)
                overlaps.append(ramp if settings.join == BLEND else 0.0)
            motions.append(motion)
            here = motion.sample(motion.duration).w_d
        course_alone = Chain(motions, overlaps)
        if not course_alone.duration > 0.0:
            raise TrajectoryError("there is no way to go: the head is where it shall be")
        self._parts = [
            _Part(*part)
            for part in zip(names, course.segments, motions, course_alone.begins, strict=True)
        ]
        self._late = 0.0
        seen = course_alone.profile()
        self._check(seen)
        self.length = float(np.linalg.norm(np.diff(seen.w[:, :3], axis=0), axis=1).sum())
        self._motion = course_alone
        if braking.duration > 0.0:
            self._motion = Chain([braking, *motions], [braking.duration, *overlaps])
            self._late = self._motion.begins[1]
        self.begins = self._motion.begins
        self.duration = self._motion.duration

    def made(self) -> Callable[[float], Started]:
        """Return what makes the motion for the time at which it starts [s]."""
        return lambda start: Started(self._motion, start)

    def where(self, t: float) -> str:
        """Return the name of the segment, and part of it, at time ``t`` since its start [s]."""
        t = max(t - self._late, 0.0)
        part = [part for part in self._parts if part.begin <= t][-1]
        inside = part.segment.where(part.motion, t - part.begin)
        return ", ".join(name for name in (part.name, inside) if name)

    def _check_settings(self, settings: Settings) -> None:
        for name, limit in (
            ("speed_m_s", "max_linear_speed_m_s"),
            ("turning_speed_rad_s", "max_angular_speed_rad_s"),
            ("acceleration_m_s2", "max_linear_acceleration_m_s2"),
        ):
            value, most = getattr(settings, name), getattr(self._config, limit)
            if value > most:
                raise TrajectoryError(f"{name} = {value:g}: at most {limit} = {most:g}")

    def _check(self, seen: Profile) -> None:
        config = self._config
        limits = (
            (
                np.linalg.norm(seen.rate[:, :3], axis=1),
                config.max_linear_speed_m_s,
                "the head would move at {:.3g} m/s{}, allowed: max_linear_speed_m_s = {:g}",
            ),
            (
                np.abs(seen.rate[:, 3:]).max(axis=1),
                config.max_angular_speed_rad_s,
                "the head would turn at {:.3g} rad/s{}, allowed: max_angular_speed_rad_s = {:g}",
            ),
            (
                np.abs(seen.w[:, 4]),
                PITCH_LIMIT_RAD,
                "the head would pitch by {:.3g} rad{}, allowed: +-{:.3g}",
            ),
            (
                np.linalg.norm(seen.acceleration[:, :3], axis=1),
                config.max_linear_acceleration_m_s2,
                "the head would speed up by {:.3g} m/s^2{}, allowed: max_linear_acceleration_m_s2 "
                "= {:g}",
            ),
        )
        for values, limit, words in limits:
            i = int(np.argmax(values))
            if values[i] > limit * _ROUNDING:
                t = float(seen.t[i])
                raise TrajectoryError(
                    _joined(self.where(t), words.format(values[i], f" after {t:.1f} s", limit))
                )
        self._check_curves(seen)

    def _check_curves(self, seen: Profile) -> None:
        """Refuse what turns on for too long on the spot: the body cannot follow."""
        least = self._config.min_turn_radius_m
        yaw = seen.w[:, 5]
        # Between two moments: how far it went, and how far it turned.
        way = np.linalg.norm(np.diff(seen.w[:, :2], axis=0), axis=1)
        turn = np.diff(yaw)
        tight = np.abs(turn) * least > way * _ROUNDING
        begin = 0
        for i, is_tight in enumerate(tight.tolist()):
            if not is_tight or (i > begin and turn[i] * turn[i - 1] < 0.0):
                begin = i + (not is_tight)
            turned = abs(float(yaw[i + 1] - yaw[begin]))
            if is_tight and turned > _TURN_RAD:
                t = float(seen.t[i + 1])
                radius = float(way[begin : i + 1].sum()) / turned
                x, y = seen.w[i + 1, :2]
                raise TrajectoryError(
                    _joined(
                        self.where(t),
                        f"the curve at x = {x:.3f}, y = {y:.3f} m has a radius of {radius:.2g} m "
                        f"and goes on for more than {_TURN_RAD} rad; the body cannot follow, "
                        f"allowed: min_turn_radius_m = {least:g}",
                    )
                )


def _joined(where: str, what: str) -> str:
    return f"{where}: {what}" if where else what
