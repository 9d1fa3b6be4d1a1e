"""How the base part moves as its joints turn and its wheels do not slide sideways.

The wheel rows outnumber the three planar velocities of the base frame: where the joint velocities
disagree with them, least squares decide, and what remains is the slip of each wheel.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from snake_control.model.constraints import lateral_joint_map, lateral_map, lateral_velocities
from snake_control.model.geometry import PlanarBase
from snake_control.model.vector import Vector

Array = NDArray[np.float64]
Planar = tuple[float, float, float]
"""Velocity x, y of the base frame's origin [m/s] and its turning [rad/s], in base coordinates."""

_FULL_RANK = 1e-6
_SMALLEST_DETERMINANT = 1e-12


def rolling(g: PlanarBase, base_velocities: Array) -> tuple[Planar, Array]:
    """Return how the base frame moves and how fast each wheeled link slides sideways.

    Args:
        g: the base part.
        base_velocities: of joints n_h+1 .. n-1, (n_b - 1,) [rad/s].

    Returns:
        The planar velocity, the smallest of several (a singular shape); the slip,
        (n_b - m_b,) [m/s].
    """
    rows = lateral_map(g)
    by_joints = lateral_velocities(g, base_velocities)
    planar = _least_squares(rows, -by_joints)
    return planar, rows.dot(planar) + by_joints


def rolling_by_joint(g: PlanarBase, point: Vector) -> tuple[float, float]:
    """Return what turning each base joint by 1 rad does to the base, root of the sum of squares.

    That is what misreading the joints does.

    Args:
        g: one base part.
        point: of the base, in base coordinates [m].

    Returns:
        By how much the point moves, per horizontal axis (mean), and the base turns [m, rad];
        infinite in a singular shape.
    """
    spread = rolling_spread(g)
    if not np.isfinite(spread).all():
        return math.inf, math.inf
    by_joint = spread @ lateral_map(g).T @ lateral_joint_map(g)
    moved = to_point(point) @ by_joint
    return math.sqrt(0.5 * float((moved**2).sum())), math.sqrt(float((by_joint[2] ** 2).sum()))


def to_point(point: Vector) -> Array:
    """Return the velocity x, y of a point of the base per planar velocity, (2, 3)."""
    return np.array(((1.0, 0.0, -point[1]), (0.0, 1.0, point[0])))


def point_spread(g: PlanarBase, point: Vector) -> tuple[float, float]:
    """Return what an error of 1 m in each wheel row does, as ``rolling_by_joint`` does."""
    spread = rolling_spread(g)
    if not np.isfinite(spread).all():
        return math.inf, math.inf
    at = to_point(point)
    return math.sqrt(0.5 * float(np.trace(at @ spread @ at.T))), math.sqrt(float(spread[2, 2]))


def rolling_spread(g: PlanarBase) -> Array:
    """Return the covariance of the planar velocity if each wheel row errs by 1 m/s, (..., 3, 3).

    It grows beyond all bounds towards singular shapes, and is infinite there.
    """
    rows = lateral_map(g) * _units(g)
    gram = np.swapaxes(rows, -1, -2) @ rows
    regular = np.linalg.det(gram) > _SMALLEST_DETERMINANT
    spread = np.full(gram.shape, np.inf)
    spread[regular] = np.linalg.inv(gram[regular])
    return spread * (_units(g)[:, None] * _units(g))


def rolling_steps(g: PlanarBase, turned: Array) -> Array:
    """Return by how much base frames move while their joints turn, (..., 3) [m, m, rad].

    Many at once, by the normal equations: to some 1e-9, while ``rolling`` is exact.

    Args:
        g: base parts half way.
        turned: changes of the base joint angles, (..., n_b - 1) [rad].
    """
    units = _units(g)
    rows = lateral_map(g) * units
    by_joints = lateral_velocities(g, turned)
    gram = np.swapaxes(rows, -1, -2) @ rows
    # Far below what any measurement can tell; it keeps singular shapes finite.
    gram += _SMALLEST_DETERMINANT * np.eye(3)
    right = np.swapaxes(rows, -1, -2) @ by_joints[..., None]
    moved: Array = -np.linalg.solve(gram, right)[..., 0] * units
    return moved


def _units(g: PlanarBase) -> Array:
    """Return the planar velocities that count as one: 1 m/s, 1 m/s, a turn by 1 / length."""
    return np.array((1.0, 1.0, 1.0 / (2.0 * g.s.robot.half_length_m * g.s.n_b)))


def _least_squares(rows: Array, right: Array) -> Planar:
    """Solve for three numbers; of several answers (a singular shape) the smallest."""
    if len(rows) > 3:
        # The triangular factor of rows and right side together holds what is to be solved.
        factor, _, _, _ = lapack.dgeqrf(np.concatenate((rows, right[:, None]), axis=1))
        R = factor[:3].tolist()
        diagonal = [abs(R[i][i]) for i in range(3)]
        if min(diagonal) > _FULL_RANK * max(diagonal):
            z = R[2][3] / R[2][2]
            y = (R[1][3] - R[1][2] * z) / R[1][1]
            return (R[0][3] - R[0][1] * y - R[0][2] * z) / R[0][0], y, z
    x, y, z = np.linalg.lstsq(rows, right, rcond=1e-9)[0].tolist()
    return x, y, z
