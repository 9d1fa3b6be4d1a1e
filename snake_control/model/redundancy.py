"""SCPs in the kinematics: equations (7)-(11), and E_tilde of (17).

B_tilde is block triangular: four rows give the head joints of theta_bar (``HeadBlock``), then every
driven link gives the joint in front of it (``BaseMap``). The control path uses these two and never
the whole matrices, which are there for people, tests and the dynamics.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snake_control.model.base_map import BaseMap
from snake_control.model.constraints import constraint_matrix
from snake_control.model.geometry import Geometry
from snake_control.model.head_block import HeadBlock
from snake_control.model.lazy import lazy
from snake_control.model.selection import selection
from snake_control.model.structure import Structure
from snake_control.model.vector import Rows, Twist, along, combine, cross

Array = NDArray[np.float64]


class Kinematics:
    """The constraints of one posture, cut up as the paper does; each matrix when it is asked for.

    Rows: wheeled base links ascending, v_z, omega_x, omega_y. Columns of ``A_tilde`` and ``F_bar``:
    w, H-SCPs, B-SCPs; of ``B_tilde``: theta_bar, rising. Shapes are those of a robot with a raised
    head; a planar snake has no floor rows, and 3 instead of 6 columns for w.

    Attributes:
        s: index sets of the robot.
        turning: axes, in base coordinates, about which components 3 to 5 of the head's velocity in
            ``joint_velocities`` turn the robot: those of R, P, Y (so that it is w_dot), or the
            rows of the base's attitude, the world's axes (so that it is a twist). The matrices
            are always the paper's.
    """

    s: Structure
    turning: Rows

    def __init__(self, g: Geometry) -> None:
        self.s = g.s
        self.turning = g.attitude_axes
        self._g = g

    @lazy
    def G(self) -> Array:
        """Constraint matrix, G q_dot = 0, (n_b - m_b + 3, n + 5)."""
        return constraint_matrix(self._g)

    @lazy
    def A_bar(self) -> Array:
        """Equation (3), (n_b - m_b + 3, 6)."""
        return self.G[:, self.s.w]

    @lazy
    def B_bar(self) -> Array:
        """Equation (3), (n_b - m_b + 3, n - 1)."""
        return -self.G[:, 6:]

    @lazy
    def A_tilde(self) -> Array:
        """Equation (7), (n_b - m_b + 3, 6 + m)."""
        return np.hstack((self.A_bar, self.G[:, 6 + self.s.scp]))

    @lazy
    def B_tilde(self) -> Array:
        """Equation (7), square of size n - m - 1."""
        return self.B_bar[:, self.s.theta]

    @lazy
    def head_block(self) -> Array:
        """Rows of B_tilde that only the head joints of theta_bar enter, 4 x 4.

        Rows: the first base link's wheels (Assumption 5), then the floor. A planar snake has none.
        The paper's form, for readers and to check ``head`` against, the quick one.
        """
        return self.B_bar[np.ix_(self.s.head_rows, self.s.theta_h)]

    @lazy
    def head(self) -> HeadBlock:
        """The same four rows, free of units, and their inverse. Not for a planar snake."""
        return HeadBlock(self._g)

    @lazy
    def base(self) -> BaseMap:
        """The base joints' velocities per motion of the first base link and per B-SCP."""
        return BaseMap(self._g)

    def solve_head(self, right: Array) -> Array:
        """Return the inverse of ``head_block``, damped where ``damping`` says so, times ``right``.

        In the paper's units, for readers and for checks; the control path asks ``head`` itself.

        Args:
            right: rows as ``head_block``, (4, ...); no rows for a planar snake.
        """
        if self.s.robot.planar:
            return np.zeros_like(right)
        half = self.s.robot.half_length_m
        units = np.array((1.0 / half, 1.0 / half, 1.0, 1.0))
        # The head block of B_tilde is that of ``head`` with the opposite sign.
        return -(np.array(self.head.inverse) * units).dot(right)

    @property
    def damping(self) -> float:
        """Share of the motion in B_tilde's weakest direction that is given up, 0 .. 1.

        0: every inverse here is exact. See ``snake_control.model.damping``.
        """
        return 0.0 if self.s.robot.planar else self.head.damping

    @lazy
    def head_scp_motion(self) -> list[list[float]]:
        """Velocities of head joints 1 .. n_h per H-SCP, the head pose at rest: m_h lists."""
        s = self.s
        motions = []
        for scp in s.head_scps:
            answer = self.head.answer(self.head.by_joint[scp])
            motion = [0.0] * s.n_h
            motion[scp] = 1.0
            for joint, velocity in zip(s.head_joints, answer, strict=True):
                motion[joint] = velocity
            motions.append(motion)
        return motions

    @property
    def base_scp_motion(self) -> Array:
        """Velocities of joints n_h+1 .. n-1 per B-SCP, what is in front at rest, (n_b-1, m_b)."""
        return self.base.N[:, self.s.base.entries :]

    @lazy
    def F_bar(self) -> Array:
        """Equation (8): theta_bar_dot = F_bar w_tilde_dot, (n - m - 1, 6 + m).

        The zero block of (10) is exact. Damped near a singular head posture, see ``damping``.
        """
        s, entries, index = self.s, self.s.base.entries, selection(self.s)
        head, moved_by_head = len(s.theta_h), len(index.head_inputs)
        twists = self._g.twists
        by_base = self.base.N[index.base_theta]
        F_bar = np.zeros((len(s.theta), moved_by_head + s.m_b))
        moved = twists[:, index.head_inputs]
        if head:
            F_head = -np.array(self.head.inverse).dot(self.head.rows()).dot(moved)
            F_bar[:head, :moved_by_head] = F_head
            moved += twists[:, index.head_theta].dot(F_head)
        F_bar[head:, :moved_by_head] = by_base[:, :entries].dot(s.base.entry_rows.dot(moved))
        F_bar[head:, moved_by_head:] = by_base[:, entries:]
        return F_bar

    def joint_velocities(self, w_dot: list[float], phi_tilde_dot: list[float]) -> Array:
        """Return u of (22), see the function of that name, without forming F_bar.

        Args:
            w_dot: velocity of the head, of what is controlled; see ``turning`` for its rotation.
            phi_tilde_dot: wanted SCP velocities, H-SCPs first, m numbers [rad/s].
        """
        s, g = self.s, self._g
        motion = _motion_by_w(g, w_dot, self.turning)
        (forward, sideways, _), (_, _, turning) = motion
        velocities = [0.0] * s.n_h
        if s.n_h:
            answer = self.head.answer(*self.head.measure((motion,)))
            for joint, velocity in zip(s.head_joints, answer, strict=True):
                velocities[joint] = velocity
            for rate, by_scp in zip(phi_tilde_dot, self.head_scp_motion, strict=False):
                velocities = [v + rate * each for v, each in zip(velocities, by_scp, strict=True)]
            for velocity, ((vx, vy, _), (_, _, wz)) in zip(velocities, g.chain.twists, strict=True):
                forward += velocity * vx
                sideways += velocity * vy
                turning += velocity * wz
        half = s.robot.half_length_m
        entry = [forward / half, turning]
        if s.robot.planar:
            entry.insert(1, sideways / half)
        entry += phi_tilde_dot[s.m_h :]
        return np.concatenate((velocities, self.base.N.dot(entry)))

    @lazy
    def A_hat(self) -> Array:
        """Equation (11), (n - 1, 6 + m)."""
        s = self.s
        lower = np.hstack((np.zeros((s.m, len(s.w))), np.eye(s.m)))
        return np.vstack((np.hstack((self.A_bar, np.zeros((len(self.G), s.m)))), lower))

    @lazy
    def B_hat(self) -> Array:
        """Equation (11), square of size n - 1 (with b_ks = 1 at s = i_k - 1)."""
        s = self.s
        selection = np.zeros((s.m, s.n - 1))
        selection[np.arange(s.m), s.scp] = 1.0
        return np.vstack((self.B_bar, selection))

    @lazy
    def E_tilde(self) -> Array:
        """Equations (17), (20): E_tilde = [I F_bar^T] T^T E, (6 + m, n - 1)."""
        s = self.s
        E = np.zeros((len(s.w) + s.m, s.n - 1))
        E[len(s.w) + np.arange(s.m), s.scp] = 1.0
        E[:, s.theta] = self.F_bar.T
        return E

    @lazy
    def sigma_min_B_tilde(self) -> float:
        """Smallest singular value of B_tilde."""
        return float(np.linalg.svd(self.B_tilde, compute_uv=False)[-1])

    @lazy
    def sigma_min_A_hat(self) -> float:
        """Smallest singular value of A_hat, whose blocks are A_bar and a unit matrix."""
        return float(min(np.linalg.svd(self.A_bar, compute_uv=False)[-1], 1.0))


def kinematics(g: Geometry) -> Kinematics:
    """Return the kinematic quantities of one posture."""
    return Kinematics(g)


def joint_velocities(k: Kinematics, w_dot: Array, phi_tilde_dot: Array) -> Array:
    """Return all joint velocities for wanted head and SCP velocities, equations (8), (22).

    Args:
        k: kinematics of the posture.
        w_dot: wanted velocity of w, (6,), or (3,) for a planar snake [m/s, rad/s].
        phi_tilde_dot: wanted SCP velocities, H-SCPs first, (m,) [rad/s].

    Returns:
        u = B_hat^-1 A_hat w_tilde_dot, (n - 1,) [rad/s]; damped near a singular head posture.
    """
    return k.joint_velocities(np.asarray(w_dot).tolist(), np.asarray(phi_tilde_dot).tolist())


def _motion_by_w(g: Geometry, w_dot: list[float], turning: Rows) -> Twist:
    """Return how the base frame moves with the head pose while the head joints rest."""
    if g.s.robot.planar:
        x_dot, y_dot, yaw_dot = w_dot
        z_dot = roll_dot = pitch_dot = 0.0
    else:
        x_dot, y_dot, z_dot, roll_dot, pitch_dot, yaw_dot = w_dot
    a, b, c = g.rows
    rolling, pitching, yawing = turning
    angular = along(combine(roll_dot, rolling, pitch_dot, pitching), yaw_dot, yawing)
    linear = along(combine(x_dot, a, y_dot, b), z_dot, c)
    return along(linear, 1.0, cross(g.chain.tip, angular)), angular
