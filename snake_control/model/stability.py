"""The support polygon and d_min, the margin against falling (30), Fig. 4.

Distances on the floor are worked out in base coordinates as seen from above: projected along the
world's z axis, turned and shifted with the base.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from snake_control.model.convex_hull import convex_hull
from snake_control.model.geometry import Geometry, Plane, in_plane
from snake_control.model.lazy import lazy
from snake_control.model.vector import ZERO, Vector, along, combine, cross, dot

Array = NDArray[np.float64]

_TINY = 1e-12
"""Share of the robot's length below which two contacts count as one."""


class Support:
    """How the robot stands.

    Where the contacts are seen on one line or in one point, the polygon is that segment or point:
    d_min then is minus the distance to it, for nothing stands on it.

    Attributes:
        d_min: signed distance from P_G to the nearest edge of the support polygon [m]; positive
            inside, negative once the robot tips.
    """

    d_min: float

    def __init__(self, g: Geometry) -> None:
        self._g = g
        points = _wheel_points(g)
        self._wheels: list[complex] = points.tolist()
        self._center = _center_of_mass(g)
        a, b, _ = g.rows
        # A polygon seen from above has the same corners as in the plane of the base; in the other
        # order, if that lies on its back.
        self._hull = convex_hull(points, self._wheels)
        if g.rows[2][2] < 0.0:
            self._hull.reverse()
        self._corners = _from_above(g, [self._wheels[corner] for corner in self._hull])
        self._below = complex(dot(a, self._center), dot(b, self._center))
        self._tiny = _TINY * g.s.n * 2.0 * g.s.robot.half_length_m
        self._edge, self._share, self.d_min = nearest_edge(self._corners, self._below, self._tiny)

    @lazy
    def polygon(self) -> Array:
        """Corners of the support polygon, counter-clockwise, (k, 2) [m]."""
        return self._g.base_origin[:2] + in_plane(np.array(self._corners))

    @lazy
    def center_of_mass(self) -> Array:
        """P_G, the centre of mass seen from above, (2,) [m]."""
        return self._g.base_origin[:2] + (self._below.real, self._below.imag)

    @lazy
    def gradient(self) -> Array:
        """Gradient of d_min by q, (n + 5,).

        d_min is not smooth where the nearest edge changes: there it is the gradient for the edge
        that comes first in ``polygon``; 0 where P_G is just above a polygon that is one point.
        """
        n_h = self._g.s.n_h
        gradient = np.zeros(self._g.s.n + 5)
        gradient[3 : 6 + n_h] = self._by_head()
        gradient[6 + n_h :] = self.by_base
        return gradient

    def _normal(self) -> Vector:
        """Direction in which P_G moves away from the edge fastest, in base coordinates."""
        begin, end = self._corners[self._edge], self._corners[self._edge + 1 - len(self._corners)]
        edge, arm = end - begin, self._below - begin
        length = abs(edge)
        if length > self._tiny and (0.0 < self._share < 1.0 or self.d_min == 0.0):
            # On an edge its normal is exact even at distance 0; beyond a corner it points there.
            normal = 1j * edge / length
            # A polygon without width is fallen off on both sides.
            if self.d_min < 0.0 and (arm * normal.conjugate()).real > self._tiny:
                normal = -normal
        elif self.d_min == 0.0:
            normal = 0j
        else:
            normal = (arm - self._share * edge) / self.d_min
        return combine(normal.real, self._g.rows[0], normal.imag, self._g.rows[1])

    def _feet(self) -> tuple[tuple[int, float], tuple[int, float]]:
        """The two wheels whose contacts make the edge, each with its share of the nearest point."""
        first, second = self._hull[self._edge], self._hull[self._edge + 1 - len(self._hull)]
        return (first, 1.0 - self._share), (second, self._share)

    def _by_head(self) -> list[float]:
        """Derivative by R, P, Y, phi_1 .. phi_(n_h), which move both contacts.

        What lies behind a joint turns about it: P_G by its share of the mass, the contacts whole.
        """
        g, normal = self._g, self._normal()
        foot = sum(share * self._wheels[wheel] for wheel, share in self._feet())
        arm = along(self._center, -1.0, (foot.real, foot.imag, 0.0))
        lever = cross(arm, normal)
        gradient = [dot(axis, lever) for axis in g.attitude_axes]
        ahead, moment = 0.0, ZERO
        chain = g.chain
        for (_, axis), pivot, center, mass in zip(
            chain.twists, chain.pivots, chain.centers, g.s.head_mass, strict=True
        ):
            ahead += mass
            moment = along(moment, mass, center)
            # The links ahead of the joint stay: arm without their part of P_G about the pivot.
            stays = along(moment, -ahead, pivot)
            gradient.append(dot(axis, cross(along(arm, -1.0, stays), normal)))
        return gradient

    @lazy
    def by_base(self) -> Array:
        """Derivative of d_min by the base joint angles, (n_b - 1,): all that (27) needs."""
        g, base = self._g, self._g.s.base
        # The nearest point of the edge counts as a mass of -1 at its wheels: what lies behind a
        # joint then has no mass but a moment, whose arm turns with the joint.
        masses = base.mass.copy()
        moments = masses * g.middles
        for wheel, share in self._feet():
            link = base.wheel_links[wheel]
            masses[link] -= share
            moments[link] -= share * self._wheels[wheel]
        arms = np.add.accumulate(moments[:0:-1])
        arms -= np.add.accumulate(masses[:0:-1]) * g.fronts[:0:-1]
        x, y, _ = self._normal()
        gradient: Array = (arms * complex(y, x)).real[::-1]
        return gradient


def support(g: Geometry) -> Support:
    """Return support polygon, P_G and d_min of one posture; the gradient only when asked for."""
    return Support(g)


def _wheel_points(g: Geometry) -> Plane:
    """Return where the wheels stand in the base plane, all left ones, then all right ones."""
    wheeled = g.s.wheeled
    centers = g.middles[wheeled]
    side = g.forward[wheeled] * (1j * g.s.robot.wheel_offset_m)
    return np.concatenate((centers + side, centers - side))


def _from_above(g: Geometry, points: list[complex]) -> list[complex]:
    """Return points of the base plane as seen along the world's z axis, shifted with the base."""
    (ax, ay, _), (bx, by, _), _ = g.rows
    x, y = complex(ax, bx), complex(ay, by)
    return [point.real * x + point.imag * y for point in points]


def _center_of_mass(g: Geometry) -> Vector:
    """Return the centre of mass in base coordinates."""
    base = complex(g.s.base.mass.dot(g.middles))
    x, y, z = base.real, base.imag, 0.0
    for mass, (link_x, link_y, link_z) in zip(g.s.head_mass, g.chain.centers, strict=True):
        x += mass * link_x
        y += mass * link_y
        z += mass * link_z
    return x, y, z


def nearest_edge(corners: list[complex], point: complex, tiny: float) -> tuple[int, float, float]:
    """Return the nearest edge of a convex polygon, where on it (0..1), and the signed distance.

    Args:
        corners: counter-clockwise, at least two; edge i goes from corner i to the next.
        point: inside (positive distance) or outside.
        tiny: what counts as no length. Edges as short as that are left out, for round-off turns
            them anywhere; and no point lies inside a polygon as narrow as that.
    """
    nearest = (0, 0.0, math.inf)
    for i, begin in enumerate(corners):
        edge = corners[i + 1 - len(corners)] - begin
        length = abs(edge)
        if length <= tiny:
            continue
        # Real part: along the edge; imaginary part: to its left, which is inside.
        seen = (point - begin) * edge.conjugate()
        if seen.imag < 0.0:
            return _nearest_edge_from_outside(corners, point, tiny)
        # From inside, the nearest of the edges' lines is met on the edge itself.
        if seen.imag < nearest[2] * length:
            nearest = (i, seen.real / length**2, seen.imag / length)
    if tiny < nearest[2] < math.inf:
        return nearest
    return _nearest_edge_from_outside(corners, point, tiny)


def _nearest_edge_from_outside(
    corners: list[complex], point: complex, tiny: float
) -> tuple[int, float, float]:
    # A polygon that is one point has no edge.
    nearest = (0, 0.0, -math.inf)
    for i, begin in enumerate(corners):
        edge = corners[i + 1 - len(corners)] - begin
        length = abs(edge)
        if length <= tiny:
            continue
        seen = (point - begin) * edge.conjugate()
        share = min(1.0, max(0.0, seen.real / length**2))
        distance = abs(point - begin - share * edge)
        if distance < -nearest[2]:
            nearest = (i, share, -distance)
    return nearest if nearest[2] > -math.inf else (0, 0.0, -abs(point - corners[0]))
