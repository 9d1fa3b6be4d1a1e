"""The trajectory that a configuration asks for, ready to be sampled."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.trajectory.head_trajectory import HeadTrajectory
from snake_control.trajectory.hold import Hold
from snake_control.trajectory.line import Line

Array = NDArray[np.float64]

ENDLESS_S = 60.0
"""So much of a motion without an end is shown and rehearsed [s]."""


def needs_head(config: TrajectoryGeneratorConfig) -> bool:
    """Return whether the trajectory begins where the head is, so that this must be known."""
    return config.trajectory == "hold" or config.start_from == "head"


def configured_trajectory(
    config: TrajectoryGeneratorConfig, head: ArrayLike | None, start: float = 0.0
) -> HeadTrajectory:
    """Return the configured trajectory.

    Args:
        config: which one.
        head: w of the head at the start, (6,) [m, rad]; read only if ``needs_head``.
        start: time at which it starts [s].

    Raises:
        ValueError: it begins at the head, and ``head`` is ``None``.
    """
    if needs_head(config):
        if head is None:
            raise ValueError("the trajectory begins where the head is: give its pose")
        if config.trajectory == "hold":
            return Hold(head)
        return Line(head, config.velocity, start, config.duration_s)
    return Line(np.array(config.start_pose), config.velocity, start, config.duration_s)


class ConfiguredPlan:
    """The configured line, or the head held, in the form of a plan: to be shown and rehearsed.

    Attributes:
        duration: [s]; some time if it has no end.
        length: of the tip's path in this time [m].
    """

    def __init__(self, config: TrajectoryGeneratorConfig, head: Array) -> None:
        """Plan what ``config`` asks for, with the head at ``head``, (6,)."""
        self._config = config
        self._head = head
        is_line = config.trajectory == "line"
        self.duration = config.duration_s if is_line and config.duration_s > 0.0 else ENDLESS_S
        speed = float(np.linalg.norm(config.velocity[:3])) if is_line else 0.0
        self.length = speed * self.duration

    def made(self) -> Callable[[float], HeadTrajectory]:
        """Return what makes the motion for the time at which it starts [s]."""
        return lambda start: configured_trajectory(self._config, self._head, start)

    def where(self, t: float) -> str:
        """Return an empty text: it has no parts."""
        return ""
