"""The gains with which a study tries choices of SCPs."""

from __future__ import annotations

import dataclasses

from snake_control.config import ControllerConfig
from snake_control.config.presets import PRESETS

# What preset and case say where nothing else does.
_COMPOSED = (
    "head_sub_tasks",
    "head_weights",
    "base_sub_tasks",
    "base_weights",
    "a_h",
    "a_b",
    "a_prime",
    "b_prime",
    "scp_law",
)


def scale_free(controller: ControllerConfig) -> ControllerConfig:
    """Return a controller with the preset ``scale_free`` in place of the paper's gains.

    V_h and V_b1 change their scale with every wheelless link: with one weight for all, a study
    would compare weights, not choices. A list of sub-tasks that is no preset's stays as it is.
    """
    case = PRESETS[controller.preset][controller.case]
    if controller.preset == "scale_free" or (
        (controller.head_sub_tasks, controller.base_sub_tasks)
        != (tuple(case.head), tuple(case.base))
    ):
        return controller
    return dataclasses.replace(
        controller,
        preset="scale_free",
        **dict.fromkeys(_COMPOSED),  # type: ignore[arg-type]
    )


def gains_text(controller: ControllerConfig) -> str:
    """Say in one line which gains these are."""
    parts = []
    for part, gain, names, weights in (
        ("head", controller.a_h, controller.head_sub_tasks, controller.head_weights),
        ("base", controller.a_b, controller.base_sub_tasks, controller.base_weights),
    ):
        tasks = (f"{n} {gain * w:g}" for n, w in zip(names, weights, strict=True) if gain * w)
        parts.append(f"{part} {', '.join(tasks) or 'none'}")
    return f"preset {controller.preset}: {'; '.join(parts)}; law {controller.scp_law}"
