"""How the demo goes and how it ends, in words and as an exit code; no ROS."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from snake_control.experiment.series import Step

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2

_AFTER_FALL_S = 2.0


@dataclasses.dataclass(frozen=True)
class Outcome:
    """How a run ended: in words, and as an exit code."""

    ended: str
    exit_code: int


def outcome_at(t_s: float, fell_at_s: float | None, duration_s: float, case: int) -> Outcome | None:
    """Return how a run ends at time ``t_s``, ``None`` if it goes on.

    A fall ends it a little later; in Case 1 a fall is what the paper found, and no failure.
    """
    if fell_at_s is not None and t_s >= min(fell_at_s + _AFTER_FALL_S, duration_s):
        return Outcome(
            f"the robot fell at {fell_at_s:.1f} s", EXIT_OK if case == 1 else EXIT_FAILED
        )
    if t_s >= duration_s:
        return Outcome("duration reached", EXIT_OK)
    return None


def progress_text(step: Step, duration_s: float) -> str:
    """Return one line on the newest step."""
    error = step.error
    position_mm = 1e3 * float(np.linalg.norm(error[:3]))
    rotation = float(np.abs(error[3:]).max())
    d_min = step.d_min_true if math.isfinite(step.d_min_true) else step.d_min
    text = (
        f"{step.t_s:5.1f} / {duration_s:g} s   error {position_mm:6.1f} mm {rotation:.3f} rad   "
        f"V_b1 {step.V_b1:8.2e}   d_min {1e3 * d_min:5.1f} mm   bus {step.bus_rate_hz:4.1f} Hz"
    )
    return text if step.status == "tracking" else f"{text}   {step.status}"
