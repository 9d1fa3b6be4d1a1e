"""Index sets of a robot: which rows, columns, joints and links play which part."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig

Indices = NDArray[np.intp]
Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Structure:
    """What follows from a robot's configuration alone; all indices count from 0.

    Attributes:
        robot: the configuration.
        n, n_h, n_b: numbers of links of the whole robot, the head part and the base part. A planar
            snake is all base: n_h = 0.
        m_h, m_b, m: numbers of H-SCPs, B-SCPs and all SCPs.
        w: components of q that make the controlled w: all six, or x, y, Y of a planar snake.
        axes: unit vector of each joint's axis in the frame of the link before it, (n-1, 3).
        wheeled: wheeled base links, counted from the first base link, (n_b - m_b,); one less
            where link 1 of a planar snake is wheelless and gives no B-SCP.
        floor_rows: number of constraint rows of the floor: 3, or 0 for a planar snake.
        head_rows: constraint rows that only head joints enter: the first base link's wheels
            (Assumption 5) and the floor, (4,); none for a planar snake.
        base_rows: the other constraint rows, each with a base joint of its own in theta_b.
        scp_h, scp_b: joints that are H-SCPs and B-SCPs.
        theta_h, theta_b: all other joints of head and base; theta_bar is both in this order (9).
        behind: ``behind[k, a]`` is 1.0 if wheeled link k lies behind base joint a,
            (n_b - m_b, n_b - 1).
        masses: mass of each link, (n,) [kg].
    """

    robot: RobotConfig
    n: int
    n_h: int
    n_b: int
    m_h: int
    m_b: int
    m: int
    w: Indices
    axes: Array
    wheeled: Indices
    floor_rows: int
    head_rows: Indices
    base_rows: slice
    scp_h: Indices
    scp_b: Indices
    theta_h: Indices
    theta_b: Indices
    behind: Array
    masses: Array

    @property
    def theta(self) -> Indices:
        """Joints of theta_bar: all that are no SCPs, rising (9)."""
        return np.concatenate((self.theta_h, self.theta_b))

    @property
    def scp(self) -> Indices:
        """Joints of phi_tilde: H-SCPs, then B-SCPs."""
        return np.concatenate((self.scp_h, self.scp_b))


@functools.lru_cache(maxsize=64)
def structure(robot: RobotConfig) -> Structure:
    """Return the index sets of ``robot`` (computed once for each configuration)."""
    n, n_h = robot.links, robot.head_links
    n_b = n - n_h
    joints = np.arange(n - 1)
    scp_h = np.array(robot.head_scp_joints, dtype=np.intp) - 1
    scp_b = np.array(robot.base_scp_joints, dtype=np.intp) - 1
    free = np.setdiff1d(joints, np.concatenate((scp_h, scp_b)))
    wheeled = np.array(robot.wheeled_links, dtype=np.intp) - n_h - 1
    unit = {"pitch": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}
    wheels = len(wheeled)
    return Structure(
        robot=robot,
        n=n,
        n_h=n_h,
        n_b=n_b,
        m_h=len(scp_h),
        m_b=len(scp_b),
        m=len(scp_h) + len(scp_b),
        w=np.array(robot.controlled, dtype=np.intp),
        axes=np.array([unit[axis] for axis in robot.joint_axes]),
        wheeled=wheeled,
        floor_rows=0 if robot.planar else 3,
        head_rows=(np.arange(0) if robot.planar else np.concatenate(([0], wheels + np.arange(3)))),
        base_rows=slice(0 if robot.planar else 1, wheels),
        scp_h=scp_h,
        scp_b=scp_b,
        theta_h=free[free < n_h],
        theta_b=free[free >= n_h],
        behind=(wheeled[:, None] > np.arange(n_b - 1)[None, :]).astype(float),
        masses=np.array(robot.link_mass_kg),
    )
