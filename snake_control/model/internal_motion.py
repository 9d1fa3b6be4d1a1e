"""Kinematic redundancy: all joint velocities that give one head velocity, equations (4)-(6).

The basis N of the internal motion is used in the form that belongs to the SCPs: each column moves
one SCP at unit speed and no other. Then eta has a meaning, see ``scp_velocities_of``, and the
zeros of N are those of (6), exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.model.redundancy import Kinematics
from snake_control.model.structure import Structure

Array = NDArray[np.float64]


def basis_pattern(s: Structure) -> NDArray[np.bool_]:
    """Return where N may differ from zero (6), (n - 1, m).

    Rows: joints. Columns: H-SCPs, then B-SCPs. An H-SCP's column has every joint that is no SCP
    and itself; a B-SCP's has itself and the joints behind it that are no SCPs.
    """
    pattern = np.zeros((s.n - 1, s.m), dtype=bool)
    pattern[s.theta, : s.m_h] = True
    pattern[s.theta, s.m_h :] = s.theta[:, None] > s.scp_b[None, :]
    pattern[s.scp, np.arange(s.m)] = True
    return pattern


def internal_motion_basis(k: Kinematics) -> Array:
    """Return N = [N_h N_b], which spans the null space of B_bar (5), (6).

    Column j: all joint velocities while SCP j turns at 1 rad/s, the other SCPs rest and the head
    stands still: a unit vector in the rows of the SCPs, column j of [F_2 F_3] (8) in the others.

    Returns:
        Shape (n - 1, m), columns as ``phi_tilde``: H-SCPs, then B-SCPs.
    """
    s = k.s
    N = np.zeros((s.n - 1, s.m))
    N[s.scp, np.arange(s.m)] = 1.0
    N[s.theta] = k.F_bar[:, k.F_bar.shape[1] - s.m :]
    # Zero by structure, whatever round-off the solver of F_bar leaves.
    return np.where(basis_pattern(s), N, 0.0)


def least_joint_velocities(k: Kinematics, w_dot: ArrayLike) -> Array:
    """Return B_bar^+ A_bar w_dot, the smallest joint velocities that move the head so (4).

    Args:
        k: kinematics of the posture.
        w_dot: head velocity, one entry for each column of A_bar [m/s, rad/s].

    Returns:
        Joint velocities, (n - 1,) [rad/s].
    """
    return np.linalg.lstsq(k.B_bar, k.A_bar @ np.asarray(w_dot, dtype=float), rcond=None)[0]


def all_joint_velocities(k: Kinematics, w_dot: ArrayLike, eta: ArrayLike) -> Array:
    """Return B_bar^+ A_bar w_dot + N eta (4): every joint velocity that moves the head so.

    Args:
        k: kinematics of the posture.
        w_dot: head velocity, one entry for each column of A_bar [m/s, rad/s].
        eta: internal motion [eta_h, eta_b], (m,) [rad/s].
    """
    return least_joint_velocities(k, w_dot) + internal_motion_basis(k) @ np.asarray(eta)


def scp_velocities_of(k: Kinematics, w_dot: ArrayLike, eta: ArrayLike) -> Array:
    """Return the SCP velocities that an internal motion means, (m,) [rad/s].

    N is a unit matrix in the rows of the SCPs, so phi_tilde_dot is eta plus what the smallest
    solution already does there; with the head still the two are the same.
    """
    return least_joint_velocities(k, w_dot)[k.s.scp] + np.asarray(eta, dtype=float)


def internal_motion_of(k: Kinematics, w_dot: ArrayLike, phi_tilde_dot: ArrayLike) -> Array:
    """Return eta for wanted SCP velocities, (m,): the inverse of ``scp_velocities_of``."""
    return np.asarray(phi_tilde_dot, dtype=float) - least_joint_velocities(k, w_dot)[k.s.scp]
