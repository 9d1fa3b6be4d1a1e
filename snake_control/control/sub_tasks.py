"""SCP velocities that raise the cost functions, equations (25), (27), (30)."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from snake_control.config import ControllerConfig
from snake_control.model.geometry import Geometry
from snake_control.model.manipulability import V_h
from snake_control.model.redundancy import Kinematics
from snake_control.model.singularity import V_b1
from snake_control.model.stability import Support, support

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Costs:
    """The paper's cost functions at one posture, with gradients by q, (n + 5,) each.

    Attributes:
        V_h: manipulability of the head part (29).
        V_b1: det(E_tilde E_tilde^T), 0 in a singular posture (30).
        support: support polygon and d_min (30).
    """

    V_h: float
    V_h_gradient: Array
    V_b1: float
    V_b1_gradient: Array
    support: Support


def costs(g: Geometry, k: Kinematics) -> Costs:
    """Evaluate the cost functions of one posture."""
    v_h, v_h_gradient = V_h(g, k)
    v_b1, v_b1_gradient = V_b1(g, k, v_h, v_h_gradient)
    return Costs(v_h, v_h_gradient, v_b1, v_b1_gradient, support(g))


def head_scp_velocities(k: Kinematics, cost: Costs, gains: ControllerConfig) -> Array:
    """Return phi_dot_hd, the H-SCP velocities that raise V_h (25), (m_h,) [rad/s]."""
    s = k.s
    if gains.a_h == 0.0:
        return np.zeros(s.m_h)
    by_phi = cost.V_h_gradient[6:]
    F_2h = k.F_bar[: len(s.theta_h), 6 : 6 + s.m_h]
    return gains.a_h * (by_phi[s.scp_h] + by_phi[s.theta_h] @ F_2h)


def base_scp_velocities(k: Kinematics, cost: Costs, gains: ControllerConfig) -> Array:
    """Return phi_dot_bd, the B-SCP velocities that raise a' V_b1 + b' d_min (27), (m_b,) [rad/s].

    A weight of 0 leaves its cost out altogether, so that an overflowing V_b1 does no harm then.
    """
    s = k.s
    by_phi = np.zeros(s.n - 1)
    if gains.a_prime:
        by_phi += gains.a_prime * cost.V_b1_gradient[6:]
    if gains.b_prime:
        by_phi += gains.b_prime * cost.support.gradient[6:]
    if gains.a_b == 0.0:
        return np.zeros(s.m_b)
    F_3b = k.F_bar[len(s.theta_h) :, 6 + s.m_h :]
    return gains.a_b * (by_phi[s.scp_b] + by_phi[s.theta_b] @ F_3b)
