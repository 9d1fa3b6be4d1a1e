"""The body as a kinematic chain on wheels: no inertia, joints move as told, wheels may slip."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.errors import ModelError
from snake_control.model.floor import (
    base_under_head,
    chain_pose_on_floor,
    gravity_efforts,
    head_velocity,
)
from snake_control.model.geometry import Geometry, planar_base
from snake_control.model.head_chain import head_chain
from snake_control.model.rolling import rolling
from snake_control.model.stability import support
from snake_control.model.structure import structure
from snake_control.plant.plant import PlantState

Array = NDArray[np.float64]


class KinematicPlant:
    """Base level on the floor; its planar velocity fulfils the wheel constraints at best.

    The floor rows of (3) hold exactly because the base pose is integrated, not the head pose. The
    wheel rows outnumber the three planar velocities: where the joint velocities disagree with
    them, least squares decide, and what remains is the slip of each wheel.
    """

    def __init__(self, robot: RobotConfig, max_substep_s: float = math.inf) -> None:
        """Make a plant; call ``reset`` or it starts at the robot's start posture.

        Args:
            robot: the robot.
            max_substep_s: longest step of the integration, > 0 [s]; by default a step of the plant
                is one.
        """
        self._robot = robot
        self._max_substep_s = max_substep_s
        self._s = structure(robot)
        self.reset(robot.start_joint_angles_rad)

    def reset(self, phi: ArrayLike, w: ArrayLike | None = None) -> PlantState:
        """Put the robot on the floor; see ``Plant.reset``."""
        self._phi = self._checked("phi", phi).copy()
        wanted = np.zeros(6) if w is None else np.asarray(w, dtype=float)
        self._base = base_under_head(self._robot, self._phi, wanted)
        self._fallen = False
        return self._state(np.zeros(3), np.zeros(self._s.n - 1), np.zeros(len(self._s.wheeled)))

    def step(self, joint_command: ArrayLike, dt: float) -> PlantState:
        """Advance by ``dt`` seconds at constant joint velocities; see ``Plant.step``.

        Raises:
            ModelError: wrong shape or not finite.
        """
        phi_dot = self._checked("joint velocities", joint_command)
        steps = max(1, math.ceil(abs(dt) / self._max_substep_s - 1e-9))
        h = dt / steps
        for _ in range(steps):
            # Midpoint rule: second order, at the price of two small least-squares problems.
            middle, _ = self._base_velocity(self._phi, self._base, phi_dot)
            planar, slip = self._base_velocity(
                self._phi + 0.5 * h * phi_dot, self._base + 0.5 * h * middle, phi_dot
            )
            self._base = self._base + h * planar
            self._phi = self._phi + h * phi_dot
        return self._state(planar, phi_dot, slip)

    def _base_velocity(self, phi: Array, base: Array, phi_dot: Array) -> tuple[Array, Array]:
        """Return the rate of [x, y, yaw] of the base, and the slip of each wheeled link."""
        n_h = self._s.n_h
        links = planar_base(self._s, phi[n_h:])
        (x, y, turn), slip = rolling(links, phi_dot[n_h:])
        c, si = math.cos(base[2]), math.sin(base[2])
        return np.array((c * x - si * y, si * x + c * y, turn)), slip

    def _state(self, planar: Array, phi_dot: Array, slip: Array) -> PlantState:
        chain = head_chain(self._s, self._phi[: self._s.n_h].tolist())
        w = chain_pose_on_floor(self._robot, chain, self._base)
        g = Geometry(self._s, np.concatenate((w, self._phi)), chain)
        d_min = support(g).d_min
        self._fallen |= d_min < 0
        return PlantState(
            w=w,
            w_dot=head_velocity(g, planar, phi_dot),
            phi=self._phi.copy(),
            phi_dot=phi_dot.copy(),
            effort=gravity_efforts(g),
            slip=slip,
            d_min=d_min,
            fallen=self._fallen,
        )

    def _checked(self, what: str, values: ArrayLike) -> Array:
        array = np.asarray(values, dtype=float)
        if array.shape != (self._s.n - 1,) or not np.isfinite(array).all():
            raise ModelError(f"{what}: expected {self._s.n - 1} finite numbers, got {array}")
        return array
