"""The links as bodies: how low the raised head part comes, and how near the robot comes to itself.

Each link is the box of ``robot.link_size_m``; for its distance to others a round bar about its
centre line, as thick as the box is wide, or out to the wheels where it has some.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.model.geometry import in_plane, planar_base
from snake_control.model.structure import structure

Array = NDArray[np.float64]

_STRAIGHT = 0.9
"""Share of the distance that two links have in a straight robot which counts as free."""


class Bodies:
    """The links of a robot whose base stands level on the floor.

    Attributes:
        centers: of links 1 .. n, z above the floor, (n, 3) [m]; the origin is below the front end
            of link n_h + 1.
        frames: rotation matrix of each link, columns its forward, left and up, (n, 3, 3).
    """

    def __init__(self, robot: RobotConfig, phi: ArrayLike) -> None:
        """Work them out for joint angles phi, (n-1,) [rad]."""
        self._robot = robot
        s = structure(robot)
        angles = np.asarray(phi, dtype=float)
        base = planar_base(s, angles[s.n_h :])
        self.centers = np.zeros((s.n, 3))
        self.frames = np.zeros((s.n, 3, 3))
        self.centers[s.n_h :, :2] = in_plane(base.middles)
        self.frames[s.n_h :, :2, 0] = in_plane(base.forward)
        self.frames[s.n_h :, :2, 1] = in_plane(1j * base.forward)
        self.frames[s.n_h :, 2, 2] = 1.0
        frame, front = np.eye(3), np.zeros(3)
        for link in range(s.n_h - 1, -1, -1):
            # From link i + 1 forward to link i the joint turns the other way.
            frame = frame @ _turn(robot.joint_axes[link], -float(angles[link]))
            along = robot.half_length_m * frame[:, 0]
            self.frames[link] = frame
            self.centers[link] = front + along
            front = front + 2.0 * along
        self.centers[:, 2] += robot.wheel_radius_m

    @property
    def ground_clearance(self) -> float:
        """How far the head part stays above the floor [m]; infinite of a planar snake.

        Bodies of the base part count as above it, at whatever height the configuration puts them.
        """
        head = self._robot.head_links
        if head == 0:
            return math.inf
        width, height = self._robot.link_size_m
        half_sizes = np.array((self._robot.half_length_m, 0.5 * width, 0.5 * height))
        down = np.abs(self.frames[:head, 2, :]).dot(half_sizes)
        floor = min(0.0, self._robot.wheel_radius_m - 0.5 * height)
        return float((self.centers[:head, 2] - down).min()) - floor

    @property
    def self_clearance(self) -> float:
        """Distance of the two links that are nearest to touching each other, less their sizes [m].

        Neighbours are left out: how far they may turn is what the joints' ranges say. So near as
        all are in a straight robot is free.
        """
        first, second, least = _pairs(self._robot)
        half = self._robot.half_length_m
        forward = self.frames[:, :, 0]
        apart = self.centers[first] - self.centers[second]
        by_first, by_second = forward[first], forward[second]
        b = np.sum(by_first * by_second, axis=1)
        c = np.sum(by_first * apart, axis=1)
        f = np.sum(by_second * apart, axis=1)
        # The nearest points of the two lines; of parallel ones, beside the first link's middle.
        across = 1.0 - b * b
        lines = np.where(across > 1e-9, (b * f - c) / np.maximum(across, 1e-9), 0.0)
        s = np.clip(lines, -half, half)
        t = np.clip(b * s + f, -half, half)
        s = np.clip(b * t - c, -half, half)
        between = apart + s[:, None] * by_first - t[:, None] * by_second
        return float((np.linalg.norm(between, axis=1) - least).min())


def _turn(axis: str, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    if axis == "pitch":
        return np.array(((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)))
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


@functools.lru_cache(maxsize=16)
def _pairs(robot: RobotConfig) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Return pairs of links that are no neighbours, and how far apart their middles must be."""
    thickness = np.full(robot.links, 0.5 * max(robot.link_size_m))
    wheeled = np.array(robot.wheeled_links) - 1
    thickness[wheeled] = np.maximum(thickness[wheeled], robot.wheel_offset_m)
    first, second = np.triu_indices(robot.links, k=2)
    straight = 2.0 * robot.half_length_m * (second - first - 1)
    return first, second, np.minimum(thickness[first] + thickness[second], _STRAIGHT * straight)
