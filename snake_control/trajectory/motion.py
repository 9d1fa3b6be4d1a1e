"""Motions from rest to rest, one after the other, with or without a stop between them."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.control.reference import Reference

Array = NDArray[np.float64]

_SAMPLES_OF_A_JOIN = 20


class Profile(NamedTuple):
    """A motion at some moments.

    Attributes:
        t: when, (k,) [s].
        w, rate, acceleration: of [x, y, z, R, P, Y] there, (k, 6).
    """

    t: Array
    w: Array
    rate: Array
    acceleration: Array


class Motion(Protocol):
    """A motion of the head in its own time, 0 .. ``duration``, smooth up to its acceleration.

    Attributes:
        duration: [s].
        ramp: how long it speeds up at its begin and slows down at its end [s]; meanwhile another
            one may be added to it. 0 if nothing may.
    """

    duration: float
    ramp: float

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration; the begin before it, and the end after it."""

    def moments(self) -> Array:
        """Return times at which to look for the largest speeds, (k,) [s]."""


@runtime_checkable
class ManyAtOnce(Protocol):
    """A motion with many poses, which overlaps with no other."""

    def many(self, t: Array) -> Array:
        """Return pose, rate and acceleration at times (k,) inside it, (3, k, 6)."""


class Rest:
    """Stays at a pose for a time."""

    def __init__(self, pose: ArrayLike, duration: float = 0.0) -> None:
        """Stay at ``pose``, (6,), for ``duration`` [s]."""
        self._reference = Reference(np.array(pose, dtype=float), np.zeros(6))
        self.duration = duration
        self.ramp = 0.0

    def sample(self, t: float) -> Reference:
        """Return the pose, whatever ``t``."""
        return self._reference

    def moments(self) -> Array:
        """Return begin and end."""
        return np.array([0.0, self.duration])


class Braking:
    """Comes to rest from a rate and an acceleration: the rate is a cubic polynomial of time."""

    def __init__(self, start: Reference, linear: float, angular: float) -> None:
        """Define the motion.

        Args:
            start: pose, rate and acceleration at its begin.
            linear: largest deceleration of the tip, from an even speed [m/s^2].
            angular: that of each of R, P, Y [rad/s^2].
        """
        self._w = np.array(start.w_d, dtype=float)
        self._rate = start.w_d_dot * start.time_scale
        self._acceleration = start.w_d_ddot * start.time_scale**2
        speed, turning = np.linalg.norm(self._rate[:3]), np.abs(self._rate[3:]).max()
        self.duration = 1.5 * float(max(speed / linear, turning / angular))
        self.ramp = self.duration

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration at time ``t`` [s]."""
        T = self.duration
        if T == 0.0:
            return Reference(self._w, np.zeros(6))
        x = min(max(t / T, 0.0), 1.0)
        v, a = self._rate, self._acceleration * T
        return Reference(
            self._w + T * (v * (x - x**3 + x**4 / 2) + a * x**2 * (1 / 2 - 2 * x / 3 + x * x / 4)),
            v * (1 - 3 * x**2 + 2 * x**3) + a * x * (1 - x) ** 2,
            (v * (6 * x**2 - 6 * x) + a * (1 - x) * (1 - 3 * x)) / T,
        )

    def moments(self) -> Array:
        """Return some from begin to end."""
        return np.linspace(0.0, self.duration, _SAMPLES_OF_A_JOIN)


class Chain:
    """Motions one after the other; each begins where the one before ends.

    Two motions that overlap are added: the one slows down while the other speeds up. That cuts the
    corner between them, and is as smooth as they are.

    Attributes:
        duration: [s].
        begins: when each motion begins [s].
        ramp: 0.
    """

    def __init__(self, motions: Sequence[Motion], overlaps: Sequence[float]) -> None:
        """Define the motion.

        Args:
            motions: one or more.
            overlaps: for how long each of them, but for the last, wants to overlap with the next
                [s]. It gets no more than what the one's end and the other's begin allow.
        """
        self._motions = list(motions)
        self.begins = [0.0]
        free = self._motions[0].duration
        for one, other, wanted in zip(self._motions[:-1], self._motions[1:], overlaps, strict=True):
            # No more than two at a time.
            overlap = max(0.0, min(wanted, free, other.duration - other.ramp))
            self.begins.append(self.begins[-1] + one.duration - overlap)
            free = other.duration - overlap
        self._ends = [b + m.duration for b, m in zip(self.begins, self._motions, strict=True)]
        self.duration = self._ends[-1]
        self.ramp = 0.0

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration at time ``t`` [s]."""
        k = max(bisect.bisect_right(self.begins, t) - 1, 0)
        now = self._motions[k].sample(t - self.begins[k])
        if k == 0 or t >= self._ends[k - 1]:
            return now
        before = self._motions[k - 1]
        late = before.sample(t - self.begins[k - 1])
        return Reference(
            now.w_d + late.w_d - before.sample(before.duration).w_d,
            now.w_d_dot + late.w_d_dot,
            now.w_d_ddot + late.w_d_ddot,
        )

    def moments(self) -> Array:
        """Return those of its motions, and more where two overlap."""
        found = [b + m.moments() for b, m in zip(self.begins, self._motions, strict=True)]
        for begin, end in zip(self.begins[1:], self._ends, strict=False):
            if begin < end:
                found.append(np.linspace(begin, end, _SAMPLES_OF_A_JOIN))
        return np.unique(np.concatenate(found))

    def profile(self) -> Profile:
        """Return it at its ``moments``."""
        t = self.moments()
        rows = np.empty((3, len(t), 6))
        one_by_one = np.ones(len(t), dtype=bool)
        for motion, begin, end in zip(self._motions, self.begins, self._ends, strict=True):
            if isinstance(motion, ManyAtOnce):
                inside = (t > begin) & (t < end)
                rows[:, inside] = motion.many(t[inside] - begin)
                one_by_one &= ~inside
        for i in np.flatnonzero(one_by_one).tolist():
            seen = self.sample(float(t[i]))
            rows[:, i] = seen.w_d, seen.w_d_dot, seen.w_d_ddot
        return Profile(t, *rows)


class Started:
    """A motion that starts at some time of a clock."""

    def __init__(self, motion: Motion, start: float) -> None:
        """Let ``motion`` begin at time ``start`` [s]."""
        self._motion = motion
        self._start = start

    def sample(self, t: float) -> Reference:
        """Return pose, rate and acceleration at time ``t`` [s]."""
        return self._motion.sample(t - self._start)
