"""How the velocity constraints change along a motion: the time derivative of (3), (7) and (8).

With G(q) q_dot = 0 differentiated, G q_ddot + G_dot q_dot = 0. All of G_dot is in closed form:
base links turn with their heading, and the twist of coordinate j changes by -ad(V) times itself,
V the motion of all coordinates between it and the base.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from snake_control.model.constraints import floor_map, lateral_map
from snake_control.model.geometry import Geometry
from snake_control.model.redundancy import Kinematics
from snake_control.model.rotation import cross
from snake_control.model.selection import selection

Array = NDArray[np.float64]

_TO_COMPLEX = np.array([1.0, 1.0j])


def constraint_rate(g: Geometry, q_dot: Array) -> Array:
    """Return G_dot, the time derivative of the constraint matrix along ``q_dot``.

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


def constraint_drift(g: Geometry, q_dot: Array, velocity: Array) -> Array:
    """Return G_dot v without forming G_dot, (wheels + floor_rows,) [m/s^2, rad/s^2].

    Args:
        g: the posture.
        q_dot: rate of q along which G changes, (n + 5,).
        velocity: v, (n + 5,); q_dot itself for the acceleration that the constraints impose.
    """
    s = g.s
    head = 6 + s.n_h
    twist, twist_rate, angular = _base_motion(g, q_dot[:head], velocity[:head])
    turn, turn_rate = twist[5], twist_rate[5]
    # In the base plane as x + i y. A link's centre moves by what its base frame does and by the
    # turning of the links in front of it, along q_dot and along v.
    forward, centers = g.x @ _TO_COMPLEX, g.centers @ _TO_COMPLEX
    along = np.zeros((2, s.n_b))
    np.cumsum(q_dot[head:], out=along[0, 1:])
    np.cumsum(velocity[head:], out=along[1, 1:])
    terms = np.empty((3, s.n_b), dtype=complex)
    terms[:2] = along * forward
    terms[2] = along[1] * terms[0]
    centers_dot, moved, turned = _chain(terms, s.robot.half_length_m)
    u = complex(twist[0], twist[1]) + 1j * (turn * centers + moved)
    u_dot = complex(twist_rate[0], twist_rate[1]) + 1j * turn_rate * centers
    u_dot -= turn * centers_dot + turned
    drift = np.empty(len(s.wheeled) + s.floor_rows)
    drift[: len(s.wheeled)] = (forward.conj() * (u_dot - 1j * along[0] * u)).imag[s.wheeled]
    if s.floor_rows:
        drift[len(s.wheeled) :] = _floor_drift(g, twist, twist_rate, angular)
    return drift


def F_bar_rate(g: Geometry, k: Kinematics, q_dot: Array) -> Array:
    """Return the time derivative of F_bar (8) along ``q_dot``, as (19) needs it.

    From B_tilde F_bar = A_tilde: B_tilde F_bar_dot = A_tilde_dot - B_tilde_dot F_bar.

    Returns:
        Shape of F_bar, (n - m - 1, 6 + m).
    """
    S, S_bar = selection(g.s)
    G_dot = constraint_rate(g, q_dot)
    # B_tilde is -G there.
    return solve_B_tilde(k, G_dot[:, S] + G_dot[:, S_bar] @ k.F_bar)


def F_bar_drift(g: Geometry, k: Kinematics, q_dot: Array) -> Array:
    """Return F_bar_dot w_tilde_dot of (19) without forming F_bar_dot, (n - m - 1,) [rad/s^2].

    The joint accelerations that keep the constraints while w_tilde moves evenly.
    """
    S, S_bar = selection(g.s)
    velocity = np.zeros_like(q_dot)
    velocity[S] = q_dot[S]
    velocity[S_bar] = k.F_bar @ q_dot[S]
    return solve_B_tilde(k, constraint_drift(g, q_dot, velocity))


def solve_B_tilde(k: Kinematics, right: Array) -> Array:
    """Return B_tilde^-1 times ``right``, which has the rows of the constraints.

    B_tilde is block triangular: four rows give the head joints, then substitution along the body
    gives the base joints one by one, which on long robots keeps digits that pivoting loses.
    """
    s = k.s
    head = k.solve_head(right[s.head_rows])
    rows = k.B_bar[s.base_rows]
    right = right[s.base_rows] - rows[:, s.theta_h] @ head
    base = solve_triangular(rows[:, s.theta_b], right, lower=True, check_finite=False)
    return np.concatenate((head, base))


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


def _chain(terms: NDArray[np.complex128], half: float) -> NDArray[np.complex128]:
    """Return the centres of links whose directions are ``terms``, one chain in each row."""
    centers: NDArray[np.complex128] = half * terms - 2 * half * np.cumsum(terms, axis=1)
    return centers


def _base_motion(
    g: Geometry, q_dot: Array, velocity: Array
) -> tuple[list[float], list[float], list[float]]:
    """Return twists @ v, its rate along q_dot at constant v, and the base's angular velocity.

    Args:
        g: the posture.
        q_dot: rate of [w, head joints], (6 + n_h,).
        velocity: v of the same, (6 + n_h,).

    Returns:
        Six numbers, six numbers, and three along q_dot, all in base coordinates.
    """
    moving = g.twists * q_dot
    parts = g.twists * velocity
    # Sum of v_j V_j x (what lies between j and the base): the antisymmetric parts of one product.
    products = (parts @ (moving @ _behind(g.s.n_h)).T).tolist()
    linear = [
        a + b for a, b in zip(_cross_sum(products, 0, 3), _cross_sum(products, 3, 0), strict=True)
    ]
    twist_rate = [*linear, *_cross_sum(products, 3, 3)]
    return parts.sum(axis=1).tolist(), twist_rate, moving[3:].sum(axis=1).tolist()


def _cross_sum(products: list[list[float]], first: int, second: int) -> tuple[float, float, float]:
    """Return the sum of cross products whose outer products are a block of ``products``."""
    i, j = first, second
    return (
        products[i + 1][j + 2] - products[i + 2][j + 1],
        products[i + 2][j] - products[i][j + 2],
        products[i][j + 1] - products[i + 1][j],
    )


@functools.lru_cache(maxsize=64)
def _behind(n_h: int) -> Array:
    """Return 1.0 where the coordinate of the row lies between that of the column and the base."""
    order = np.array([0, 1, 2, 5, 4, 3, *range(6, 6 + n_h)])
    place = np.argsort(order)
    return (place[:, None] > place[None, :]).astype(float)


def _floor_drift(
    g: Geometry, twist: list[float], twist_rate: list[float], angular: list[float]
) -> Array:
    """Return the floor rows' part of the drift, (3,): v_z, omega_x, omega_y."""
    half = g.s.robot.half_length_m
    v_x, v_y, v_z, w_x, w_y, w_z = twist
    a_x, a_y, a_z, b_x, b_y, b_z = twist_rate
    # The first base link's centre lies at (-l, 0, 0).
    v_y, v_z, a_y, a_z = v_y - half * w_z, v_z + half * w_y, a_y - half * b_z, a_z + half * b_y
    p, q, r = angular
    # What turns with the base changes by its own rate and by the turning.
    up = g.base_rotation[2] @ (
        a_x + q * v_z - r * v_y,
        a_y + r * v_x - p * v_z,
        a_z + p * v_y - q * v_x,
    )
    sides = g.base_rotation[:2] @ (
        b_x + q * w_z - r * w_y,
        b_y + r * w_x - p * w_z,
        b_z + p * w_y - q * w_x,
    )
    return np.array([up, *sides])
