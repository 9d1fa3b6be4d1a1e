"""How the demo goes and how it ends, in words and as an exit code; no ROS."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from snake_control.cli.common import EXIT_FAILED, EXIT_OK
from snake_control.experiment.series import Step

FOLLOWING = ("tracking", "limited", "recovering")
"""Status words of a controller that follows its reference."""

_AFTER_FALL_S = 2.0
_TROUBLE_S = 1.0
_START_S = 5.0

# What the paper's bad case may come to.
_FINDINGS_OF_CASE_1 = ("fault", "error too large")


@dataclasses.dataclass(frozen=True)
class Outcome:
    """How a run ended: in words, and as an exit code."""

    ended: str
    exit_code: int


@dataclasses.dataclass(frozen=True)
class _Trouble:
    """When (by the caller's clock and in the run) and why the controller stopped following."""

    since: float
    since_t_s: float | None
    text: str


class RunJudge:
    """Decides how a run ends, from what the controller says and whether the robot has fallen.

    A fall ends a run a little later. A controller that does not follow its reference for a second
    makes it a failure; a lapse that the end of the run meets gets its second, too. In Case 1 a
    fall, a singular posture and a head left behind are what the paper found, and no failure.
    """

    def __init__(self, duration_s: float, case: int) -> None:
        """Judge a run of a case that shall last ``duration_s``."""
        self._duration_s = duration_s
        self._case = case
        self._trouble: _Trouble | None = None

    def outcome(
        self, now: float, t_s: float | None, fell_at_s: float | None, status: str, text: str
    ) -> Outcome | None:
        """Return how the run ends, ``None`` if it goes on.

        Args:
            now: time of any steady clock [s].
            t_s: time since the reference was first followed [s], ``None`` before.
            fell_at_s: when the robot fell, on the clock of ``t_s``; ``None`` if it stands.
            status, text: what the controller said last.
        """
        if status in FOLLOWING:
            self._trouble = None
        elif self._trouble is None:
            self._trouble = _Trouble(now, t_s, f"{status}: {text}")
        elif t_s is None:
            # Before the start it waits first, for a reason that tells nothing.
            self._trouble = dataclasses.replace(self._trouble, text=f"{status}: {text}")
        duration_s, case = self._duration_s, self._case
        if (
            t_s is not None
            and fell_at_s is not None
            and t_s >= min(fell_at_s + _AFTER_FALL_S, duration_s)
        ):
            return Outcome(
                f"the robot fell at {fell_at_s:.1f} s", EXIT_OK if case == 1 else EXIT_FAILED
            )
        over = t_s is not None and t_s >= duration_s
        trouble = self._trouble
        if trouble is None:
            return Outcome("duration reached", EXIT_OK) if over else None
        since = "" if trouble.since_t_s is None else f" from {trouble.since_t_s:.1f} s on"
        words = f"scp_controller did not follow the reference{since}: {trouble.text}"
        if case == 1 and status in _FINDINGS_OF_CASE_1:
            return Outcome(f"duration reached; {words}", EXIT_OK) if over else None
        if fell_at_s is not None:
            # Whatever the controller makes of a robot that lies.
            return None
        lasting = now - trouble.since > (_START_S if t_s is None else _TROUBLE_S)
        return Outcome(words, EXIT_FAILED) if lasting else None


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
