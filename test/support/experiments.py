"""Series made up by formulas, whose summaries are known without computing them."""

from __future__ import annotations

from typing import Any

import numpy as np

from snake_control.config import RobotConfig
from snake_control.experiment.series import Step

# A robot unlike the paper's: 16 links, 6 of them head, two H-SCPs, four wheelless links.
LONG_ROBOT = RobotConfig(
    links=16,
    head_links=6,
    wheelless_links=(8, 10, 12, 14),
    head_scp_joints=(2, 3),
    joint_axes=("pitch", "yaw", "pitch", "yaw", "pitch", "pitch") + ("yaw",) * 9,
    start_joint_angles_rad=(-0.1, 0.0, 0.0, 0.0, 0.5, 0.6) + (0.3, -0.3) * 4 + (0.2,),
)


def step(robot: RobotConfig, t_s: float, **changes: Any) -> Step:
    """One uneventful control step on the reference; ``changes`` replace fields."""
    w_d = np.array([0.01 * t_s, 0.0, 0.2, 0.4, 0.4, 0.0])
    phi = np.array(robot.start_joint_angles_rad)
    fields: dict[str, Any] = {
        "t_s": t_s,
        "status": "tracking",
        "w_measured": w_d,
        "w_d": w_d,
        "phi_measured": phi,
        "u_unlimited": np.zeros(robot.joints),
        "u": np.zeros(robot.joints),
        "phi_tilde_dot_d": np.zeros(len(robot.scp_joints)),
        "speed_scale": 1.0,
        "speed_limited": (),
        "range_limited": (),
        "V_h": 6e-7,
        "V_b1": 2e8,
        "d_min": 0.03,
        "sigma_min_B_tilde": 0.1,
        "sigma_min_A_hat": 0.2,
        "damping": 0.0,
        "singular_nearness": 0.6,
        "singular_shape": "arc",
        "w": w_d,
        "phi": phi,
        "d_min_true": 0.03,
        "slip": np.zeros(len(robot.wheeled_links)),
    }
    return Step(**(fields | changes))
