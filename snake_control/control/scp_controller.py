"""The velocity controller (22) with sub-tasks by shape controllable points (25), (27)."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.limits import JointLimits
from snake_control.control.reference import Reference
from snake_control.control.sub_tasks import Composition
from snake_control.errors import SingularError
from snake_control.model.posture import Posture
from snake_control.model.redundancy import joint_velocities
from snake_control.model.rotation import wrap
from snake_control.model.singular_shape import SingularShape
from snake_control.model.structure import structure

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class ControlResult:
    """One control step: the command and everything that led to it.

    Attributes:
        w, w_d, w_d_dot: head pose, wanted pose and its rate, (6,) [m, rad, m/s, rad/s].
        error: w - w_d with angles in [-pi, pi), (6,); 0 for z, R, P of a planar snake, which its
            controller does not move.
        phi: joint angles, (n-1,) [rad].
        phi_tilde_dot_d: wanted SCP velocities, H-SCPs first (25), (27), (m,) [rad/s].
        u_unlimited, u: joint velocities (22) before and after limiting, (n-1,) [rad/s].
        speed_scale: factor by which the whole vector was scaled down, 0..1.
        speed_limited, range_limited: joints whose limits bit, counted from 1.
        V_h, V_b1, d_min: cost functions (29), (30).
        sigma_min_B_tilde, sigma_min_A_hat: smallest singular values of (7), (11).
        singular_shape: the singular shape of Fig. 5 that is next, and how near it is.
        support_polygon: corners, counter-clockwise, (k, 2) [m].
        center_of_mass: P_G, (2,) [m].
    """

    w: Array
    w_d: Array
    w_d_dot: Array
    error: Array
    phi: Array
    phi_tilde_dot_d: Array
    u_unlimited: Array
    u: Array
    speed_scale: float
    speed_limited: tuple[int, ...]
    range_limited: tuple[int, ...]
    V_h: float
    V_b1: float
    d_min: float
    sigma_min_B_tilde: float
    sigma_min_A_hat: float
    singular_shape: SingularShape
    support_polygon: Array
    center_of_mass: Array


class ScpController:
    """Moves the head along a reference and spends the redundancy on sub-tasks.

    It keeps no state between steps: the same posture and reference give the same command.
    """

    def __init__(self, robot: RobotConfig, controller: ControllerConfig) -> None:
        """Prepare a controller.

        Args:
            robot: the robot.
            controller: gains and sub-tasks; K is the diagonal for the head (its SCP part is 0).

        Raises:
            ConfigError: a sub-task cannot be made.
        """
        self._robot = robot
        self._sub_tasks = Composition(robot, controller)
        self._w = structure(robot).w
        self._K = np.array(controller.K[:6])[self._w]
        self._limits = JointLimits(robot)

    def step(
        self, q: ArrayLike, q_dot: ArrayLike | None, reference: Reference, t: float
    ) -> ControlResult:
        """Return joint velocities for one moment.

        Args:
            q: [w, phi], (n+5,) [m, rad].
            q_dot: its rate; the velocity controller does not use it.
            reference: wanted head pose and rate.
            t: time [s]; the velocity controller does not use it.

        Raises:
            ModelError: q has the wrong shape or is not finite.
            SingularError: B_tilde has no inverse, or the answer is not finite.
        """
        del q_dot, t
        posture = Posture(self._robot, q)
        g, k = posture.g, posture.k
        # Raises in a singular head posture, where the costs would divide by V_h = 0.
        _ = k.F_bar
        w, phi = g.q[:6], g.q[6:]
        difference = w - reference.w_d
        difference[3:] = wrap(difference[3:])
        error = np.zeros(6)
        error[self._w] = difference[self._w]
        w_dot = reference.w_d_dot[self._w] - self._K * error[self._w]
        phi_tilde_dot_d = self._sub_tasks.velocities(posture, w_dot)
        u = joint_velocities(k, w_dot, phi_tilde_dot_d)
        if not np.isfinite(u).all():
            raise SingularError("B_tilde", k.sigma_min_B_tilde)
        limited = self._limits.apply(phi, u)
        return ControlResult(
            w=w,
            w_d=reference.w_d,
            w_d_dot=reference.w_d_dot,
            error=error,
            phi=phi,
            phi_tilde_dot_d=phi_tilde_dot_d,
            u_unlimited=u,
            u=limited.u,
            speed_scale=limited.speed_scale,
            speed_limited=limited.speed_limited,
            range_limited=limited.range_limited,
            V_h=posture.V_h,
            V_b1=posture.V_b1,
            d_min=posture.support.d_min,
            sigma_min_B_tilde=k.sigma_min_B_tilde,
            sigma_min_A_hat=k.sigma_min_A_hat,
            singular_shape=posture.singular_shape,
            support_polygon=posture.support.polygon,
            center_of_mass=posture.support.center_of_mass,
        )
