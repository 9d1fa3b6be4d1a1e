"""The support polygon and d_min, the margin against falling (30), Fig. 4."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from snake_control.model.geometry import Geometry, link_centers, wheel_contacts

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Support:
    """How the robot stands.

    Attributes:
        d_min: signed distance from P_G to the nearest edge of the support polygon [m]; positive
            inside, negative once the robot tips.
        center_of_mass: P_G, the centre of mass seen from above, (2,) [m].
        polygon: corners of the support polygon, counter-clockwise, (k, 2) [m].
    """

    d_min: float
    center_of_mass: Array
    polygon: Array
    _g: Geometry
    _ends: tuple[int, int]
    _share: float

    @functools.cached_property
    def gradient(self) -> Array:
        """Gradient of d_min by q, (n + 5,).

        d_min is not smooth where the nearest edge changes: there it is the gradient for the edge
        that comes first in ``polygon``.
        """
        contacts = wheel_contacts(self._g).reshape(-1, 2)
        first, second = self._ends
        p, q = contacts[first], contacts[second]
        edge = (q - p) / math.hypot(*(q - p))
        # On an edge its normal is exact even at distance 0; beyond a corner it points there.
        if 0 < self._share < 1:
            normal = np.array([-edge[1], edge[0]])
        else:
            nearest = (1 - self._share) * p + self._share * q
            normal = (self.center_of_mass - nearest) / self.d_min
        gradient: Array = normal @ (
            _center_of_mass_jacobian(self._g)
            - (1 - self._share) * _contact_jacobian(self._g, first)
            - self._share * _contact_jacobian(self._g, second)
        )
        return gradient


def support(g: Geometry) -> Support:
    """Return support polygon, P_G and d_min of one posture; the gradient only when asked for."""
    contacts = wheel_contacts(g).reshape(-1, 2)
    center_of_mass = g.s.masses @ link_centers(g)[:, :2] / g.s.masses.sum()
    hull = convex_hull(contacts)
    i, j, share, d_min = _nearest_edge(contacts[hull], center_of_mass)
    return Support(d_min, center_of_mass, contacts[hull], g, (hull[i], hull[j]), share)


def convex_hull(points: Array) -> list[int]:
    """Return the corners of the convex hull, counter-clockwise, as indices into ``points``.

    Args:
        points: (k, 2), not all on one line.
    """
    coordinates = points.tolist()
    order = sorted(range(len(coordinates)), key=coordinates.__getitem__)
    lower = _half_hull(coordinates, order)
    upper = _half_hull(coordinates, order[::-1])
    return lower[:-1] + upper[:-1]


def _half_hull(points: list[list[float]], order: list[int]) -> list[int]:
    chain: list[int] = []
    for index in order:
        x, y = points[index]
        while len(chain) > 1:
            ox, oy = points[chain[-2]]
            ax, ay = points[chain[-1]]
            if (ax - ox) * (y - oy) - (ay - oy) * (x - ox) > 0:
                break
            chain.pop()
        chain.append(index)
    return chain


def _nearest_edge(corners: Array, point: Array) -> tuple[int, int, float, float]:
    """Return corner indices of the nearest edge, where on it (0..1), and the signed distance."""
    nearest = (0, 0, 0.0, math.inf)
    outside = False
    px, py = point
    points = corners.tolist()
    for i, (ax, ay) in enumerate(points):
        j = (i + 1) % len(points)
        ex, ey = points[j][0] - ax, points[j][1] - ay
        length_squared = ex * ex + ey * ey
        share = min(1.0, max(0.0, ((px - ax) * ex + (py - ay) * ey) / length_squared))
        outside |= ex * (py - ay) - ey * (px - ax) < 0
        distance = math.hypot(px - ax - share * ex, py - ay - share * ey)
        if distance < nearest[3]:
            nearest = (i, j, share, distance)
    i, j, share, distance = nearest
    return i, j, share, -distance if outside else distance


def _center_of_mass_jacobian(g: Geometry) -> Array:
    """Velocity of P_G per q_dot, (2, n + 5)."""
    s = g.s
    masses = s.masses
    moments = masses[:, None] * link_centers(g)
    # Mass and first moment of the links behind each joint.
    mass_behind = np.cumsum(masses[::-1])[::-1]
    moment_behind = np.cumsum(moments[::-1], axis=0)[::-1]
    jacobian = np.zeros((2, s.n + 5))
    jacobian[0, 0] = jacobian[1, 1] = 1.0
    angular = (g.base_rotation @ g.twists[3:]).T
    axes = np.vstack((angular[3:], np.broadcast_to(g.base_rotation[:, 2], (s.n_b - 1, 3))))
    tip = g.head_points[:1]
    pivots = np.vstack((tip, tip, tip, g.head_points[1:], g.to_world(g.hitches)))
    mass = np.concatenate((np.full(3, mass_behind[0]), mass_behind[1:]))
    moment = np.vstack((np.broadcast_to(moment_behind[0], (3, 3)), moment_behind[1:]))
    arms = (moment - mass[:, None] * pivots) / mass_behind[0]
    jacobian[0, 3:] = axes[:, 1] * arms[:, 2] - axes[:, 2] * arms[:, 1]
    jacobian[1, 3:] = axes[:, 2] * arms[:, 0] - axes[:, 0] * arms[:, 2]
    return jacobian


def _contact_jacobian(g: Geometry, contact: int) -> Array:
    """Velocity of one wheel contact, seen from above, per q_dot, (2, n + 5)."""
    s = g.s
    link = s.wheeled[contact // 2]
    side = s.robot.wheel_offset_m * (1 if contact % 2 == 0 else -1)
    px, py = g.centers[link] + side * g.y[link]
    v, w = g.twists[:3], g.twists[3:]
    by_head = np.stack((v[0] - w[2] * py, v[1] + w[2] * px, v[2] + w[0] * py - w[1] * px))
    by_base = np.zeros((3, s.n_b - 1))
    by_base[0, :link] = -(py - g.hitches[:link, 1])
    by_base[1, :link] = px - g.hitches[:link, 0]
    return g.base_rotation[:2] @ np.hstack((by_head, by_base))
