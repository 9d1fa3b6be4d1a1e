"""How well the wheel axes are spread: the determinant behind the singular shapes of Fig. 5."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snake_control.model.constraints import lateral_map
from snake_control.model.geometry import Geometry
from snake_control.model.singular_shape import resistance, smallest_extent

Array = NDArray[np.float64]


def axis_spread(g: Geometry) -> tuple[float, Array]:
    """Return how well the axes are spread, and its gradient by q.

    Of the Gram matrix M of ``resistance``, whose trace is at most twice the number n_w of wheeled
    links, it is det(M) / (2 n_w / 3)^3: 1 at most, 0 where all axes are parallel or meet in one
    point; neither place, heading nor size of the robot changes it.

    Returns:
        The spread, and its gradient (n + 5,): 0 but for the base joints, finite everywhere.
    """
    s = g.s
    matrix, centroid, extent = resistance(g)
    values, vectors = np.linalg.eigh(matrix)
    # Cofactors hold where the inverse does not exist.
    others = np.array([values[1] * values[2], values[0] * values[2], values[0] * values[1]])
    adjugate = (vectors * others) @ vectors.T
    determinant = float(np.prod(values))

    # Weights of the rows at the centroid, then of those of lateral_map at the base's origin.
    rows = lateral_map(g)
    about = (rows[:, 2] + rows[:, 0] * centroid[1] - rows[:, 1] * centroid[0]) / extent
    weights = 2.0 * np.column_stack((rows[:, :2], about)) @ adjugate
    weights[:, 2] /= extent
    weights[:, 0] += weights[:, 2] * centroid[1]
    weights[:, 1] -= weights[:, 2] * centroid[0]

    # det(M) has extent^-2 in it, which is n_w over the sum of squared offsets.
    x, y = g.x[s.wheeled], g.y[s.wheeled]
    centers = g.centers[s.wheeled]
    offsets = centers - centroid
    pull = (2.0 * determinant / (len(rows) * extent**2)) * offsets
    if extent == smallest_extent(g):
        # There the extent is constant.
        pull *= 0.0

    # A base joint turns all links behind it about its hitch: sums of a moment and a force.
    on_links = np.zeros((s.n_b, 3))
    on_links[s.wheeled, 0] = (
        -np.sum(x * weights[:, :2], axis=1)
        - centers[:, 0] * pull[:, 1]
        + centers[:, 1] * pull[:, 0]
    )
    on_links[s.wheeled, 1:] = y * weights[:, 2:]
    on_links[s.wheeled, 1] += pull[:, 1]
    on_links[s.wheeled, 2] -= pull[:, 0]
    behind = on_links[:0:-1].cumsum(axis=0)[::-1]
    scale = 1.0 / (2.0 * len(rows) / 3.0) ** 3
    by_q = np.zeros(s.n + 5)
    by_q[6 + s.n_h :] = scale * (behind[:, 0] + np.sum(g.hitches * behind[:, 1:], axis=1))
    return scale * max(determinant, 0.0), by_q
