"""How near the body is to a singular shape (Fig. 5), and to which of the two.

The wheel axes of the base part are lines on the floor. The robot is singular where all of them are
parallel, or meet in one point: then the whole body can slide or turn as one rigid piece and no
wheel resists. Such a motion [v_x, v_y, omega] is a null vector of ``lateral_map``, and the motion
that the wheels resist least is its right singular vector of the smallest singular value.
"""

from __future__ import annotations

import dataclasses
import enum
import math

import numpy as np
from numpy.typing import NDArray

from snake_control.model.constraints import lateral_map
from snake_control.model.geometry import PlanarBase

Array = NDArray[np.float64]

SINGULAR_ABOVE = 0.95
"""A nearness above this is called singular. On the perfect plant the paper's Case 1 rises to 0.99;
Cases 2 and 3 stay below 0.91."""

# Axes that meet further away than this many times the extent of the wheels count as parallel.
_FAR = 10.0


class ShapeKind(enum.StrEnum):
    """The two singular shapes of Fig. 5."""

    PARALLEL = "parallel"
    ARC = "arc"


@dataclasses.dataclass(frozen=True)
class SingularShape:
    """The singular shape next to a posture.

    Attributes:
        nearness: 0..1, without unit; 1 where the wheel axes are all parallel or meet in one point.
            It is 1 - sqrt(3 lambda_min / trace) of the Gram matrix of ``lateral_map``, velocities
            taken at the centroid of the wheeled links and omega scaled by their rms distance from
            it: neither place, heading nor size of the robot changes it.
        kind: which shape; it says something when ``nearness`` is high.
        center: point in which the axes (nearly) meet, in base coordinates, (x, y) [m]; at infinity
            if they are parallel.
    """

    nearness: float
    kind: ShapeKind
    center: tuple[float, float]

    @property
    def is_singular(self) -> bool:
        """Whether ``nearness`` is above ``SINGULAR_ABOVE``."""
        return self.nearness > SINGULAR_ABOVE


def singular_shape(g: PlanarBase) -> SingularShape:
    """Return how near the base part is to a singular shape of Fig. 5.

    Args:
        g: posture of the base part. With fewer than three wheeled links every one is singular.
    """
    matrix, centroid, extent = resistance(g)
    values, vectors = np.linalg.eigh(matrix)
    # Round-off leaves the smallest eigenvalue of a singular matrix a little off zero.
    nearness = 1.0 - math.sqrt(max(0.0, 3.0 * float(values[0] / values.sum())))
    v_x, v_y, turn = vectors[:, 0].tolist()
    if abs(turn) * _FAR < math.hypot(v_x, v_y):
        return SingularShape(nearness, ShapeKind.PARALLEL, (math.inf, math.inf))
    arm = extent / turn
    center = (float(centroid[0]) - v_y * arm, float(centroid[1]) + v_x * arm)
    return SingularShape(nearness, ShapeKind.ARC, center)


def smallest_extent(g: PlanarBase) -> float:
    """Return what ``resistance`` takes for the extent of wheels closer together than that [m]."""
    return 1e-6 * g.s.robot.half_length_m


def resistance(g: PlanarBase) -> tuple[Array, Array, float]:
    """Return how the wheels resist rigid motions of the body: a Gram matrix without units.

    Returns:
        Gram matrix of the sideways velocities of the wheeled links per [v_x, v_y, extent omega] of
        a rigid body at their centroid, (3, 3); the centroid in base coordinates, (2,) [m]; and
        the extent, the rms distance of the wheeled links from it [m], but never less than 1e-6 l:
        where all centres coincide, all axes meet there and the posture counts as an arc.
    """
    rows = lateral_map(g)
    centers = g.centers[g.s.wheeled]
    centroid = centers.mean(axis=0)
    offsets = centers - centroid
    extent = math.sqrt(float(np.vdot(offsets, offsets)) / len(offsets))
    extent = max(extent, smallest_extent(g))
    # Of a link under omega about the centroid instead of the base frame.
    rows[:, 2] += rows[:, 0] * centroid[1] - rows[:, 1] * centroid[0]
    rows[:, 2] /= extent
    return rows.T @ rows, centroid, extent
