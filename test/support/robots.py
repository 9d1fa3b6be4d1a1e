"""Robots and postures that tests use beside the paper's robot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from snake_control.config import RobotConfig

REFERENCE = Path(__file__).parent.parent / "reference"
CONFIG = Path(__file__).parent.parent.parent / "config"

PAPER = RobotConfig()

ROBOTS = {
    "paper": PAPER,
    "fig_2": RobotConfig(wheelless_links=(7, 9, 10)),
    "one wheelless link": RobotConfig(wheelless_links=(9,)),
    "minimal head": RobotConfig(
        links=13,
        head_links=4,
        wheelless_links=(6, 9),
        head_scp_joints=(0,),
        joint_axes=("yaw", "pitch", "yaw", "pitch") + ("yaw",) * 8,
        start_joint_angles_rad=(0.0,),
    ),
    "long head, two H-SCPs": RobotConfig(
        links=16,
        head_links=6,
        wheelless_links=(9, 12, 15),
        head_scp_joints=(2, 4),
        joint_axes=("yaw", "pitch", "pitch", "yaw", "pitch", "pitch") + ("yaw",) * 9,
        half_length_m=0.05,
        wheel_offset_m=0.04,
        wheel_radius_m=0.03,
        link_mass_kg=tuple(0.05 + 0.01 * i for i in range(16)),
        start_joint_angles_rad=(0.0,),
    ),
    "many links": RobotConfig(
        links=30,
        wheelless_links=(7, 9, 11),
        joint_axes=("pitch", "yaw", "pitch", "yaw", "pitch") + ("yaw",) * 24,
        start_joint_angles_rad=(0.0,),
    ),
    "planar": RobotConfig(
        links=10,
        head_links=0,
        wheelless_links=(1, 4, 7),
        head_scp_joints=(0,),
        joint_axes=("yaw",) * 9,
        start_joint_angles_rad=(0.0,),
    ),
    "planar, two wheelless links in front": RobotConfig(
        links=13,
        head_links=0,
        wheelless_links=(1, 2, 6, 7, 11),
        head_scp_joints=(0,),
        joint_axes=("yaw",) * 12,
        half_length_m=0.05,
        wheel_offset_m=0.04,
        wheel_radius_m=0.03,
        link_mass_kg=tuple(0.05 + 0.01 * i for i in range(13)),
        start_joint_angles_rad=(0.0,),
    ),
}


def random_q(robot: RobotConfig, seed: int) -> np.ndarray:
    """A posture away from singularities, base not necessarily level (gradients hold anywhere).

    A planar snake lies on the floor.
    """
    rng = np.random.default_rng(seed)
    q = rng.uniform(-0.6, 0.6, robot.links + 5)
    if robot.planar:
        q[2:5] = (robot.wheel_radius_m, 0.0, 0.0)
    q[6 : 6 + robot.head_links] += 0.3 * np.sign(q[6 : 6 + robot.head_links])
    return q


def paper_states() -> list[dict]:
    """The reference states of the paper's robot, from an independent implementation."""
    cases = json.loads((REFERENCE / "paper_states.json").read_text())["cases"]
    return [state for case in cases for state in case["states"]]
