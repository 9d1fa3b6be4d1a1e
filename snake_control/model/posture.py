"""One posture and every quantity the controllers ask of it, each worked out once, when needed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.model.geometry import Geometry, geometry
from snake_control.model.lazy import lazy
from snake_control.model.redundancy import Kinematics, kinematics
from snake_control.model.singular_shape import SingularShape, singular_shape
from snake_control.model.singularity import GramDeterminant, attitude_log, attitude_log_gradient
from snake_control.model.stability import Support, support
from snake_control.model.vector import ZERO, Vector, dot

Array = NDArray[np.float64]

_LARGEST_LOG = 345.0
"""V_b1 is kept within some 1e-150 .. 1e150, so that nothing computed from it overflows."""

_OF_JOINTS = ("_gram", "log_V_b1_by_base", "singular_shape")
"""What the base joints alone decide, beside the kinematics' ``base``."""


class Posture:
    """What cost functions and control laws read; gradients are by q, (n + 5,) each.

    All of it is finite, also in singular postures: log V_b1 is cut off at +-345 (so V_b1 is never
    quite 0), and logarithmic gradients are damped there (``snake_control.model.damping``), which
    does not make them 0: what stays regular keeps its part.

    Attributes:
        robot: the robot.
        g: where everything is.
        k: velocity constraints and what follows from them.
    """

    def __init__(self, robot: RobotConfig, q: ArrayLike) -> None:
        """Work out the geometry; everything else waits until it is asked for.

        Args:
            robot: the robot.
            q: [w, phi], (n + 5,) [m, rad].

        Raises:
            ModelError: wrong shape, not finite, or beyond +-1e6.
        """
        self._begin(robot, geometry(robot, q))

    def _begin(self, robot: RobotConfig, g: Geometry) -> None:
        self.robot = robot
        self.g: Geometry = g
        self.k: Kinematics = kinematics(g)

    @classmethod
    def of(cls, robot: RobotConfig, g: Geometry) -> Posture:
        """Return the posture of a geometry that is worked out already."""
        posture = cls.__new__(cls)
        posture._begin(robot, g)
        return posture

    def moved(self, w: ArrayLike) -> Posture:
        """Return the same joint angles with the head at another pose.

        What depends on the joints alone is taken over as far as it was worked out.

        Args:
            w: pose of the head, (6,) [m, rad].

        Raises:
            ModelError: w has the wrong shape, is not finite, or beyond +-1e6.
        """
        other = Posture.of(self.robot, self.g.moved(w))
        known, of_kinematics = self.__dict__, self.k.__dict__
        other.__dict__.update({name: known[name] for name in _OF_JOINTS if name in known})
        if "base" in of_kinematics:
            other.k.__dict__["base"] = of_kinematics["base"]
        return other

    @lazy
    def V_h(self) -> float:
        """Manipulability of the head part, V_h = |det B_tilde| (29).

        B_tilde is block triangular and the base block has l on its diagonal, so it is |det head
        block| l^(n_b - m_b - 1); constant for a planar snake.
        """
        return self._V_h_unit * self.head_determinant

    @property
    def V_h_by_head(self) -> list[float]:
        """Derivative of V_h by each head joint, n_h numbers: all that (25) needs."""
        return [self._V_h_unit * value for value in self.head_determinant_by_head]

    @lazy
    def V_h_gradient(self) -> Array:
        """Gradient of V_h; exact in singular postures, too."""
        return self._V_h_unit * self.head_determinant_gradient

    @property
    def head_determinant(self) -> float:
        """|det head block|, free of units, as ``HeadBlock`` has it; 1 for a planar snake.

        V_h without the power of l, which leaves the range of numbers on long robots.
        """
        return 1.0 if self.robot.planar else self.k.head.determinant

    @property
    def head_determinant_by_head(self) -> list[float]:
        """Derivative of ``head_determinant`` by each head joint, n_h numbers."""
        scale, by_joints, _ = self._determinant_parts
        return [scale * value for value in by_joints]

    @property
    def head_determinant_gradient(self) -> Array:
        """Gradient of ``head_determinant``; exact in singular postures, too."""
        scale, by_joints, by_turning = self._determinant_parts
        return scale * self._by_head(by_joints, by_turning)

    @lazy
    def log_V_h_gradient(self) -> Array:
        """Gradient of log V_h, damped near a singular head posture."""
        return self._by_head(*self._log_V_h_parts)

    @property
    def _V_h_unit(self) -> float:
        half, driven = self.robot.half_length_m, len(self.k.s.theta_b)
        # Two rows of the head block were divided by l.
        return half**driven if self.robot.planar else half ** (driven + 2)

    @lazy
    def _determinant_parts(self) -> tuple[float, list[float], Vector]:
        """Derivative by head joints and by turning the base frame, after a common factor."""
        if self.k.damping == 0.0:
            return self.head_determinant, *self._log_V_h_parts
        return 1.0, *self.k.head.gradient(self.k.head.cofactors)

    @lazy
    def _log_V_h_parts(self) -> tuple[list[float], Vector]:
        if self.robot.planar:
            return [], ZERO
        return self.k.head.gradient(self.k.head.inverse)

    @lazy
    def log_V_b1(self) -> float:
        """Logarithm of V_b1 (30), within +-345; -345, or a little more, where V_b1 is 0.

        Near a singular head posture that of the damping's threshold.
        """
        log = self._gram.log
        half = math.log(self.robot.half_length_m)
        if self.robot.planar:
            log -= 4.0 * half
        else:
            log += attitude_log(self.g) - 6.0 * half - 2.0 * self.k.head.log_determinant
        return min(max(log, -_LARGEST_LOG), _LARGEST_LOG)

    @lazy
    def log_V_b1_gradient(self) -> Array:
        """Gradient of log V_b1."""
        n_h = self.k.s.n_h
        gradient = -2.0 * self.log_V_h_gradient
        if n_h:
            gradient[3 : 6 + n_h] += attitude_log_gradient(self.g)
        gradient[6 + n_h :] = self.log_V_b1_by_base
        return gradient

    @lazy
    def log_V_b1_by_base(self) -> Array:
        """Derivative of log V_b1 by the base joint angles, (n_b - 1,): all that (27) needs."""
        return self.k.base.gradient(self._gram.transposed_pseudo_inverse(), 2.0)

    @property
    def V_b1(self) -> float:
        """V_b1 = det(E_tilde E_tilde^T) (30), within 1e-150 .. 1e150."""
        return math.exp(self.log_V_b1)

    @property
    def V_b1_gradient(self) -> Array:
        """Gradient of V_b1."""
        return self.V_b1 * self.log_V_b1_gradient

    @lazy
    def singular_shape(self) -> SingularShape:
        """The singular shape of Fig. 5 that is next, and how near it is."""
        return singular_shape(self.g)

    @lazy
    def support(self) -> Support:
        """Support polygon and d_min (30); its gradient waits, too."""
        return support(self.g)

    @lazy
    def _gram(self) -> GramDeterminant:
        return GramDeterminant(self.k.base.N)

    def _by_head(self, by_joints: list[float], by_turning: Vector) -> Array:
        """Return a gradient by q of what depends on head joints and the base's attitude alone."""
        n_h = self.k.s.n_h
        gradient = np.zeros(self.k.s.n + 5)
        gradient[3:6] = [dot(by_turning, axis) for axis in self.g.attitude_axes]
        gradient[6 : 6 + n_h] = by_joints
        return gradient
