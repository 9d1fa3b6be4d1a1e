"""The trajectory that a configuration asks for, ready to be sampled."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.trajectory.head_trajectory import HeadTrajectory
from snake_control.trajectory.hold import Hold
from snake_control.trajectory.line import Line


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
