"""The four constraint rows that hold the base frame, and what they ask of the head joints.

The first base link's wheels and the floor leave the base frame two ways to move. These rows are
those of (1)-(3) divided by l where they are velocities, so that all of them are angular velocities
and singular values compare between robots. Only w and the head joints enter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from snake_control.model.damping import EPSILON, damped_reciprocals, damping_of
from snake_control.model.geometry import Geometry
from snake_control.model.vector import (
    Four,
    FourByFour,
    Twist,
    Vector,
    adjugate,
    dot,
)

Array = NDArray[np.float64]


class HeadBlock:
    """The head joints of theta_bar in the four rows: the head block of -B_tilde, and its inverse.

    Attributes:
        by_joint: what the four rows say of each head joint, n_h times four numbers.
        determinant: absolute value of the block's determinant.
        inverse: of the block: four rows of four, one for each head joint of theta_bar; damped near
            a singular posture.
        damping: see ``damping_of``; 0 where the inverse is exact.
        regularity: 1 / Frobenius norm of the exact inverse, 0 where there is none: no larger than
            the smallest singular value, no smaller than half of it.
        log_determinant: of ``determinant``, singular values raised to the damping's threshold.
    """

    def __init__(self, g: Geometry) -> None:
        """Work out block and inverse for one posture of a robot with a raised head."""
        self._g = g
        self.by_joint = self.measure(g.chain.twists)
        columns = [self.by_joint[joint] for joint in g.s.head_joints]
        signed, (a, b, c, d) = adjugate(*columns)
        # The columns were taken for rows, so this is the inverse but for its determinant.
        self._adjugate = list(zip(a, b, c, d, strict=True))
        self._sign = math.copysign(1.0, signed)
        self.determinant = abs(signed)
        norm = math.hypot(*a, *b, *c, *d)
        self.regularity = self.determinant / norm if norm > 0.0 else 0.0
        if norm < self.determinant / EPSILON:
            # Then no singular value is as small as EPSILON.
            self.inverse = _scaled(self._adjugate, 1.0 / signed)
            self.damping = 0.0
            self.log_determinant = math.log(self.determinant)
        else:
            self._damp(columns)

    def _damp(self, columns: list[Four]) -> None:
        U, sigma, Vt = np.linalg.svd(np.array(columns).T)
        inverse = (Vt.T * damped_reciprocals(sigma)) @ U.T
        self.inverse = [(a, b, c, d) for a, b, c, d in inverse.tolist()]
        self.damping = damping_of(float(sigma[3]))
        self.log_determinant = float(np.log(np.maximum(sigma, EPSILON)).sum())

    @property
    def cofactors(self) -> FourByFour:
        """Derivative of ``determinant`` by each entry of the block, laid out as ``inverse``.

        They exist where the inverse does not.
        """
        return _scaled(self._adjugate, self._sign)

    def measure(self, twists: Iterable[Twist]) -> list[Four]:
        """Return what the four rows say of each of some motions of the base frame.

        (v_y - l omega_z) / l and, in the world, v_z / l of the first base link's centre (which
        lies at (-l, 0, 0)), omega_x, omega_y; all [rad/s].
        """
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = self._g.rows
        half = self._g.s.robot.half_length_m
        return [
            (
                vy / half - wz,
                (cx * vx + cy * vy + cz * vz) / half + cz * wy - cy * wz,
                ax * wx + ay * wy + az * wz,
                bx * wx + by * wy + bz * wz,
            )
            for (vx, vy, vz), (wx, wy, wz) in twists
        ]

    def rows(self) -> Array:
        """Return what ``measure`` says of each component of a twist, (4, 6)."""
        row_x, row_y, (cx, cy, cz) = self._g.rows
        half = self._g.s.robot.half_length_m
        return np.array(
            (
                (0.0, 1.0 / half, 0.0, 0.0, 0.0, -1.0),
                (cx / half, cy / half, cz / half, 0.0, cz, -cy),
                (0.0, 0.0, 0.0, *row_x),
                (0.0, 0.0, 0.0, *row_y),
            )
        )

    def answer(self, measured: Four) -> list[float]:
        """Return the velocities of theta_bar's head joints that cancel what was measured."""
        a, b, c, d = measured
        return [-(i * a + j * b + k * c + m * d) for i, j, k, m in self.inverse]

    def gradient(self, weights: FourByFour) -> tuple[list[float], Vector]:
        """Return the gradient of sum(weights * block) with the weights held constant.

        Each row weighs a sum of the joints' twists T_j, and each twist meets a wrench, the weighted
        sum of rows. Coordinate i turns the rows of the floor with the base frame, and changes the
        twist of every joint j ahead of it by -ad(T_i) T_j.

        Args:
            weights: ``cofactors`` for the determinant, ``inverse`` for its logarithm.

        Returns:
            Derivative by each head joint, n_h numbers; and the derivative as the base frame turns
            by itself, in base coordinates, which R, P and Y make it do.
        """
        g = self._g
        half = g.s.robot.half_length_m
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = g.rows
        following = dict(zip(g.s.head_joints, weights, strict=True))
        gradient = []
        # Running sums over the joints ahead: what a motion v, w of joint i is multiplied with.
        by_vx = by_vy = by_vz = by_wx = by_wy = by_wz = 0.0
        # What turning the base frame does, in base coordinates.
        turned_x = turned_y = turned_z = 0.0
        for joint, ((vx, vy, vz), (wx, wy, wz)) in enumerate(g.chain.twists):
            gradient.append(
                -by_vx * vx - by_vy * vy - by_vz * vz - by_wx * wx - by_wy * wy - by_wz * wz
            )
            if joint not in following:
                continue
            p, q, r, t = following[joint]
            # Force at the link's centre and moment, of the floor's rows alone: these are fixed in
            # the world, so seen from the base they turn back.
            fx, fy, fz = q * cx / half, q * cy / half, q * cz / half
            mx, my, mz = r * ax + t * bx, r * ay + t * by, r * az + t * bz
            uy, uz = vy - half * wz, vz + half * wy
            turned_x += uy * fz - uz * fy + wy * mz - wz * my
            turned_y += uz * fx - vx * fz + wz * mx - wx * mz
            turned_z += vx * fy - uy * fx + wx * my - wy * mx
            # All four rows, about the frame's origin.
            fy += p / half
            my += q * cz
            mz -= q * cy + p
            by_vx += wy * fz - wz * fy
            by_vy += wz * fx - wx * fz
            by_vz += wx * fy - wy * fx
            by_wx += vy * fz - vz * fy + wy * mz - wz * my
            by_wy += vz * fx - vx * fz + wz * mx - wx * mz
            by_wz += vx * fy - vy * fx + wx * my - wy * mx
        turned = (turned_x, turned_y, turned_z)
        return [
            value + dot(turned, w) for value, (_, w) in zip(gradient, g.chain.twists, strict=True)
        ], turned


def _scaled(rows: FourByFour, factor: float) -> FourByFour:
    return [(a * factor, b * factor, c * factor, d * factor) for a, b, c, d in rows]
