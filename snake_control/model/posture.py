"""One posture and every quantity the controllers ask of it, each worked out once, when needed."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.model.geometry import Geometry, geometry
from snake_control.model.manipulability import V_h
from snake_control.model.redundancy import Kinematics, kinematics
from snake_control.model.singular_shape import SingularShape, singular_shape
from snake_control.model.singularity import log_V_b1
from snake_control.model.stability import Support, support

Array = NDArray[np.float64]


class Posture:
    """What cost functions and control laws read; gradients are by q, (n + 5,) each.

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
            ModelError: wrong shape, or not finite.
        """
        self.robot = robot
        self.g: Geometry = geometry(robot, q)
        self.k: Kinematics = kinematics(self.g)

    @functools.cached_property
    def _V_h(self) -> tuple[float, Array]:
        return V_h(self.g, self.k)

    @functools.cached_property
    def _log_V_b1(self) -> tuple[float, Array]:
        return log_V_b1(self.g, self.k, self.V_h_gradient / self.V_h, self.V_h)

    @property
    def V_h(self) -> float:
        """Manipulability of the head part (29)."""
        return self._V_h[0]

    @property
    def V_h_gradient(self) -> Array:
        """Gradient of V_h."""
        return self._V_h[1]

    @property
    def log_V_b1(self) -> float:
        """Logarithm of V_b1 (30); -inf in a singular posture."""
        return self._log_V_b1[0]

    @property
    def log_V_b1_gradient(self) -> Array:
        """Gradient of log V_b1; zero in a singular posture."""
        return self._log_V_b1[1]

    @functools.cached_property
    def V_b1(self) -> float:
        """V_b1 = det(E_tilde E_tilde^T) (30); infinite where it leaves the range of doubles."""
        with np.errstate(over="ignore"):
            return float(np.exp(self.log_V_b1))

    @property
    def V_b1_gradient(self) -> Array:
        """Gradient of V_b1; not finite where V_b1 is infinite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.V_b1 * self.log_V_b1_gradient

    @functools.cached_property
    def singular_shape(self) -> SingularShape:
        """The singular shape of Fig. 5 that is next, and how near it is."""
        return singular_shape(self.g)

    @functools.cached_property
    def support(self) -> Support:
        """Support polygon and d_min (30); its gradient waits, too."""
        return support(self.g)
