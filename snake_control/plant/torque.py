"""The body as rigid links that joint torques move; wheels and floor hold exactly."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import DOP853

from snake_control.config import RobotConfig
from snake_control.errors import ModelError
from snake_control.model.floor import base_under_head
from snake_control.model.geometry import geometry
from snake_control.model.rigid_body import FloorBody
from snake_control.model.stability import support
from snake_control.plant.plant import PlantState

Array = NDArray[np.float64]

TOLERANCE = 1e-9
"""Relative error of a step of the integration; a thousandth of it is the absolute one [SI]."""

# What needs more steps than this for one call is no robot: a motion that explodes. Where a control
# law jumps (d_min's nearest edge changes) a few steps are very short, which is no fault.
_MOST_STEPS = 2000


@dataclasses.dataclass(frozen=True, eq=False)
class TorquePlantState(PlantState):
    """Ground truth of a body with inertia.

    ``effort`` is the applied torque.

    Attributes:
        w_ddot: acceleration of the head pose, (6,) [m/s^2, rad/s^2].
        phi_ddot: joint accelerations, (n-1,) [rad/s^2].
        wheel_forces: force of the floor on each wheeled base link along its own y axis (left),
            ascending, (n_b - m_b,) [N].
        energy: kinetic and potential energy together [J].
    """

    w_ddot: Array
    phi_ddot: Array
    wheel_forces: Array
    energy: float


class TorquePlant:
    """Rigid links, massless wheels that roll without friction and never slip, a floor that holds.

    The state is p = [x, y, yaw, phi] of the base's front end and the joints, and v = p_dot.
    Accelerations and wheel forces follow from one system of equations (Lagrange multipliers), not
    from the elimination (14)-(20) that the torque controller uses. The Runge-Kutta pair of
    Dormand and Prince of order 8 integrates in steps that its own error estimate chooses; then the
    velocity goes to the nearest one, as kinetic energy measures it, that the wheels allow.

    A robot that falls goes on as if the floor held its base; ``fallen`` says so.
    """

    def __init__(self, robot: RobotConfig, *, tolerance: float = TOLERANCE) -> None:
        """Make a plant; call ``reset`` or it stands at the robot's start posture.

        Args:
            robot: the robot.
            tolerance: relative error of a step of the integration, > 0.
        """
        self._robot = robot
        self._body = FloorBody(robot)
        self._tolerance = tolerance
        self.reset(robot.start_joint_angles_rad)

    def reset(
        self, phi: ArrayLike, w: ArrayLike | None = None, phi_dot: ArrayLike | None = None
    ) -> TorquePlantState:
        """Put the robot on the floor; see ``Plant.reset``.

        Args:
            phi: joint angles, (n-1,) [rad].
            w: head pose of which x_h, y_h, Y are used; default 0.
            phi_dot: joint velocities, (n-1,) [rad/s], of a base at rest; the wheels change them to
                what they allow. Default 0.

        Raises:
            ModelError: wrong shape or not finite.
        """
        phi = self._checked("phi", phi)
        rates = np.zeros_like(phi) if phi_dot is None else self._checked("phi_dot", phi_dot)
        base = base_under_head(self._robot, phi, np.zeros(6) if w is None else w)
        self._p = np.concatenate((base, phi))
        self._v = self._allowed(self._p, np.concatenate((np.zeros(3), rates)))
        self._fallen = False
        return self._state(np.zeros_like(phi))

    def step(self, joint_command: ArrayLike, dt: float) -> TorquePlantState:
        """Advance by ``dt`` seconds at constant joint torques; see ``Plant.step``.

        Args:
            joint_command: joint torques, (n-1,) [N m].
            dt: time step [s].

        Raises:
            ModelError: wrong shape or not finite, or the motion is no longer finite.
        """
        tau = self._checked("joint torques", joint_command)
        self._advance(lambda p, v, elapsed: tau, dt)
        return self._state(tau)

    def follow(
        self, law: Callable[[Array, Array, float], ArrayLike], dt: float
    ) -> TorquePlantState:
        """Advance by ``dt`` seconds with a controller that answers at every moment.

        What a control law does apart from the rate at which a computer repeats it: the torques
        change within the step, as the integration asks for them.

        Args:
            law: joint torques, (n-1,) [N m], for q, q_dot, (n + 5,) each, and the time since the
                start of this step [s].
            dt: time step [s].

        Raises:
            ModelError: torques of the wrong shape or not finite, or the motion is no longer finite.
        """

        def torques(p: Array, v: Array, elapsed: float) -> Array:
            w, w_dot = self._body.head(p, v)
            q, q_dot = np.concatenate((w, p[3:])), np.concatenate((w_dot, v[3:]))
            return self._checked("joint torques", law(q, q_dot, elapsed))

        self._advance(torques, dt)
        return self._state(torques(self._p, self._v, dt))

    def acceleration(self, p: ArrayLike, v: ArrayLike, tau: ArrayLike) -> tuple[Array, Array]:
        """Return p_ddot and the wheels' side forces in any state.

        Args:
            p: [x, y, yaw, phi] of the base's front end and the joints, (n + 2,) [m, rad].
            v: its rate, as the wheels allow it, (n + 2,) [m/s, rad/s].
            tau: joint torques, (n-1,) [N m].

        Returns:
            Accelerations, (n + 2,) [m/s^2, rad/s^2]; forces, (n_b - m_b,) [N].
        """
        p, v = np.asarray(p, dtype=float), np.asarray(v, dtype=float)
        terms = self._body.dynamics(p, v)
        force = -terms.bias
        force[3:] += np.asarray(tau, dtype=float)
        return _constrained(terms.M, terms.wheel_rows, force, -terms.wheel_drift)

    def energy(self, p: ArrayLike, v: ArrayLike) -> float:
        """Return kinetic and potential energy in any state [J]; p, v as for ``acceleration``."""
        return self._body.energy(np.asarray(p, dtype=float), np.asarray(v, dtype=float))

    @property
    def p(self) -> Array:
        """[x, y, yaw, phi] of the base's front end and the joints, (n + 2,) [m, rad]."""
        return self._p.copy()

    @property
    def v(self) -> Array:
        """Rate of ``p``, (n + 2,) [m/s, rad/s]."""
        return self._v.copy()

    def _advance(self, torques: Callable[[Array, Array, float], Array], dt: float) -> None:
        if dt == 0.0:
            return
        half = len(self._p)

        def rate(t: float, y: Array) -> Array:
            p, v = y[:half], y[half:]
            return np.concatenate((v, self.acceleration(p, v, torques(p, v, t))[0]))

        # A step far too long ends in numbers without end: the error below names it.
        with np.errstate(over="ignore", invalid="ignore"):
            solver = DOP853(
                rate,
                0.0,
                np.concatenate((self._p, self._v)),
                dt,
                first_step=abs(dt),
                rtol=self._tolerance,
                atol=1e-3 * self._tolerance,
            )
            for _ in range(_MOST_STEPS):
                solver.step()
                if solver.status != "running":
                    break
        p, v = solver.y[:half], solver.y[half:]
        if solver.status != "finished" or not np.isfinite(v).all():
            raise ModelError("the motion is no longer finite: torques or time step too large")
        self._p, self._v = p, self._allowed(p, v)

    def _allowed(self, p: Array, v: Array) -> Array:
        """Return the velocity nearest to ``v``, in kinetic energy, that keeps the wheels' rows."""
        terms = self._body.dynamics(p, v)
        rest = np.zeros(len(terms.wheel_rows))
        return _constrained(terms.M, terms.wheel_rows, terms.M @ v, rest)[0]

    def _state(self, tau: Array) -> TorquePlantState:
        p, v = self._p, self._v
        w, w_dot = self._body.head(p, v)
        a, forces = self.acceleration(p, v, tau)
        d_min = support(geometry(self._robot, np.concatenate((w, p[3:])))).d_min
        self._fallen |= d_min < 0
        return TorquePlantState(
            w=w,
            w_dot=w_dot,
            phi=p[3:].copy(),
            phi_dot=v[3:].copy(),
            effort=tau.copy(),
            slip=self._body.dynamics(p, v).wheel_rows @ v,
            d_min=d_min,
            fallen=self._fallen,
            w_ddot=self._body.head_acceleration(p, v, a),
            phi_ddot=a[3:].copy(),
            wheel_forces=forces,
            energy=self._body.energy(p, v),
        )

    def _checked(self, what: str, values: ArrayLike) -> Array:
        array = np.asarray(values, dtype=float)
        joints = self._robot.joints
        if array.shape != (joints,) or not np.isfinite(array).all():
            raise ModelError(f"{what}: expected {joints} finite numbers, got {array}")
        return array


def _constrained(M: Array, rows: Array, force: Array, right: Array) -> tuple[Array, Array]:
    """Solve M x = force + rows^T f, rows x = right for x and f."""
    size = len(M)
    system = np.zeros((size + len(rows), size + len(rows)))
    system[:size, :size] = M
    system[:size, size:] = -rows.T
    system[size:, :size] = rows
    solution = np.linalg.solve(system, np.concatenate((force, right))).astype(float, copy=False)
    return solution[:size], solution[size:]
