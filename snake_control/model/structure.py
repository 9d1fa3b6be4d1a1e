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
class BaseStructure:
    """What the base part's matrices are made of; its links and joints are counted from 0.

    Link k turns with joint k in front of it; "joint" 0 is the turning of the first base link. The
    columns of the matrices are what the base part follows: e ways in which its first link may
    move, then the B-SCPs. The wheels of the first link leave two ways: forward at l m/s, and
    turning at 1 rad/s about the wheels, which moves the front end sideways at l m/s. A planar
    snake's first link has no wheels and three: forward and sideways at l m/s, and turning about
    its front end.

    Attributes:
        entries: e, 2 or 3.
        entry_rows: which combination of those ways a twist of the base frame is, (e, 6).
        turned_entry_velocity: i (v_x + i v_y) of the first link's front end for each column,
            (e + m_b,).
        driven: 1.0 for each link whose wheels decide the joint in front of it, else 0.0, (n_b, 1).
        given: diagonal matrix with 1.0 for all others, whose joints are known beforehand,
            (n_b, n_b).
        known: what is known of them: velocity of each joint (second index) for each column (first),
            (e + m_b, n_b).
        rightward: -i l for each driven link, else 0 [m], (n_b,): turns its forward direction
            into its right.
        wheel_links: link of each wheel: all left wheels, then all right ones.
        mass: share of the robot's mass of each link, (n_b,).
    """

    entries: int
    entry_rows: Array
    turned_entry_velocity: NDArray[np.complex128]
    driven: Array
    given: Array
    known: Array
    rightward: NDArray[np.complex128]
    wheel_links: list[int]
    mass: Array


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
        head_joints, head_scps: theta_h and scp_h as plain numbers.
        scp: joints of phi_tilde: H-SCPs, then B-SCPs.
        theta_h, theta_b: all other joints of head and base.
        theta: theta_bar, both of them, rising (9).
        behind: ``behind[k, a]`` is 1.0 if wheeled link k lies behind base joint a,
            (n_b - m_b, n_b - 1).
        masses: mass of each link, (n,) [kg].
        head_mass: share of the robot's mass of each head link, n_h numbers.
        base: index sets of the base part.
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
    head_joints: list[int]
    head_scps: list[int]
    scp: Indices
    theta_h: Indices
    theta_b: Indices
    theta: Indices
    behind: Array
    masses: Array
    head_mass: tuple[float, ...]
    base: BaseStructure


@functools.lru_cache(maxsize=64)
def structure(robot: RobotConfig) -> Structure:
    """Return the index sets of ``robot`` (computed once for each configuration)."""
    n, n_h = robot.links, robot.head_links
    n_b = n - n_h
    joints = np.arange(n - 1)
    scp_h = np.array(robot.head_scp_joints, dtype=np.intp) - 1
    scp_b = np.array(robot.base_scp_joints, dtype=np.intp) - 1
    scp = np.concatenate((scp_h, scp_b))
    free = np.setdiff1d(joints, scp)
    theta_h, theta_b = free[free < n_h], free[free >= n_h]
    wheeled = np.array(robot.wheeled_links, dtype=np.intp) - n_h - 1
    wheels = len(wheeled)
    base_rows = slice(0 if robot.planar else 1, wheels)
    head_rows = np.arange(0) if robot.planar else np.concatenate(([0], wheels + np.arange(3)))
    behind = (wheeled[:, None] > np.arange(n_b - 1)[None, :]).astype(float)
    masses = np.array(robot.link_mass_kg)
    w = np.array(robot.controlled, dtype=np.intp)
    unit = {"pitch": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}
    return Structure(
        robot=robot,
        n=n,
        n_h=n_h,
        n_b=n_b,
        m_h=len(scp_h),
        m_b=len(scp_b),
        m=len(scp),
        w=w,
        axes=np.array([unit[axis] for axis in robot.joint_axes]),
        wheeled=wheeled,
        floor_rows=0 if robot.planar else 3,
        head_rows=head_rows,
        base_rows=base_rows,
        scp_h=scp_h,
        scp_b=scp_b,
        head_joints=theta_h.tolist(),
        head_scps=scp_h.tolist(),
        scp=scp,
        theta_h=theta_h,
        theta_b=theta_b,
        theta=np.concatenate((theta_h, theta_b)),
        behind=behind,
        masses=masses,
        head_mass=tuple((masses[:n_h] / masses.sum()).tolist()),
        base=_base(robot, wheeled, wheeled[base_rows], scp_b - n_h),
    )


def _base(
    robot: RobotConfig, wheeled: Indices, driven_links: Indices, scp: Indices
) -> BaseStructure:
    half = robot.half_length_m
    n_b = robot.links - robot.head_links
    entries = 3 if robot.planar else 2
    entry_rows = np.diag((1 / half, 1 / half, 0.0, 0.0, 0.0, 1.0))
    velocity = np.zeros(entries + len(scp), dtype=complex)
    velocity[:2] = 1j * half, -half
    known = np.zeros((entries + len(scp), n_b))
    known[entries - 1, 0] = 1.0
    known[entries + np.arange(len(scp)), scp + 1] = 1.0
    driven = np.zeros(n_b)
    driven[driven_links] = 1.0
    rightward = np.zeros(n_b, dtype=complex)
    rightward[driven_links] = -1j * half
    share = np.array(robot.link_mass_kg) / sum(robot.link_mass_kg)
    mass = share[robot.head_links :]
    return BaseStructure(
        entries=entries,
        entry_rows=entry_rows[[0, 1, 5] if robot.planar else [0, 5]],
        turned_entry_velocity=velocity,
        driven=driven[:, None],
        given=np.diag(1.0 - driven),
        known=known,
        rightward=rightward,
        wheel_links=2 * wheeled.tolist(),
        mass=mass,
    )
