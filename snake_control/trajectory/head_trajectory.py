"""The seam between whatever plans the head's motion and whatever sends references."""

from __future__ import annotations

from typing import Protocol

from snake_control.control.reference import Reference


class HeadTrajectory(Protocol):
    """A motion of the head in time.

    Pose and rate are those of w = [x_h, y_h, z_h, R, P, Y] [m, rad]: attitude as roll, pitch, yaw
    with their rates, continuous (no jumps by whole turns).
    """

    def sample(self, t: float) -> Reference:
        """Return pose and rate at time ``t`` [s], the clock being the maker's.

        Times are asked for in rising order; a time before the last one gives that one's answer
        where the motion depends on what happened in between.
        """
