"""The torque controller (21): feedback linearisation of the reduced dynamics (20).

    tau = E_tilde^+ {M_tilde (w_tilde_ddot_d - K_v e_dot - K_p e) + h_tilde} + tau_ker

For w the error then obeys e_ddot + K_v e_dot + K_p e = 0. The paper leaves open what w_tilde_d is
for the SCPs: here their velocity is that of (25), (27), fed back with K_v, their acceleration 0,
and no angle is fed back.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.reference import Reference
from snake_control.control.sub_tasks import Composition
from snake_control.errors import ModelError
from snake_control.model.damping import EPSILON, damped_reciprocals
from snake_control.model.dynamics import Dynamics
from snake_control.model.posture import Posture
from snake_control.model.rotation import wrap
from snake_control.model.structure import structure

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class TorqueResult:
    """One step of torque control: the command and everything that led to it.

    Attributes:
        w, w_dot: head pose and its rate, (6,) [m, rad, m/s, rad/s].
        w_d, w_d_dot, w_d_ddot: the reference, (6,).
        error, error_dot: w - w_d with angles in [-pi, pi), and its rate, (6,); 0 for z, R, P of a
            planar snake, which its controller does not move.
        phi, phi_dot: joint angles and velocities, (n-1,) [rad, rad/s].
        phi_tilde_dot_d: wanted SCP velocities, H-SCPs first (25), (27), (m,) [rad/s].
        w_tilde_ddot: acceleration that the torques shall make: of w, then of the SCPs, (6 + m,)
            [m/s^2, rad/s^2].
        M_tilde, h_tilde: the reduced dynamics (20).
        tau_ker: the part of the torques in Ker(E_tilde), (n-1,) [N m].
        u: joint torques tau (21), (n-1,) [N m].
        torque_exceeded: joints whose torque is beyond ``robot.joint_torque_limits_n_m``, from 1.
            Nothing is cut off: the error would follow another equation then.
        damped: whether E_tilde was so near singular that its pseudo-inverse was damped.
        sigma_min_E_tilde: smallest singular value of E_tilde.
        V_h, V_b1, d_min: cost functions (29), (30).
    """

    w: Array
    w_dot: Array
    w_d: Array
    w_d_dot: Array
    w_d_ddot: Array
    error: Array
    error_dot: Array
    phi: Array
    phi_dot: Array
    phi_tilde_dot_d: Array
    w_tilde_ddot: Array
    M_tilde: Array
    h_tilde: Array
    tau_ker: Array
    u: Array
    torque_exceeded: tuple[int, ...]
    damped: bool
    sigma_min_E_tilde: float
    V_h: float
    V_b1: float
    d_min: float


class TorqueController:
    """Moves the head along a reference by joint torques; the SCPs serve the sub-tasks.

    It keeps no state between steps; its work space makes it one for each thread.
    """

    def __init__(self, robot: RobotConfig, controller: ControllerConfig) -> None:
        """Prepare a controller.

        Args:
            robot: the robot.
            controller: gains K_p, K_v and those of the sub-tasks.

        Raises:
            ConfigError: gains that do not fit the robot, or a sub-task that cannot be made.
        """
        s = structure(robot)
        gains = ControllerConfig.for_scps(controller, s.m)
        self._robot = robot
        self._sub_tasks = Composition(robot, gains)
        self._s = s
        self._dynamics = Dynamics(robot)
        self._K_p = np.broadcast_to(gains.K_p, 6)[s.w]
        K_v = np.broadcast_to(gains.K_v, 6 + s.m)
        self._K_v_w, self._K_v_scp = K_v[s.w], K_v[6:]
        self._limits = np.array(robot.joint_torque_limits_n_m)

    def step(
        self,
        q: ArrayLike,
        q_dot: ArrayLike,
        reference: Reference,
        t: float,
        free_torques: ArrayLike | None = None,
    ) -> TorqueResult:
        """Return joint torques for one moment.

        Args:
            q: [w, phi], (n+5,) [m, rad].
            q_dot: its rate, (n+5,) [m/s, rad/s].
            reference: wanted head pose, rate and acceleration.
            t: time [s]; the controller does not use it.
            free_torques: any joint torques, (n-1,) [N m]; their part in Ker(E_tilde) is tau_ker,
                which loads wheels and links but moves nothing. Default 0: the pseudo-inverse is
                orthogonal to the kernel, so that no other choice makes |tau| smaller.

        Raises:
            ModelError: an argument has the wrong shape or is not finite, or so large that the
                torques asked for are not finite.
        """
        del t
        s = self._s
        posture = Posture(self._robot, q)
        reduced = self._dynamics.reduced(posture, q_dot)
        q_dot = np.asarray(q_dot, dtype=float)
        w, phi = posture.g.q[:6], posture.g.q[6:]
        w_dot, phi_dot = q_dot[:6], q_dot[6:]
        error, error_dot = np.zeros(6), np.zeros(6)
        difference = w - reference.w_d
        difference[3:] = wrap(difference[3:])
        error[s.w] = difference[s.w]
        error_dot[s.w] = (w_dot - reference.w_d_dot)[s.w]
        phi_tilde_dot_d = self._sub_tasks.velocities(posture, w_dot[s.w])
        w_tilde_ddot = np.concatenate(
            (
                reference.w_d_ddot[s.w] - self._K_v_w * error_dot[s.w] - self._K_p * error[s.w],
                -self._K_v_scp * (phi_dot[s.scp] - phi_tilde_dot_d),
            )
        )
        wanted = reduced.M_tilde @ w_tilde_ddot + reduced.h_tilde
        if not np.isfinite(wanted).all():
            bad = np.flatnonzero(~np.isfinite(wanted)).tolist()
            raise ModelError(
                f"M_tilde w_tilde_ddot + h_tilde is not finite at index {bad}: "
                f"largest rate in q_dot {np.abs(q_dot).max():.3g}, "
                f"largest wanted acceleration {np.abs(w_tilde_ddot).max():.3g}"
            )
        U, sigma, Vt = np.linalg.svd(reduced.E_tilde, full_matrices=False)
        tau = ((U.T @ wanted) * damped_reciprocals(sigma)) @ Vt
        tau_ker = np.zeros(s.n - 1)
        if free_torques is not None:
            free = self._checked(free_torques)
            tau_ker = free - (Vt @ free) @ Vt
        u = tau + tau_ker
        return TorqueResult(
            w=w,
            w_dot=w_dot,
            w_d=reference.w_d,
            w_d_dot=reference.w_d_dot,
            w_d_ddot=reference.w_d_ddot,
            error=error,
            error_dot=error_dot,
            phi=phi,
            phi_dot=phi_dot,
            phi_tilde_dot_d=phi_tilde_dot_d,
            w_tilde_ddot=w_tilde_ddot,
            M_tilde=reduced.M_tilde,
            h_tilde=reduced.h_tilde,
            tau_ker=tau_ker,
            u=u,
            torque_exceeded=tuple(int(j) + 1 for j in np.flatnonzero(np.abs(u) > self._limits)),
            damped=bool(sigma[-1] < EPSILON),
            sigma_min_E_tilde=float(sigma[-1]),
            V_h=posture.V_h,
            V_b1=posture.V_b1,
            d_min=posture.support.d_min,
        )

    def _checked(self, free_torques: ArrayLike) -> Array:
        free = np.asarray(free_torques, dtype=float)
        if free.shape != (self._s.n - 1,) or not np.isfinite(free).all():
            raise ModelError(f"free torques: expected {self._s.n - 1} finite numbers, got {free}")
        return free
