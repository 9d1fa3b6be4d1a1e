"""What remains of the head's motion under each hypothesis, weighted with what may be expected.

The cost of a hypothesis is a chi-square: with K segments about 6 K for what is true. The same for a
marker that is not where it is thought to be, at d in the frame of the head, which adds
(R_end - R_begin) d to every segment: linear least squares.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from snake_control.control.pose_segments import Segment
from snake_control.errors import ModelError

Array = NDArray[np.float64]

_AXES = ((0, 1), (2,), (3, 4), (5,))
"""Groups of axes with the same uncertainty: x, y; z; turning about x, y; about z."""

_OFFSET_STD_M = 0.03
"""How far off a marker may be expected to be, per axis, where motion does not tell."""


@dataclasses.dataclass(frozen=True, eq=False)
class Costs:
    """What remains of the motion under each hypothesis.

    Attributes:
        each: cost of each hypothesis, the marker's last, (h + 1,).
        suspicion: cost as configured over what is expected, of the worst group of axes, of all
            segments or of those of late.
        offset: of the marker in the frame of the head, (3,) [m].
        offset_seen: how far its direction has turned, root of the mean square [rad].
        beside_offset: cost with that offset over what is expected, of the worst group of axes.
    """

    each: Array
    suspicion: float
    offset: Array
    offset_seen: float
    beside_offset: float

    def explained(self, which: int) -> float:
        """Return the share of the cost as configured that a hypothesis explains, 0..1."""
        return max(0.0, 1.0 - float(self.each[which] / max(self.each[0], 1e-9)))


def weighed(segments: list[Segment], recent: int) -> Costs:
    """Weigh all segments together.

    Noise of a view enters the two segments that meet there with opposite signs, so the
    covariance of one axis of all segments is tridiagonal.

    Args:
        segments: at least one, in order.
        recent: how many of the last are "of late".

    Raises:
        ModelError: the covariance is not positive definite.
    """
    count, h = len(segments), len(segments[0].residuals)
    residuals = np.array([segment.residuals for segment in segments])
    turned = np.array([segment.turned for segment in segments])
    own = np.array([segment.own + segment.begin + segment.end for segment in segments])
    between = np.array([-b.begin if b.joined else np.zeros(4) for b in segments[1:]])
    costs = np.zeros(h + 1)
    information, right = np.zeros((4, 3, 3)), np.zeros((4, 3))
    suspicion, own_costs = 0.0, []
    for group, axes in enumerate(_AXES):
        r = residuals[:, :, axes].reshape(count, -1)
        both = np.hstack((r, *(turned[:, axis] for axis in axes if axis < 3)))
        _, _, weighted, info = lapack.dptsv(own[:, group], between[:, group], both)
        if info:
            raise ModelError(f"the covariance of {count} segments is not positive definite")
        products = r * weighted[:, : r.shape[1]]
        costs[:h] += products.sum(axis=0).reshape(h, -1).sum(axis=1)
        by_segment = products[:, : len(axes)].sum(axis=1) / len(axes)
        of_late = by_segment[-recent:].mean()
        suspicion = max(suspicion, float(by_segment.mean()), float(of_late))
        own_costs.append(float(by_segment.sum()) * len(axes))
        for k, axis in enumerate(axis for axis in axes if axis < 3):
            of_offset = weighted[:, r.shape[1] + 3 * k : r.shape[1] + 3 * k + 3]
            information[group] += turned[:, axis].T @ of_offset
            right[group] += of_offset.T @ residuals[:, 0, axis]
    # The weights may be too small or too large, what is known beforehand must not be.
    known = np.eye(3) * ((costs[0] / (6.0 * count) + 1e-9) / _OFFSET_STD_M**2)
    offset = np.linalg.solve(information.sum(axis=0) + known, right.sum(axis=0))
    gains = (2.0 * right - information @ offset) @ offset
    costs[h] = costs[0] - gains.sum()
    beside = [
        (own_cost - gain) / (count * len(axes))
        for own_cost, gain, axes in zip(own_costs, gains.tolist(), _AXES, strict=True)
    ]
    # What is chosen among many, or fitted, is better by chance.
    costs[1:h] += 2.0 * math.log(h)
    costs[h] += 3.0 * math.log(6.0 * count)
    turning = np.cumsum(turned, axis=0) @ (offset / max(float(np.linalg.norm(offset)), 1e-9))
    seen = math.sqrt(float(turning.var(axis=0).sum()))
    return Costs(costs, suspicion, offset, seen, max(beside))
