"""What a summary says about the configuration of a run."""

from __future__ import annotations

from typing import Any

from snake_control.config import Config


def configuration_parameters(config: Config) -> dict[str, Any]:
    """Return gains, weights and trajectory of a configuration, units in the names."""
    controller, trajectory = config.controller, config.trajectory_generator
    return {
        "K_1_s": list(controller.K),
        "K_p_1_s2": list(controller.K_p),
        "K_v_1_s": list(controller.K_v),
        "preset": controller.preset,
        "head_sub_tasks": dict(
            zip(controller.head_sub_tasks, controller.head_weights, strict=True)
        ),
        "base_sub_tasks": dict(
            zip(controller.base_sub_tasks, controller.base_weights, strict=True)
        ),
        "scp_law": controller.scp_law,
        "a_h": controller.a_h,
        "a_b": controller.a_b,
        "a_prime": controller.a_prime,
        "b_prime_1_m": controller.b_prime,
        "trajectory": trajectory.trajectory,
        "trajectory_start_from": trajectory.start_from,
        "trajectory_velocity_m_s_rad_s": list(trajectory.velocity),
    }
