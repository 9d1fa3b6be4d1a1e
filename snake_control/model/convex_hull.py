"""The convex hull of points in the plane: Andrew's monotone chain.

Qhull needs a hundred microseconds for the few points of a short robot. On long ones, most points
lie inside a polygon of the outermost ones and are left out at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.complex128]

_MANY = 40
_DIRECTIONS = np.exp(2j * np.pi * (np.arange(16) + 0.3) / 16)
_ROUND_OFF = 1e-13


def convex_hull(points: Points, listed: list[complex] | None = None) -> list[int]:
    """Return the corners of the convex hull, counter-clockwise, as indices into ``points``.

    Args:
        points: x + i y, (k,), two at least that differ. Of points on one line both ends are found.
        listed: the same as a list, if there is one already.
    """
    if listed is None:
        listed = points.tolist()
    if len(listed) < _MANY:
        order = points.argsort().tolist()
    else:
        outer = _outer(points)
        order = outer[points[outer].argsort()].tolist()
    lower = _half_hull(listed, order)
    upper = _half_hull(listed, order[::-1])
    return lower[:-1] + upper[:-1]


def _half_hull(points: list[complex], order: list[int]) -> list[int]:
    chain: list[int] = []
    for index in order:
        point = points[index]
        while len(chain) > 1:
            begin = points[chain[-2]]
            if ((points[chain[-1]] - begin).conjugate() * (point - begin)).imag > 0.0:
                break
            chain.pop()
        chain.append(index)
    return chain


def _outer(points: Points) -> NDArray[np.intp]:
    """Leave out points inside the polygon of those that lie outermost in 16 directions."""
    outermost = np.multiply.outer(_DIRECTIONS.conj(), points).real.argmax(axis=1)
    corners = points[outermost]
    edges = np.roll(corners, -1) - corners
    left = (edges.conj()[:, None] * (points - corners[:, None])).imag
    outside = (left < -_ROUND_OFF * np.abs(edges).max() ** 2).any(axis=0)
    outside[outermost] = True
    return outside.nonzero()[0]
