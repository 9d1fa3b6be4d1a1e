"""What a trajectory consists of: lines, arcs, circles, eights, poses to go through, pauses."""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config.parameter import parameter
from snake_control.errors import ConfigError, TrajectoryError
from snake_control.model.rotation import unwrap_near
from snake_control.trajectory.motion import Motion, Rest
from snake_control.trajectory.path import Along, Circle, FigureEight, Path, Straight, Through
from snake_control.trajectory.waypoints import (
    Waypoints,
    check_poses,
    lengths_at_speed,
    unwrapped,
)

Array = NDArray[np.float64]

REST, BLEND = "rest", "blend"
_SAME = 1e-9
_NEAR = 1e-6


@dataclasses.dataclass(frozen=True)
class Settings:
    """What may be said once for all segments, or for one; ``None`` for what nobody said."""

    frame: str | None = parameter(
        None,
        "what poses and ways are relative to: start (where the head is when the trajectory begins, "
        "x the way it looks, z up), segment (the same where the segment begins), or world",
        choices=("start", "segment", "world"),
    )
    join: str | None = parameter(
        None,
        "how a segment follows on the one before: rest, or blend (it speeds up while that one "
        "slows down, which cuts the corner)",
        choices=(REST, BLEND),
    )
    speed_m_s: float | None = parameter(None, "speed of the tip [m/s]", low=1e-4, high=1.0)
    turning_speed_rad_s: float | None = parameter(
        None, "speed of each of roll, pitch and yaw; the slower counts [rad/s]", low=1e-4, high=10.0
    )
    acceleration_m_s2: float | None = parameter(
        None, "how fast the tip speeds up and slows down [m/s^2]", low=1e-3, high=100.0
    )

    def over(self, other: Settings) -> Settings:
        """Return these settings, and those of ``other`` where these say nothing."""
        said = {k: v for k, v in dataclasses.asdict(self).items() if v is not None}
        return dataclasses.replace(other, **said)


NOTHING_SAID = Settings()


@dataclasses.dataclass(frozen=True)
class Place:
    """Where a segment begins, and what counts there.

    Attributes:
        start: pose at which the trajectory begins, (6,) [m, rad].
        here: pose at which the segment begins, (6,).
        settings: complete.
    """

    start: Array
    here: Array
    settings: Settings

    @property
    def speed(self) -> float:
        """Speed of the tip [m/s]."""
        assert self.settings.speed_m_s is not None
        return self.settings.speed_m_s

    @property
    def turning_speed(self) -> float:
        """Speed of roll, pitch and yaw [rad/s]."""
        assert self.settings.turning_speed_rad_s is not None
        return self.settings.turning_speed_rad_s

    @property
    def origin(self) -> Array:
        """What poses are relative to, (6,)."""
        return {"start": self.start, "segment": self.here, "world": np.zeros(6)}[
            self.settings.frame or "world"
        ]

    def way(self, by: Sequence[float]) -> Array:
        """Return a way of 3 or 6 numbers, or its rate, in the world, (6,)."""
        way = np.zeros(6)
        way[: len(by)] = by
        c, s = math.cos(self.origin[5]), math.sin(self.origin[5])
        way[:2] = c * way[0] - s * way[1], s * way[0] + c * way[1]
        return way

    def pose(self, given: Sequence[float], before: Array) -> Array:
        """Return a pose of 3 or 6 numbers in the world, (6,): turned the shorter way.

        Args:
            given: relative to the origin; 3 numbers leave the attitude as it was.
            before: pose before it, (6,).
        """
        placed = self.origin + self.way(given)
        if len(given) == 3:
            placed[3:] = before[3:]
        placed[3:] = unwrap_near(placed[3:], before[3:])
        return placed

    def along(self, path: Path) -> Motion:
        """Return the motion along a path."""
        assert self.settings.acceleration_m_s2 is not None
        return Along(path, self.speed, self.settings.acceleration_m_s2)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Segment(abc.ABC):
    """One part of a trajectory.

    Attributes:
        kind: what it is called.
        settings: those of its own.
    """

    kind: ClassVar[str]
    settings: Settings = NOTHING_SAID

    @abc.abstractmethod
    def motion(self, place: Place) -> Motion:
        """Return the motion from ``place.here``, from rest to rest.

        Raises:
            TrajectoryError: a pose that cannot be.
        """

    def where(self, motion: Motion, t: float) -> str:
        """Return in which part of it ``motion`` is at its time ``t`` [s]; empty if it has none."""
        return ""


def _three_or_six(field: str, values: Sequence[float]) -> None:
    if len(values) not in (3, 6):
        raise ConfigError(
            field, list(values), "give 3 numbers (x, y, z) or 6 (x, y, z, roll, pitch, yaw)"
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Line(Segment):
    """Straight to a pose, by a way, or with a velocity for a time."""

    kind: ClassVar[str] = "line"
    to: tuple[float, ...] | None = parameter(
        None, "pose at its end; the attitude by the shorter way [m, rad]"
    )
    by: tuple[float, ...] | None = parameter(None, "way to go [m, rad]")
    velocity: tuple[float, ...] | None = parameter(None, "rate of the pose [m/s, rad/s]")
    duration_s: float | None = parameter(
        None,
        "for how long to go at this velocity; speeding up and slowing down take longer [s]",
        low=1e-3,
        high=1e5,
    )

    def __post_init__(self) -> None:
        given = [name for name in ("to", "by", "velocity") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ConfigError("to, by, velocity", given, "give one of the three")
        _three_or_six(given[0], getattr(self, given[0]))
        if (self.velocity is None) != (self.duration_s is None):
            raise ConfigError(
                "duration_s", self.duration_s, "give it with velocity, and only with it"
            )

    def motion(self, place: Place) -> Motion:
        """Return the motion."""
        speed = place.speed
        if self.velocity is not None and self.duration_s is not None:
            rate = place.way(self.velocity)
            by = self.duration_s * rate
            speed = float(np.linalg.norm(rate[:3])) or speed
            length = self.duration_s * speed if rate.any() else 0.0
        else:
            if self.by is not None:
                by = place.way(self.by)
            else:
                assert self.to is not None
                by = place.pose(self.to, place.here) - place.here
            length = float(np.linalg.norm(by[:3]))
            angle = float(np.abs(by[3:]).max())
            length = max(length, angle * (speed / place.turning_speed))
        check_poses(np.array([place.here + by]), ["its end"])
        if length < _SAME:
            return Rest(place.here)
        at_speed = dataclasses.replace(
            place, settings=dataclasses.replace(place.settings, speed_m_s=speed)
        )
        return at_speed.along(Straight(place.here, by, length))


def _radius(value: float) -> None:
    if abs(value) < 1e-3:
        raise ConfigError("radius_m", value, "at least 0.001 to either side")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arc(Segment):
    """Part of a horizontal circle; the head turns with it."""

    kind: ClassVar[str] = "arc"
    radius_m: float = parameter(None, "positive turns left [m]", low=-1e3, high=1e3)
    angle_rad: float = parameter(None, "how far it turns [rad]", low=1e-3, high=1e3)

    def __post_init__(self) -> None:
        _radius(self.radius_m)

    def motion(self, place: Place) -> Motion:
        """Return the motion."""
        return place.along(Circle(place.here, self.radius_m, self.angle_rad / math.tau))


@dataclasses.dataclass(frozen=True, kw_only=True)
class WholeCircle(Segment):
    """A horizontal circle; the head turns with it."""

    kind: ClassVar[str] = "circle"
    radius_m: float = parameter(None, "positive turns left [m]", low=-1e3, high=1e3)
    turns: float = parameter(1.0, "how often round", low=1e-3, high=1e3)

    def __post_init__(self) -> None:
        _radius(self.radius_m)

    def motion(self, place: Place) -> Motion:
        """Return the motion."""
        return place.along(Circle(place.here, self.radius_m, self.turns))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Eight(Segment):
    """A horizontal eight (a lemniscate) from its crossing; the head turns with it."""

    kind: ClassVar[str] = "eight"
    radius_m: float = parameter(
        None, "smallest radius of the curve; positive turns left first [m]", low=-1e3, high=1e3
    )
    rounds: float = parameter(1.0, "how often round; 0.5 is one loop", low=1e-3, high=1e3)

    def __post_init__(self) -> None:
        _radius(self.radius_m)

    def motion(self, place: Place) -> Motion:
        """Return the motion."""
        return place.along(FigureEight(place.here, self.radius_m, self.rounds))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Poses(Segment):
    """Through poses, at given times or at a speed.

    Attributes:
        poses: 3 or 6 numbers each [m, rad].
        rates: of the poses in the world, 6 numbers each, where they are known [m/s, rad/s].
        names: what to call each pose.
    """

    kind: ClassVar[str] = "waypoints"
    times_s: tuple[float, ...] | None = parameter(
        None, "when to be at each pose, from the segment's begin, rising [s]"
    )
    poses: tuple[tuple[float, ...], ...] = ()
    rates: tuple[tuple[float, ...], ...] | None = None
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.poses:
            raise ConfigError("poses", [], "give one or more")
        if self.times_s is not None and len(self.times_s) != len(self.poses):
            raise ConfigError(
                "times_s", list(self.times_s), f"give one for each of {len(self.poses)} poses"
            )
        for i, pose in enumerate(self.poses):
            _three_or_six(f"poses[{i}]", pose)

    def motion(self, place: Place) -> Motion:
        """Return the motion; a first pose at time 0 is where the segment begins."""
        w = [place.here]
        for pose in self.poses:
            w.append(place.pose(pose, w[-1]))
        names = ["where it begins", *self._names()]
        if self.times_s is None:
            return self._at_speed(place, unwrapped(w), names)
        times = [0.0, *self.times_s]
        rates = None if self.rates is None else [np.zeros(6), *map(np.array, self.rates)]
        if times[1] == 0.0:
            away = float(np.linalg.norm(w[1] - w[0]))
            if away > _NEAR:
                raise TrajectoryError(
                    f"{names[1]} is to be reached at 0 s, and the head is elsewhere: give more"
                )
            del w[1], times[1], names[1]
            if rates is not None:
                del rates[1]
            if len(w) == 1:
                return Rest(place.here)
        return Waypoints(times, w, rates=rates, names=names)

    def where(self, motion: Motion, t: float) -> str:
        """Return the pose that comes next."""
        if self.times_s is not None:
            names = self._names()
            return names[min(int(np.searchsorted(self.times_s, t)), len(names) - 1)]
        if isinstance(motion, Along) and isinstance(motion.path, Through):
            return motion.path.name(motion.progress(t))
        return ""

    def _names(self) -> Sequence[str]:
        return self.names or [f"poses[{i}]" for i in range(len(self.poses))]

    def _at_speed(self, place: Place, w: Array, names: Sequence[str]) -> Motion:
        check_poses(w, names)
        lengths = lengths_at_speed(w, place.speed, place.turning_speed)
        # A pose that is given twice is one.
        moves = lengths > _SAME
        if not moves.any():
            return Rest(place.here)
        kept = np.concatenate(([True], moves))
        named = [name for name, keep in zip(names, kept, strict=True) if keep]
        return place.along(Through(w[kept], lengths[moves], named))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Pause(Segment):
    """Stays where it is for a time."""

    kind: ClassVar[str] = "hold"
    duration_s: float = parameter(None, "for how long [s]", low=1e-3, high=1e5)

    def motion(self, place: Place) -> Motion:
        """Return the motion."""
        return Rest(place.here, self.duration_s)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Return(Segment):
    """Straight back to where the trajectory began; turned back by the shorter way."""

    kind: ClassVar[str] = "return_to_start"

    def motion(self, place: Place) -> Motion:
        """Return the motion."""
        in_world = dataclasses.replace(place.settings, frame="world")
        return line_to(place.start).motion(dataclasses.replace(place, settings=in_world))


def line_to(pose: ArrayLike, **settings: float) -> Line:
    """Return the line to a pose in the world, (6,) [m, rad]."""
    to = tuple(float(value) for value in np.asarray(pose))
    return Line(to=to, settings=Settings(frame="world", **settings))  # type: ignore[arg-type]


SEGMENTS: dict[str, type[Segment]] = {
    cls.kind: cls for cls in (Line, Arc, WholeCircle, Eight, Poses, Pause, Return)
}
"""By what a file calls them."""
