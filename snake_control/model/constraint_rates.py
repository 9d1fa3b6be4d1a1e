"""How the velocity constraints change along a motion: the time derivative of (3), (7) and (8).

With G(q) q_dot = 0 differentiated, G q_ddot + G_dot q_dot = 0. All of G_dot is in closed form:
base links turn with their heading, and the twist of coordinate j changes by -ad(V) times itself,
V the motion of all coordinates between it and the base.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from snake_control.model.constraints import floor_map, lateral_map
from snake_control.model.geometry import Geometry
from snake_control.model.redundancy import Kinematics
from snake_control.model.rotation import cross
from snake_control.model.selection import selection

Array = NDArray[np.float64]


def constraint_rate(g: Geometry, q_dot: Array) -> Array:
    """Return G_dot, the time derivative of the constraint matrix along ``q_dot``.

    The whole matrix, for readers and to check ``constraint_drift`` against, the quick one.

    Args:
        g: the posture.
        q_dot: rate of q, (n + 5,) [m/s, rad/s]; it need not fulfil the constraints.

    Returns:
        Shape of G, (wheels + floor_rows, n + 5), rows as in ``constraint_matrix``.
    """
    s = g.s
    wheels, moved_by_head = len(s.wheeled), 6 + s.n_h
    twist_rates = _twist_rates(g, q_dot)
    x, centers = g.x[s.wheeled], g.centers[s.wheeled]
    x_dot, y_dot, centers_dot, hitches_dot = _base_rates(g, q_dot)
    arms_dot = np.sum(x_dot * centers + x * centers_dot, axis=1)[:, None]

    rate = np.zeros((wheels + s.floor_rows, s.n + 5))
    rate[:wheels, :moved_by_head] = (
        np.hstack((y_dot, arms_dot)) @ g.twists[[0, 1, 5]] + lateral_map(g) @ twist_rates[[0, 1, 5]]
    )
    rate[:wheels, moved_by_head:] = s.behind * (arms_dot - x_dot @ g.hitches.T - x @ hitches_dot.T)
    if s.floor_rows:
        rate[wheels:, :moved_by_head] = (
            _floor_map_rate(g, q_dot) @ g.twists + floor_map(g) @ twist_rates
        )
    return rate


def F_bar_rate(g: Geometry, k: Kinematics, q_dot: Array) -> Array:
    """Return the time derivative of F_bar (8) along ``q_dot``, as (19) needs it.

    From B_tilde F_bar = A_tilde: B_tilde F_bar_dot = A_tilde_dot - B_tilde_dot F_bar. The paper's
    form, for readers and to check ``constraint_drift.F_bar_drift`` against, which gives its product
    with w_tilde_dot at once.

    Returns:
        Shape of F_bar, (n - m - 1, 6 + m).
    """
    index = selection(g.s)
    G_dot = constraint_rate(g, q_dot)
    # B_tilde is -G there.
    return _solve_B_tilde(k, G_dot[:, index.S] + G_dot[:, index.S_bar] @ k.F_bar)


def _solve_B_tilde(k: Kinematics, right: Array) -> Array:
    """Return B_tilde^-1 times ``right``, a matrix with the rows of the constraints.

    Four rows give the head joints, substitution along the body the base joints: pivoting would lose
    digits on long robots.
    """
    s = k.s
    head = k.solve_head(right[s.head_rows])
    rows = k.B_bar[s.base_rows]
    right = right[s.base_rows] - rows[:, s.theta_h] @ head
    base = solve_triangular(rows[:, s.theta_b], right, lower=True, check_finite=False)
    return np.vstack((head, base))


def _base_rates(g: Geometry, q_dot: Array) -> tuple[Array, Array, Array, Array]:
    """Return the rates of x, y and centres of the wheeled links, and of all hitches.

    In base coordinates, as seen from the first base link.
    """
    s = g.s
    half = s.robot.half_length_m
    turning = np.zeros((s.n_b, 1))
    np.cumsum(q_dot[6 + s.n_h :], out=turning[1:, 0])
    x_dot = turning * g.y
    ends_dot = -2 * half * np.cumsum(x_dot, axis=0)
    centers_dot = ends_dot + half * x_dot
    wheeled = s.wheeled
    return (
        x_dot[wheeled],
        -turning[wheeled] * g.x[wheeled],
        centers_dot[wheeled],
        ends_dot[:-1],
    )


def _twist_rates(g: Geometry, q_dot: Array) -> Array:
    """Return the time derivative of ``g.twists``, (6, 6 + n_h)."""
    order = [0, 1, 2, 5, 4, 3, *range(6, 6 + g.s.n_h)]
    moving = g.twists * q_dot[: 6 + g.s.n_h]
    # What the coordinates between each one and the base do.
    behind = np.empty_like(moving)
    behind[:, order] = np.cumsum(moving[:, order], axis=1)
    behind = moving.sum(axis=1, keepdims=True) - behind
    rates = np.empty_like(moving)
    rates[:3] = cross(g.twists[:3], behind[3:]) + cross(g.twists[3:], behind[:3])
    rates[3:] = cross(g.twists[3:], behind[3:])
    return rates


def _floor_map_rate(g: Geometry, q_dot: Array) -> Array:
    """Return the time derivative of ``floor_map``, (3, 6): its rows turn with the base."""
    angular = g.twists[3:] @ q_dot[: 6 + g.s.n_h]
    # Row i of the rotation changes by row x omega.
    turned = cross(g.base_rotation.T, angular[:, None]).T
    half = g.s.robot.half_length_m
    rate = np.zeros((3, 6))
    rate[0, :3] = turned[2]
    rate[0, 4] = half * turned[2, 2]
    rate[0, 5] = -half * turned[2, 1]
    rate[1:, 3:] = turned[:2]
    return rate
