"""What a sub-task is: a cost of the posture that the shape controllable points shall raise."""

from __future__ import annotations

import abc

import numpy as np
from numpy.typing import NDArray

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.model.posture import Posture

Array = NDArray[np.float64]


class SubTask(abc.ABC):
    """A cost V(q) with its gradient; the SCPs move so that V rises (25), (27).

    Derive from it, give the class's name as ``package.module:Class`` in
    ``controller.head_sub_tasks`` or ``controller.base_sub_tasks``, and it is one
    (docs/sub_tasks.md). One object serves one robot and controller; it keeps no state between
    postures. In a posture where the gradient is not finite the sub-task is left out.

    Attributes:
        robot, controller: the configuration.
    """

    def __init__(self, robot: RobotConfig, controller: ControllerConfig) -> None:
        """Prepare for a robot; override to work out what does not change with the posture.

        Raises:
            ConfigError: the configuration lacks something that the sub-task needs.
        """
        self.robot = robot
        self.controller = controller

    @abc.abstractmethod
    def value(self, posture: Posture) -> float:
        """Return V: higher is better."""

    @abc.abstractmethod
    def gradient(self, posture: Posture) -> Array:
        """Return the derivative of V by q = [w, phi_1 .. phi_(n-1)], (n + 5,).

        Of it the composition reads the head joints for ``head_sub_tasks``, the base joints for
        ``base_sub_tasks``.
        """

    def by_head(self, posture: Posture) -> Array:
        """Return the part of ``gradient`` by phi_1 .. phi_(n_h), (n_h,).

        Worth overriding only where that part alone costs less.
        """
        return self.gradient(posture)[6 : 6 + posture.k.s.n_h]

    def by_base(self, posture: Posture) -> Array:
        """Return the part of ``gradient`` by phi_(n_h+1) .. phi_(n-1), (n_b - 1,); the same."""
        return self.gradient(posture)[6 + posture.k.s.n_h :]
