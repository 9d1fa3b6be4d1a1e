"""SCPs in the kinematics: equations (7)-(11), and E_tilde of (17)."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from snake_control.errors import SingularError
from snake_control.model.constraints import constraint_matrix
from snake_control.model.geometry import Geometry
from snake_control.model.structure import Structure

Array = NDArray[np.float64]

# Below this, 4 x 4 head blocks of unit rows and decimetre columns carry no digits worth using.
_SINGULAR = 1e-10
_SUBSTITUTE_AT_ONCE = 8


@dataclasses.dataclass(frozen=True, eq=False)
class Kinematics:
    """The constraint matrix of one posture, cut up as the paper does.

    Rows: wheeled base links ascending, v_z, omega_x, omega_y. Columns of ``A_tilde`` and ``F_bar``:
    w, H-SCPs, B-SCPs; of ``B_tilde``: theta_bar, rising. Shapes are those of a robot with a raised
    head; a planar snake has no floor rows, and 3 instead of 6 columns for w.

    Attributes:
        s: index sets of the robot.
        G: constraint matrix, G q_dot = 0, (n_b - m_b + 3, n + 5).
    """

    s: Structure
    G: Array

    @functools.cached_property
    def A_bar(self) -> Array:
        """Equation (3), (n_b - m_b + 3, 6)."""
        return self.G[:, self.s.w]

    @functools.cached_property
    def B_bar(self) -> Array:
        """Equation (3), (n_b - m_b + 3, n - 1)."""
        return -self.G[:, 6:]

    @functools.cached_property
    def A_tilde(self) -> Array:
        """Equation (7), (n_b - m_b + 3, 6 + m)."""
        return np.hstack((self.A_bar, self.G[:, 6 + self.s.scp]))

    @functools.cached_property
    def B_tilde(self) -> Array:
        """Equation (7), square of size n - m - 1."""
        return self.B_bar[:, self.s.theta]

    @functools.cached_property
    def head_block(self) -> Array:
        """Rows of B_tilde that only the head joints of theta_bar enter, 4 x 4.

        Rows: the first base link's wheels (Assumption 5), then the floor. A planar snake has none.
        """
        return self.B_bar[np.ix_(self.s.head_rows, self.s.theta_h)]

    @functools.cached_property
    def F_bar(self) -> Array:
        """Equation (8): theta_bar_dot = F_bar w_tilde_dot, (n - m - 1, 6 + m).

        B_tilde is block triangular, so the head joints follow from four rows and the base joints
        by substitution. The zero block of (10) is exact.

        Raises:
            SingularError: the head block has no inverse.
        """
        s = self.s
        F_head: Array = np.zeros((len(s.theta_h), len(s.w) + s.m))
        if len(s.theta_h):
            sigma = np.linalg.svd(self.head_block, compute_uv=False)[-1]
            if not sigma > _SINGULAR:
                raise SingularError("B_tilde", float(sigma))
            F_head[:] = np.linalg.solve(self.head_block, self.A_tilde[s.head_rows])
            # The head block never sees a B-SCP; solve() would leave round-off there.
            F_head[:, len(s.w) + s.m_h :] = 0.0
        rows = s.base_rows
        right = self.A_tilde[rows] - self.B_bar[rows][:, s.theta_h] @ F_head
        F_base = _substitute(self.B_bar[rows][:, s.theta_b], right)
        return np.vstack((F_head, F_base))

    @functools.cached_property
    def A_hat(self) -> Array:
        """Equation (11), (n - 1, 6 + m)."""
        s = self.s
        lower = np.hstack((np.zeros((s.m, len(s.w))), np.eye(s.m)))
        return np.vstack((np.hstack((self.A_bar, np.zeros((len(self.G), s.m)))), lower))

    @functools.cached_property
    def B_hat(self) -> Array:
        """Equation (11), square of size n - 1 (with b_ks = 1 at s = i_k - 1)."""
        s = self.s
        selection = np.zeros((s.m, s.n - 1))
        selection[np.arange(s.m), s.scp] = 1.0
        return np.vstack((self.B_bar, selection))

    @functools.cached_property
    def E_tilde(self) -> Array:
        """Equations (17), (20): E_tilde = [I F_bar^T] T^T E, (6 + m, n - 1)."""
        s = self.s
        E = np.zeros((len(s.w) + s.m, s.n - 1))
        E[len(s.w) + np.arange(s.m), s.scp] = 1.0
        E[:, s.theta] = self.F_bar.T
        return E

    @functools.cached_property
    def sigma_min_B_tilde(self) -> float:
        """Smallest singular value of B_tilde."""
        return float(np.linalg.svd(self.B_tilde, compute_uv=False)[-1])

    @functools.cached_property
    def sigma_min_A_hat(self) -> float:
        """Smallest singular value of A_hat, whose blocks are A_bar and a unit matrix."""
        return float(min(np.linalg.svd(self.A_bar, compute_uv=False)[-1], 1.0))


def kinematics(g: Geometry) -> Kinematics:
    """Return the kinematic quantities of one posture."""
    return Kinematics(g.s, constraint_matrix(g))


def joint_velocities(k: Kinematics, w_dot: Array, phi_tilde_dot: Array) -> Array:
    """Return all joint velocities for wanted head and SCP velocities, equations (8), (22).

    Args:
        k: kinematics of the posture.
        w_dot: wanted velocity of w, (6,), or (3,) for a planar snake [m/s, rad/s].
        phi_tilde_dot: wanted SCP velocities, H-SCPs first, (m,) [rad/s].

    Returns:
        u = B_hat^-1 A_hat w_tilde_dot, (n - 1,) [rad/s].

    Raises:
        SingularError: B_tilde has no inverse.
    """
    u = np.empty(k.s.n - 1)
    u[k.s.scp] = phi_tilde_dot
    u[k.s.theta] = k.F_bar @ np.concatenate((w_dot, phi_tilde_dot))
    return u


def _substitute(lower: Array, right: Array) -> Array:
    """Solve a lower triangular system by rows, in halves.

    On long robots F_bar grows by orders of magnitude along the body; pivoting mixes these and loses
    the small entries, substitution keeps every row to full precision.
    """
    size = len(lower)
    if size <= _SUBSTITUTE_AT_ONCE:
        solution = np.empty_like(right)
        for row in range(size):
            done = right[row] - lower[row, :row] @ solution[:row]
            solution[row] = done / lower[row, row]
        return solution
    half = size // 2
    head = _substitute(lower[:half, :half], right[:half])
    tail = _substitute(lower[half:, half:], right[half:] - lower[half:, :half] @ head)
    return np.vstack((head, tail))
