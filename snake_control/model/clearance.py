"""Distance of the base links' bodies from circles on the floor, seen from above."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from snake_control.model.geometry import Geometry

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Clearances:
    """Distances of n_b base links from k circles.

    Attributes:
        clearance: from a link's body, the strip out to its wheels, to a circle; negative when they
            overlap, (n_b, k) [m].
        nearest: point of each link's centre line that is nearest to each circle, in the world,
            (n_b, k, 3) [m].
        away: direction in which that point leaves the circle, a unit vector on the floor,
            (n_b, k, 2).
    """

    clearance: Array
    nearest: Array
    away: Array


def clearances(g: Geometry, centers: Array, radii: Array) -> Clearances:
    """Return the clearances of all base links from circles.

    Where a centre line runs through the centre of a circle, ``away`` is the link's left.

    Args:
        g: the posture; a base that is not level is seen from above.
        centers: of the circles, (k, 2) [m].
        radii: of the circles, (k,) [m].
    """
    half = g.s.robot.half_length_m
    rear = g.to_world(g.centers - half * g.x)
    along = g.to_world(g.centers + half * g.x) - rear
    flat = along[:, :2]
    to_circle = centers[None, :, :] - rear[:, None, :2]
    # A link that stands upright is a point from above; any share of it is as near.
    squared = np.maximum(np.sum(flat * flat, axis=1), np.finfo(float).tiny)
    share = np.clip(np.sum(to_circle * flat[:, None, :], axis=2) / squared[:, None], 0.0, 1.0)
    nearest = rear[:, None, :] + share[:, :, None] * along[:, None, :]
    apart = nearest[:, :, :2] - centers[None, :, :]
    distance = np.hypot(apart[:, :, 0], apart[:, :, 1])
    left = np.stack((-flat[:, 1], flat[:, 0]), axis=1) / np.sqrt(squared)[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        away = np.where(distance[:, :, None] > 0.0, apart / distance[:, :, None], left[:, None, :])
    return Clearances(distance - radii - g.s.robot.wheel_offset_m, nearest, away)


def gradient_of_clearances(g: Geometry, found: Clearances, weights: Array) -> Array:
    """Return the gradient of sum(weights * clearance) by q, weights held constant, (n + 5,).

    The nearest points act as if forces of these weights pulled there: each coordinate of q sees
    the moment about its axis of all that it moves.

    Args:
        g: the posture.
        found: its clearances.
        weights: (n_b, k).
    """
    s = g.s
    force = np.zeros_like(found.nearest)
    force[:, :, :2] = weights[:, :, None] * found.away
    moment = _cross(found.nearest, force).sum(axis=1)
    force = force.sum(axis=1)
    behind_force = force[::-1].cumsum(axis=0)[::-1]
    behind_moment = moment[::-1].cumsum(axis=0)[::-1]

    axes = (g.base_rotation @ g.twists[3:, 3:]).T
    tip, up = g.head_points[0], g.base_rotation[:, 2]
    pivots = np.vstack((tip, tip, tip, g.head_points[1:]))
    by_q = np.zeros(s.n + 5)
    by_q[:3] = behind_force[0]
    by_q[3 : 6 + s.n_h] = np.sum(
        axes * (behind_moment[0] - _cross(pivots, behind_force[0])), axis=1
    )
    hitches = g.to_world(g.hitches)
    by_q[6 + s.n_h :] = (behind_moment[1:] - _cross(hitches, behind_force[1:])) @ up
    if s.robot.planar:
        # It lies on the floor whatever these say.
        by_q[2:5] = 0.0
    return by_q


def _cross(a: Array, b: Array) -> Array:
    return np.stack(
        (
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ),
        axis=-1,
    )
