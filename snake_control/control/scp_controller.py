"""The velocity controller (22) with sub-tasks by shape controllable points (25), (27).

With ``controller.rotation_error: rotation_vector`` the attitude is controlled without the rates of
R, P and Y, which have no answer at P = +-90 degrees. With e the rotation vector, in the world, from
wanted to measured attitude, so that R = exp(e) R_d, the head turns at

    omega = exp(e) T(rpy_d) rpy_d_dot - K_omega e

(T of ``rpy_rate_map``, at the wanted attitude: this way round it is never singular). For equal
gains k of R, P and Y, K_omega = k and e decays exponentially along its own axis, from whatever
attitude. For others K_omega = k + T (K - k) T^-1 with their mean k, T at the measured attitude:
to first order (22), whose error is T^-1 e. Where cos P < 0.1 the second part fades out with the
square of cos P.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.limits import JointLimits
from snake_control.control.reference import Reference
from snake_control.control.sub_tasks import Composition
from snake_control.model.posture import Posture
from snake_control.model.rotation import (
    rotation_from_rpy,
    rotation_from_vector,
    rotation_vector,
    rpy_rate_map,
    rpy_rates,
    wrap_angle,
)
from snake_control.model.singular_shape import SingularShape

Array = NDArray[np.float64]

_SMALLEST_COSINE = 0.1
"""Of P: nearer to +-90 degrees than 84, gains that differ for R, P and Y become their mean."""


@dataclasses.dataclass(frozen=True, eq=False)
class ControlResult:
    """One control step: the command and everything that led to it.

    Attributes:
        posture: everything the model says of the posture, worked out as far as it was needed.
        w_d, w_d_dot: wanted pose and its rate, (6,) [m, rad, m/s, rad/s].
        error: w - w_d with angles in [-pi, pi), (6,), or instead of the angles the rotation vector
            from wanted to measured attitude (``controller.rotation_error``); 0 for z, R, P of a
            planar snake, which its controller does not move.
        phi_tilde_dot_d: wanted SCP velocities, H-SCPs first (25), (27), (m,) [rad/s].
        u_unlimited, u: joint velocities (22) before and after limiting, (n-1,) [rad/s].
        speed_scale: factor by which the whole vector was scaled down, 0..1.
        speed_limited, range_limited: joints whose limits bit, counted from 1.
    """

    posture: Posture
    w_d: Array
    w_d_dot: Array
    error: Array
    phi_tilde_dot_d: Array
    u_unlimited: Array
    u: Array
    speed_scale: float
    speed_limited: tuple[int, ...]
    range_limited: tuple[int, ...]

    @property
    def w(self) -> Array:
        """Head pose, (6,) [m, rad]."""
        return self.posture.g.q[:6]

    @property
    def phi(self) -> Array:
        """Joint angles, (n-1,) [rad]."""
        return self.posture.g.q[6:]

    @property
    def damping(self) -> float:
        """Share of the motion in B_tilde's weakest direction that was given up, 0 .. 1.

        0 but for singular head postures: u then is (22) to the last digit.
        """
        return self.posture.k.damping

    @property
    def V_h(self) -> float:
        """Manipulability of the head part (29)."""
        return self.posture.V_h

    @property
    def V_b1(self) -> float:
        """Distance from singular postures (30)."""
        return self.posture.V_b1

    @property
    def d_min(self) -> float:
        """Margin against falling (30) [m]."""
        return self.posture.support.d_min

    @property
    def sigma_min_B_tilde(self) -> float:
        """Smallest singular value of B_tilde (7)."""
        return self.posture.k.sigma_min_B_tilde

    @property
    def sigma_min_A_hat(self) -> float:
        """Smallest singular value of A_hat (11)."""
        return self.posture.k.sigma_min_A_hat

    @property
    def singular_shape(self) -> SingularShape:
        """The singular shape of Fig. 5 that is next, and how near it is."""
        return self.posture.singular_shape

    @property
    def support_polygon(self) -> Array:
        """Corners, counter-clockwise, (k, 2) [m]."""
        return self.posture.support.polygon

    @property
    def center_of_mass(self) -> Array:
        """P_G, (2,) [m]."""
        return self.posture.support.center_of_mass


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
        self._w = robot.controlled
        self._not_moved = [i for i in range(6) if i not in self._w]
        self._K = [controller.K[i] for i in self._w]
        # A planar snake turns about z alone: both are the same there.
        self._by_vector = controller.rotation_error == "rotation_vector" and not robot.planar
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

        Returns:
            The command, finite in every posture; near a singular head posture B_tilde's inverse is
            damped, and ``ControlResult.damping`` says so.

        Raises:
            ModelError: q has the wrong shape or is not finite.
        """
        del q_dot, t
        posture, error = self.look(q, reference)
        w_dot = [
            reference.time_scale * forward + back
            for forward, back in zip(
                self.feedforward(reference, error), self.feedback(posture, error), strict=True
            )
        ]
        given = reference.phi_tilde_dot_d
        phi_tilde_dot_d = self.sub_tasks(posture, w_dot) if given is None else given
        u = posture.k.joint_velocities(w_dot, phi_tilde_dot_d.tolist())
        limited = self._limits.apply(posture.g.q[6:], u)
        return ControlResult(
            posture=posture,
            w_d=reference.w_d,
            w_d_dot=reference.w_d_dot,
            error=np.array(error),
            phi_tilde_dot_d=phi_tilde_dot_d,
            u_unlimited=u,
            u=limited.u,
            speed_scale=limited.speed_scale,
            speed_limited=limited.speed_limited,
            range_limited=limited.range_limited,
        )

    # The parts of a step, for whoever decides more than the law (22) does.

    def look(
        self, q: ArrayLike, reference: Reference, known: Posture | None = None
    ) -> tuple[Posture, list[float]]:
        """Return the posture and the error, 0 for what is not moved; see ``ControlResult``.

        Args:
            q: [w, phi], (n+5,) [m, rad].
            reference: wanted head pose.
            known: a posture with the same joint angles, whatever its head pose.

        Raises:
            ModelError: q has the wrong shape or is not finite.
        """
        if known is None:
            posture = Posture(self._robot, q)
        else:
            posture = known if np.array_equal(known.g.q, q) else known.moved(np.asarray(q)[:6])
        error: list[float] = (posture.g.q[:6] - reference.w_d).tolist()
        if self._by_vector:
            # From here on velocities of the head are twists.
            posture.k.turning = posture.g.rows
            wanted = rotation_from_rpy(reference.w_d[3:])
            error[3:] = rotation_vector(rotation_from_rpy(posture.g.q[3:6]) @ wanted.T).tolist()
        else:
            error[3:] = map(wrap_angle, error[3:])
        for i in self._not_moved:
            error[i] = 0.0
        return posture, error

    def feedforward(self, reference: Reference, error: list[float]) -> list[float]:
        """Return the wanted velocity of what the controller moves, at full speed.

        That is w_d_dot, or a twist (see the module).
        """
        if self._by_vector:
            angular = rpy_rate_map(reference.w_d[3:]) @ reference.w_d_dot[3:]
            turning = rotation_from_vector(error[3:]) @ angular
            return [*reference.w_d_dot[:3].tolist(), *turning.tolist()]
        rates = reference.w_d_dot.tolist()
        return [rates[i] for i in self._w]

    def feedback(self, posture: Posture, error: list[float]) -> list[float]:
        """Return -K e, of what the controller moves, or the twist in its place."""
        if self._by_vector:
            back = [-K * e for K, e in zip(self._K[:3], error[:3], strict=True)]
            return back + self._turn_back(posture.g.q[3:6], np.array(error[3:])).tolist()
        return [-K * error[i] for i, K in zip(self._w, self._K, strict=True)]

    def _turn_back(self, rpy: Array, e: Array) -> Array:
        """Return -K_omega e [rad/s]."""
        gains = np.array(self._K[3:])
        mean = float(gains.mean())
        back = -mean * e
        if np.ptp(gains) > 0.0:
            share = min(1.0, (math.cos(float(rpy[1])) / _SMALLEST_COSINE) ** 2)
            uneven = (gains - mean) * rpy_rates(rpy, e)
            back -= share * (rpy_rate_map(rpy) @ uneven)
        return back

    @property
    def scps_follow_head(self) -> bool:
        """Whether the SCPs' velocities depend on the head's: not those of (25), (27)."""
        return self._sub_tasks.follows_head

    def prepare(self, posture: Posture) -> None:
        """Work out in a posture what ``sub_tasks`` will ask of it."""
        self._sub_tasks.prepare(posture)

    def sub_tasks(self, posture: Posture, w_dot: list[float]) -> Array:
        """Return the SCP velocities of (25), (27) for a velocity of the head (or its twist)."""
        return self._sub_tasks.velocities(posture, w_dot)
