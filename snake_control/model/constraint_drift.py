"""F_bar_dot w_tilde_dot of (19): the joint accelerations that the constraints ask for.

While w_tilde moves evenly, 0 = d/dt (G q_dot) = G_dot q_dot + (part of theta_bar in G) times them.
As F_bar itself they come from four rows for the head joints, then link by link for the base joints;
no matrix of derivatives is formed (``constraint_rates`` has those).
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from snake_control.model.geometry import Geometry
from snake_control.model.redundancy import Kinematics
from snake_control.model.selection import selection
from snake_control.model.vector import Four, along, cross, dot

Array = NDArray[np.float64]


def F_bar_drift(g: Geometry, k: Kinematics, q_dot: Array) -> Array:
    """Return F_bar_dot w_tilde_dot, (n - m - 1,) [rad/s^2].

    Damped near a singular head posture, as F_bar is.

    Args:
        g, k: the posture and its kinematics.
        q_dot: rate of q along which F_bar changes, (n + 5,) [m/s, rad/s].
    """
    s = g.s
    index = selection(s)
    velocity = q_dot.copy()
    velocity[index.S_bar] = k.F_bar.dot(q_dot[index.S])
    twists, head = g.twists, 6 + s.n_h
    twist = twists.dot(velocity[:head])
    rate = _twist_rate(g, q_dot[:head], velocity[:head])
    answer: list[float] = []
    if s.floor_rows:
        turning = twists[3:].dot(q_dot[:head])
        answer = k.head.answer(_head_drift(g, twist, rate, turning))
        rate += twists[:, index.head_theta].dot(answer)
    sideways = _sideways_drift(g, q_dot[head:], velocity[head:], twist, rate)
    return np.concatenate((answer, k.base.answer(sideways)[index.base_theta]))


def _twist_rate(g: Geometry, q_dot: Array, velocity: Array) -> Array:
    """Return the rate of twists @ v along ``q_dot`` at constant v, (6,) in base coordinates.

    Args:
        g: the posture.
        q_dot: rate of [w, head joints], (6 + n_h,).
        velocity: v of the same, (6 + n_h,).
    """
    # Sum of v_j V_j x (what lies between j and the base): antisymmetric parts of one product.
    between = (g.twists * q_dot).dot(_between(g.s.n_h))
    a, b, c, p, q, r = (g.twists * velocity).dot(between.T).tolist()
    return np.array(
        (
            b[5] - c[4] + q[2] - r[1],
            c[3] - a[5] + r[0] - p[2],
            a[4] - b[3] + p[1] - q[0],
            q[5] - r[4],
            r[3] - p[5],
            p[4] - q[3],
        )
    )


@functools.lru_cache(maxsize=64)
def _between(n_h: int) -> Array:
    """Return 1.0 where the coordinate of the row lies between that of the column and the base."""
    place = np.argsort([0, 1, 2, 5, 4, 3, *range(6, 6 + n_h)])
    return (place[:, None] > place[None, :]).astype(float)


def _head_drift(g: Geometry, twist: Array, rate: Array, turning: Array) -> Four:
    """Return the rate of what ``HeadBlock.measure`` says of the twist.

    Args:
        g: the posture.
        twist, rate: of the base frame, and its rate, (6,).
        turning: angular velocity of the base frame, (3,).
    """
    half = g.s.robot.half_length_m
    v_x, v_y, v_z, w_x, w_y, w_z = twist.tolist()
    a_x, a_y, a_z, b_x, b_y, b_z = rate.tolist()
    o_x, o_y, o_z = turning.tolist()
    # The first base link's centre lies at (-l, 0, 0). Rows of the floor are fixed in the world.
    velocity = (v_x, v_y - half * w_z, v_z + half * w_y)
    acceleration = (a_x, a_y - half * b_z, a_z + half * b_y)
    turned = along(acceleration, 1.0, cross((o_x, o_y, o_z), velocity))
    spun = along((b_x, b_y, b_z), 1.0, cross((o_x, o_y, o_z), (w_x, w_y, w_z)))
    row_x, row_y, up = g.rows
    return acceleration[1] / half, dot(up, turned) / half, dot(row_x, spun), dot(row_y, spun)


def _sideways_drift(
    g: Geometry, phi_dot: Array, velocity: Array, twist: Array, rate: Array
) -> Array:
    """Return the rate of each base link's speed to its left, base joints moving evenly, (n_b,).

    Args:
        g: the posture.
        phi_dot, velocity: of the base joints, as q_dot and v of ``F_bar_drift``, (n_b - 1,).
        twist, rate: of the base frame, and its rate, (6,).
    """
    v_x, v_y, _, _, _, turn = twist.tolist()
    a_x, a_y, _, _, _, turn_rate = rate.tolist()
    # Turning of each link against the first one, along q_dot and along v.
    turning = np.zeros((2, g.s.n_b))
    np.add.accumulate(phi_dot, out=turning[0, 1:])
    np.add.accumulate(velocity, out=turning[1, 1:])
    # In the plane, x + i y: how turning links move their own centre and all behind them.
    links = np.empty((3, g.s.n_b), dtype=complex)
    np.multiply(turning, g.links, out=links[:2])
    np.multiply(links[0], turning[1], out=links[2])
    # Of the chain's centres: i times the rate, along v the same, and minus the rate of that.
    moved, moved_by_v, turned = 0.5 * links - np.add.accumulate(links, axis=1)
    speed = 1j * (turn * g.middles + moved_by_v) + complex(v_x, v_y)
    change = (1j * turn_rate) * g.middles - turn * moved - turned + complex(a_x, a_y)
    # As the link sees it, which turns itself.
    change -= 1j * turning[0] * speed
    sideways: Array = (g.forward.conj() * change).imag
    return sideways
