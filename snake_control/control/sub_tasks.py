"""SCP velocities that raise the cost functions, equations (25), (27), (30)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snake_control.config import ControllerConfig
from snake_control.model.posture import Posture

Array = NDArray[np.float64]


def head_scp_velocities(posture: Posture, gains: ControllerConfig) -> Array:
    """Return phi_dot_hd, the H-SCP velocities that raise V_h (25), (m_h,) [rad/s]."""
    k = posture.k
    s = k.s
    if gains.a_h == 0.0:
        return np.zeros(s.m_h)
    by_phi = posture.V_h_gradient[6:]
    F_2h = k.F_bar[: len(s.theta_h), len(s.w) : len(s.w) + s.m_h]
    return gains.a_h * (by_phi[s.scp_h] + by_phi[s.theta_h] @ F_2h)


def base_scp_velocities(posture: Posture, gains: ControllerConfig) -> Array:
    """Return phi_dot_bd, the B-SCP velocities that raise a' V_b1 + b' d_min (27), (m_b,) [rad/s].

    A weight of 0 leaves its cost out altogether, so that an overflowing V_b1 does no harm then.
    """
    k = posture.k
    s = k.s
    by_phi = np.zeros(s.n - 1)
    if gains.a_prime:
        by_phi += gains.a_prime * posture.V_b1_gradient[6:]
    if gains.b_prime:
        by_phi += gains.b_prime * posture.support.gradient[6:]
    if gains.a_b == 0.0:
        return np.zeros(s.m_b)
    F_3b = k.F_bar[len(s.theta_h) :, len(s.w) + s.m_h :]
    return gains.a_b * (by_phi[s.scp_b] + by_phi[s.theta_b] @ F_3b)
