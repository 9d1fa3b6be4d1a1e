"""Finds poses that stand still while their stamps go on.

A tracking system that has lost its body may go on sending the last pose. Measured poses carry
noise, so two that are the same to the last bit are one measurement sent twice; a simulator without
noise sends the same pose for good reason while its robot rests. So repeats count only after noise
was seen: steps from pose to pose that reverse again and again, as those of a body in motion do not
(two thirds of the steps of white noise do, at rest).

How much noise there is follows from third divided differences, which hardly exist in a smooth
motion at motion capture rates, whatever the intervals are: divided by the root of the sum of the
squares of its weights, one has the standard deviation of the poses, per axis; the median of its
length in space is 1.538 times that.
"""

from __future__ import annotations

import collections
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_KEPT = 50
_ENOUGH = 20
_REVERSALS = 1.0 / 3.0
_LENGTH_PER_NOISE = 1.538


class FreezeWatch:
    """Compares each pose with the ones before."""

    def __init__(self, noise_m: float, longest_gap_s: float) -> None:
        """Start without a pose.

        Args:
            noise_m: steps smaller than this are no noise.
            longest_gap_s: poses further apart say nothing about noise.
        """
        self._noise_m = noise_m
        self._longest_gap_ns = round(longest_gap_s * 1e9)
        self._last: bytes | None = None
        self._last_ns = self._newest_ns = 0
        self._poses: collections.deque[tuple[int, Array]] = collections.deque(maxlen=4)
        # Not looked at yet: no pose should wait for what is asked now and then.
        self._pending: list[tuple[tuple[int, Array], ...]] = []
        self._lengths: collections.deque[float] = collections.deque(maxlen=_KEPT)
        self._reversed: collections.deque[bool] = collections.deque(maxlen=_KEPT)
        self._noisy = False

    @property
    def noise_m(self) -> float:
        """Standard deviation of the noise of the position, per axis [m]; NaN while unknown."""
        self._catch_up()
        if len(self._lengths) < _ENOUGH:
            return math.nan
        return float(np.median(self._lengths)) / _LENGTH_PER_NOISE

    def repeats_for(self, stamp_ns: int, pose: Sequence[float] | Array) -> float | None:
        """Take a pose; return for how long poses have been the same [s].

        ``None`` if it differs from the one before, or nothing is known against repeats.

        Args:
            stamp_ns: time of capture [ns].
            pose: position [m] and quaternion as they came, (7,).
        """
        values = np.asarray(pose, dtype=float)
        bits = values.tobytes()
        step_ns, self._newest_ns = stamp_ns - self._newest_ns, stamp_ns
        if bits == self._last:
            self._catch_up()
            return (stamp_ns - self._last_ns) * 1e-9 if self._noisy else None
        self._last, self._last_ns = bits, stamp_ns
        if not 0 < step_ns <= self._longest_gap_ns:
            self._poses.clear()
        self._poses.append((stamp_ns, values[:3]))
        if len(self._poses) == self._poses.maxlen:
            self._pending.append(tuple(self._poses))
        if len(self._pending) >= _KEPT:
            self._catch_up()
        return None

    def _catch_up(self) -> None:
        pending, self._pending = self._pending, []
        for poses in pending:
            self._look_for_noise(poses)

    def _look_for_noise(self, poses: tuple[tuple[int, Array], ...]) -> None:
        stamps, positions = zip(*poses, strict=True)
        times = np.array([stamp - stamps[0] for stamp in stamps]) * 1e-9
        gaps = times[:, None] - times + np.eye(4)
        weights = 1.0 / gaps.prod(axis=1)
        difference = weights @ np.array(positions) / np.linalg.norm(weights)
        self._lengths.append(float(np.linalg.norm(difference)))
        before, after = positions[2] - positions[1], positions[3] - positions[2]
        if min(np.linalg.norm(before), np.linalg.norm(after)) > self._noise_m:
            self._reversed.append(bool(before @ after < 0))
        enough = len(self._reversed) >= _ENOUGH
        if enough and sum(self._reversed) > _REVERSALS * len(self._reversed):
            self._noisy = True
