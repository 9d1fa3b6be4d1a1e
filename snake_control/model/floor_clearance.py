"""How far the raised links stay above the floor, and which way the joints lift them.

The base stands level at wheel height. The rear end of link n_h hangs on the base and does not
count.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from snake_control.model.geometry import Geometry
from snake_control.model.vector import Vector, along, cross


class FloorClearance(NamedTuple):
    """The link that comes lowest.

    Attributes:
        height: of its lowest corner above the floor [m]; infinite of a planar snake.
        link: which, counted from 1; 0 of a planar snake.
        corner: that corner, in base coordinates [m].
    """

    height: float
    link: int
    corner: Vector


def floor_clearance(g: Geometry) -> FloorClearance:
    """Return it for a posture; only its joint angles matter."""
    robot = g.s.robot
    half_width, half_height = 0.5 * robot.link_size_m[0], 0.5 * robot.link_size_m[1]
    # A body that is thicker than its wheels are high lies on the floor all the same.
    under_base = max(robot.wheel_radius_m, half_height)
    found = FloorClearance(math.inf, 0, (0.0, 0.0, 0.0))
    fronts = (g.chain.tip, *g.chain.pivots)
    for link in range(1, g.s.n_h + 1):
        _, left, up = g.chain.frames[link - 1]
        end = fronts[link - 1]
        if link < g.s.n_h and fronts[link][2] < end[2]:
            end = fronts[link]
        height = under_base + end[2] - half_width * abs(left[2]) - half_height * abs(up[2])
        if height < found.height:
            corner = along(end, -math.copysign(half_width, left[2]), left)
            corner = along(corner, -math.copysign(half_height, up[2]), up)
            found = FloorClearance(height, link, corner)
    return found


def floor_clearance_by_head(g: Geometry, lowest: FloorClearance) -> list[float]:
    """Return the derivative of the height of ``lowest`` by each head joint, n_h numbers [m/rad]."""
    by_head = [0.0] * g.s.n_h
    for joint in range(lowest.link, g.s.n_h + 1):
        # Joint i turns all in front of it backwards.
        arm = along(lowest.corner, -1.0, g.chain.pivots[joint - 1])
        by_head[joint - 1] = -cross(g.chain.twists[joint - 1][1], arm)[2]
    return by_head
