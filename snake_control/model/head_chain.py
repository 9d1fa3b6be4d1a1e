"""The raised head part as a chain that grows from the base: how each head joint moves the base.

All of it is in base coordinates (origin: front end of link n_h + 1, axes: those of that link) and
follows from the head joints alone. A handful of vectors is quicker in plain numbers than in arrays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from snake_control.model.structure import Structure
from snake_control.model.vector import Rows, Twist, Vector, along, combine, cross


class HeadChain(NamedTuple):
    """The head part for given angles of its joints, in base coordinates.

    Attributes:
        pivots: front end of link i + 1, where joint i turns, n_h vectors [m].
        twists: how the base frame moves per velocity of joint i, n_h twists; the angular velocity
            of each is the axis of the joint.
        centers: centres of links 1 .. n_h [m].
        frames: forward, left and up of links 1 .. n_h.
        tip: front end of link 1 [m].
        frame: forward, left and up of link 1, or of the base where there is no head part.
    """

    pivots: list[Vector]
    twists: list[Twist]
    centers: list[Vector]
    frames: list[Rows]
    tip: Vector
    frame: Rows


def head_chain(s: Structure, angles: list[float]) -> HeadChain:
    """Return the head part for the angles of joints 1 .. n_h [rad]."""
    half = s.robot.half_length_m
    joint_axes = s.robot.joint_axes
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    point = (0.0, 0.0, 0.0)
    twists: list[Twist] = []
    pivots, centers, frames = [], [], []
    for joint in range(s.n_h - 1, -1, -1):
        c, si = math.cos(angles[joint]), math.sin(angles[joint])
        pivots.append(point)
        # From link i + 1 forward to link i the joint turns the other way.
        if joint_axes[joint] == "pitch":
            twists.append((cross(point, y), y))
            x, z = combine(c, x, si, z), combine(c, z, -si, x)
        else:
            twists.append((cross(point, z), z))
            x, y = combine(c, x, -si, y), combine(c, y, si, x)
        center = along(point, half, x)
        centers.append(center)
        frames.append((x, y, z))
        point = along(center, half, x)
    return HeadChain(pivots[::-1], twists[::-1], centers[::-1], frames[::-1], point, (x, y, z))


def base_rows(frame: Rows, roll: float, pitch: float, yaw: float) -> tuple[Rows, Vector]:
    """Return the rotation matrix of the base frame in the world by rows, and the axis of P.

    Row i is the world's axis i in base coordinates: head attitude times the inverse of ``frame``.
    """
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    x, y, z = frame
    raised = combine(sr, y, cr, z)
    # The head's axes but for its yaw: R_y(P) R_x(R).
    ahead, left, up = (
        combine(cp, x, sp, raised),
        combine(cr, y, -sr, z),
        combine(cp, raised, -sp, x),
    )
    return (combine(cy, ahead, -sy, left), combine(sy, ahead, cy, left), up), left
