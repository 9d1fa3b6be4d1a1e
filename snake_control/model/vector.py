"""Vectors of three plain numbers, and matrices of a few.

The head part is a handful of them; numpy takes ten times as long for each.
"""

from __future__ import annotations

import operator

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]
Twist = tuple[Vector, Vector]
"""Linear velocity of a frame's origin, and angular velocity."""
Four = tuple[float, float, float, float]
FourByFour = list[Four]
"""Four rows."""

ZERO: Vector = (0.0, 0.0, 0.0)


def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def through(rows: Rows, v: Vector) -> Vector:
    """Return the matrix given by ``rows`` times v."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


def along(point: Vector, length: float, direction: Vector) -> Vector:
    """Return point + length direction."""
    x, y, z = point
    dx, dy, dz = direction
    return x + length * dx, y + length * dy, z + length * dz


def combine(a: float, u: Vector, b: float, v: Vector) -> Vector:
    """Return a u + b v."""
    ux, uy, uz = u
    vx, vy, vz = v
    return a * ux + b * vx, a * uy + b * vy, a * uz + b * vz


def sumprod(a: list[float], b: list[float]) -> float:
    """Return the sum of products of two lists of equal length."""
    return sum(map(operator.mul, a, b))


def adjugate(a: Four, b: Four, c: Four, d: Four) -> tuple[float, FourByFour]:
    """Return determinant and adjugate of the matrix with rows a, b, c, d.

    By Laplace's expansion over the minors of two rows: polynomials of the entries, exact in form
    also where there is no inverse. The inverse is adjugate / determinant.
    """
    a0, a1, a2, a3 = a
    b0, b1, b2, b3 = b
    c0, c1, c2, c3 = c
    d0, d1, d2, d3 = d
    s0, s1, s2 = a0 * b1 - b0 * a1, a0 * b2 - b0 * a2, a0 * b3 - b0 * a3
    s3, s4, s5 = a1 * b2 - b1 * a2, a1 * b3 - b1 * a3, a2 * b3 - b2 * a3
    t0, t1, t2 = c0 * d1 - d0 * c1, c0 * d2 - d0 * c2, c0 * d3 - d0 * c3
    t3, t4, t5 = c1 * d2 - d1 * c2, c1 * d3 - d1 * c3, c2 * d3 - d2 * c3
    return s0 * t5 - s1 * t4 + s2 * t3 + s3 * t2 - s4 * t1 + s5 * t0, [
        (
            b1 * t5 - b2 * t4 + b3 * t3,
            a2 * t4 - a1 * t5 - a3 * t3,
            d1 * s5 - d2 * s4 + d3 * s3,
            c2 * s4 - c1 * s5 - c3 * s3,
        ),
        (
            b2 * t2 - b0 * t5 - b3 * t1,
            a0 * t5 - a2 * t2 + a3 * t1,
            d2 * s2 - d0 * s5 - d3 * s1,
            c0 * s5 - c2 * s2 + c3 * s1,
        ),
        (
            b0 * t4 - b1 * t2 + b3 * t0,
            a1 * t2 - a0 * t4 - a3 * t0,
            d0 * s4 - d1 * s2 + d3 * s0,
            c1 * s2 - c0 * s4 - c3 * s0,
        ),
        (
            b1 * t1 - b0 * t3 - b2 * t0,
            a0 * t3 - a1 * t1 + a2 * t0,
            d1 * s1 - d0 * s3 - d2 * s0,
            c0 * s3 - c1 * s1 + c2 * s0,
        ),
    ]
