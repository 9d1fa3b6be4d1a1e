"""The robot's dynamics (12)-(20), with the constraint forces of wheels and floor eliminated.

M, h and g come from Pinocchio, whose model is built from the project's own URDF. The root joint is
the composite of a translation and a Z-Y-X rotation by rates of angles, so that Pinocchio's
velocity is w_dot itself (in another order) and no change of coordinates stands between the two.

This module and ``rigid_body`` are the only ones that import Pinocchio; the velocity path does not.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.errors import ModelError
from snake_control.model.constraint_drift import F_bar_drift
from snake_control.model.floor import GRAVITY_M_S2
from snake_control.model.posture import Posture
from snake_control.model.selection import selection
from snake_control.model.structure import structure
from snake_control.model.urdf import urdf

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class FullDynamics:
    """Equation (15) without its constraint forces: M q_ddot + h + g = E tau.

    In coordinates q = [w, phi], of a planar snake, too, whose z, R and P have no part in w and
    stay as the floor holds them; E is zero but for a unit matrix at phi. Forces conjugate to R, P
    and Y are what does work on their rates, no torques about axes of the world.

    Attributes:
        M: inertia matrix, (n + 5, n + 5).
        h: Coriolis, centrifugal and viscous term, (n + 5,).
        g: gravity term, (n + 5,).
    """

    M: Array
    h: Array
    g: Array


@dataclasses.dataclass(frozen=True, eq=False)
class BarDynamics:
    """Equation (16): M_bar q_ddot + h_bar = E_bar tau.

    Attributes:
        M_bar: (6 + m, n + 5), or (3 + m, n + 5) of a planar snake; the others likewise.
        h_bar: (6 + m,).
        E_bar: (6 + m, n - 1).
    """

    M_bar: Array
    h_bar: Array
    E_bar: Array


@dataclasses.dataclass(frozen=True, eq=False)
class ReducedDynamics:
    """Equation (20): M_tilde w_tilde_ddot + h_tilde = E_tilde tau.

    Attributes:
        M_tilde: symmetric, positive definite, (6 + m, 6 + m), or (3 + m, 3 + m) of a planar snake;
            the others likewise.
        h_tilde: (6 + m,).
        E_tilde: (6 + m, n - 1).
        F_bar_drift: F_bar_dot w_tilde_dot (19), (n - m - 1,) [rad/s^2].
    """

    M_tilde: Array
    h_tilde: Array
    E_tilde: Array
    F_bar_drift: Array


class Dynamics:
    """The dynamics of one robot.

    It keeps Pinocchio's work space, so threads need one each.
    """

    def __init__(self, robot: RobotConfig) -> None:
        root = pinocchio.JointModelComposite(2)
        root.addJoint(pinocchio.JointModelTranslation())
        root.addJoint(pinocchio.JointModelSphericalZYX())
        self._model = pinocchio.buildModelFromXML(urdf(robot), root)
        self._model.gravity = pinocchio.Motion(np.array([0, 0, -GRAVITY_M_S2, 0, 0, 0]))
        self._data = self._model.createData()
        s = structure(robot)
        index = selection(s)
        self._S, self._S_bar = index.S, index.S_bar
        self._size = s.n + 5
        self._planar = robot.planar
        self._floor_height = robot.wheel_radius_m
        # Pinocchio's root joint counts x, y, z, Y, P, R. The permutation is its own inverse.
        self._order = np.array([0, 1, 2, 5, 4, 3, *range(6, self._size)])
        self._theta_bar = self._order[self._S_bar]
        self._motions = np.zeros((self._size, len(self._S) + 1))
        self._motions[self._order[self._S], np.arange(len(self._S))] = 1.0
        friction = np.zeros(self._size)
        friction[6:] = robot.joint_friction
        self._friction = friction

    def full(self, q: ArrayLike, q_dot: ArrayLike) -> FullDynamics:
        """Return M, h and g of (15).

        Args:
            q: [w, phi], (n + 5,) [m, rad].
            q_dot: its rate, (n + 5,) [m/s, rad/s].

        Raises:
            ModelError: wrong shape, or not finite.
        """
        q, q_dot = self._on_floor(self._checked("q", q), self._checked("q_dot", q_dot))
        order = self._order
        M = pinocchio.crba(self._model, self._data, q[order])[np.ix_(order, order)]
        g = pinocchio.computeGeneralizedGravity(self._model, self._data, q[order])[order]
        both = pinocchio.nonLinearEffects(self._model, self._data, q[order], q_dot[order])[order]
        return FullDynamics(M, both - g + self._friction * q_dot, g)

    def bar(self, posture: Posture, q_dot: ArrayLike) -> BarDynamics:
        """Return M_bar, h_bar and E_bar of (16), (17).

        The paper's form, for readers and to check ``reduced`` against, which does without it.

        Raises:
            ModelError: q_dot has the wrong shape or is not finite.
        """
        full = self.full(posture.g.q, q_dot)
        F_bar = posture.k.F_bar
        S, S_bar = self._S, self._S_bar
        forces = full.h + full.g
        return BarDynamics(
            full.M[S] + F_bar.T @ full.M[S_bar],
            forces[S] + F_bar.T @ forces[S_bar],
            posture.k.E_tilde,
        )

    def reduced(self, posture: Posture, q_dot: ArrayLike) -> ReducedDynamics:
        """Return M_tilde, h_tilde and E_tilde of (20).

        On motions that keep the constraints all of it depends on q and w_tilde_dot alone; off
        them, h and F_bar_dot are taken along ``q_dot`` as it is given.

        Args:
            posture: the posture.
            q_dot: rate of its q, (n + 5,) [m/s, rad/s].

        Raises:
            ModelError: q_dot has the wrong shape or is not finite.
        """
        q, v = self._on_floor(posture.g.q, self._checked("q_dot", q_dot))
        drift = F_bar_drift(posture.g, posture.k, v)
        # T [I; F_bar] (18) and beside it T [0; F_bar_dot] w_tilde_dot (19), in Pinocchio's order.
        motions = self._motions.copy()
        motions[self._theta_bar, :-1] = posture.k.F_bar
        motions[self._theta_bar, -1] = drift
        q, v = q[self._order], v[self._order]
        momenta: Array = pinocchio.crba(self._model, self._data, q).dot(motions)
        forces: Array = pinocchio.nonLinearEffects(self._model, self._data, q, v)
        momenta[:, -1] += forces + self._friction * v
        reduced = motions[:, :-1].T.dot(momenta)
        return ReducedDynamics(
            M_tilde=reduced[:, :-1],
            h_tilde=reduced[:, -1],
            E_tilde=posture.k.E_tilde,
            F_bar_drift=drift,
        )

    def _on_floor(self, q: Array, q_dot: Array) -> tuple[Array, Array]:
        """Return the two with what a planar snake's q and q_dot leave open: it lies level."""
        if not self._planar:
            return q, q_dot
        q, q_dot = q.copy(), q_dot.copy()
        q[2:5] = (self._floor_height, 0.0, 0.0)
        q_dot[2:5] = 0.0
        return q, q_dot

    def _checked(self, what: str, values: ArrayLike) -> Array:
        array = np.asarray(values, dtype=float)
        if array.shape != (self._size,) or not np.isfinite(array).all():
            raise ModelError(f"{what}: expected {self._size} finite numbers, got {array}")
        return array
