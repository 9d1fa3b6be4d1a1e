"""What ``pose_input`` says of itself: its status, and the same for /diagnostics."""

from __future__ import annotations

import dataclasses
import math

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from snake_interfaces.msg import PoseStatus

from snake_control.control.head_filter import Reason
from snake_control.control.head_prediction import Prediction
from snake_control.control.pose_hypotheses import Cause
from snake_control.control.pose_intake import PoseIntake
from snake_control.nodes.conversions import diagnostic_status, header

NUMBER_OF_REASON = {
    Reason.NOT_FINITE: PoseStatus.REASON_NOT_FINITE,
    Reason.TOO_FAR: PoseStatus.REASON_TOO_FAR,
    Reason.NOT_A_ROTATION: PoseStatus.REASON_NOT_A_ROTATION,
    Reason.UNSTAMPED: PoseStatus.REASON_UNSTAMPED,
    Reason.AHEAD_OF_CLOCK: PoseStatus.REASON_AHEAD_OF_CLOCK,
    Reason.WRONG_FRAME: PoseStatus.REASON_WRONG_FRAME,
    Reason.NOT_TRACKED: PoseStatus.REASON_NOT_TRACKED,
    Reason.JUMP: PoseStatus.REASON_JUMP,
    Reason.FROZEN: PoseStatus.REASON_FROZEN,
}
"""In the order of ``rejected_by_reason``."""

_STATUS_NAMES = {
    PoseStatus.STATUS_WAITING: "WAITING",
    PoseStatus.STATUS_VALID: "VALID",
    PoseStatus.STATUS_STALE: "STALE",
    PoseStatus.STATUS_INVALID: "INVALID",
    PoseStatus.STATUS_PREDICTED: "PREDICTED",
}
_LEVELS = {
    PoseStatus.STATUS_WAITING: DiagnosticStatus.WARN,
    PoseStatus.STATUS_VALID: DiagnosticStatus.OK,
    PoseStatus.STATUS_STALE: DiagnosticStatus.ERROR,
    PoseStatus.STATUS_INVALID: DiagnosticStatus.ERROR,
    PoseStatus.STATUS_PREDICTED: DiagnosticStatus.WARN,
}
_NUMBER_OF_CAUSE = {
    Cause.NOTHING: PoseStatus.SUSPICION_NONE,
    Cause.WRONG_DIRECTION: PoseStatus.SUSPICION_WRONG_DIRECTION,
    Cause.SWAPPED_JOINTS: PoseStatus.SUSPICION_SWAPPED_JOINTS,
    Cause.WRONG_MARKER_OFFSET: PoseStatus.SUSPICION_WRONG_MARKER_OFFSET,
    Cause.WHEEL_SLIP: PoseStatus.SUSPICION_WHEEL_SLIP,
}


@dataclasses.dataclass(frozen=True)
class Verdict:
    """How far the head pose can be trusted at one time.

    Attributes:
        status, reason: numbers of PoseStatus.
        text: both in words.
        remarks: what else is amiss; empty if nothing is.
        prediction: in force at that time, ``None`` if there is none.
        cause: what seems to be wrong when poses and joints are compared.
        suspicion: the same in words.
    """

    status: int
    reason: int
    text: str
    remarks: str = ""
    prediction: Prediction | None = None
    cause: Cause = Cause.NOTHING
    suspicion: str = "poses and joints are not compared"

    @property
    def words(self) -> str:
        """Text and remarks."""
        return f"{self.text}; {self.remarks}" if self.remarks else self.text


def status_message(
    verdict: Verdict,
    intake: PoseIntake,
    now_ns: int,
    frame_id: str,
    rate: float,
    publishers: int,
    gaps_bridged: int,
) -> PoseStatus:
    """Return the status at ``now_ns``."""
    estimate = intake.estimate
    refused = [intake.refused[reason] for reason in NUMBER_OF_REASON]
    predicted = verdict.prediction
    return PoseStatus(
        header=header(now_ns, frame_id),
        status=verdict.status,
        reason=verdict.reason,
        text=verdict.words,
        age=math.inf if estimate is None else (now_ns - estimate.stamp_ns) * 1e-9,
        accepted=intake.accepted,
        rejected=sum(refused),
        out_of_order=intake.refused[Reason.OUT_OF_ORDER],
        repeated=intake.refused[Reason.REPEATED],
        rejected_by_reason=refused,
        pauses=intake.pauses,
        new_places=intake.new_places,
        longest_pause=intake.longest_pause_s,
        rate=rate,
        position_noise=intake.noise_m,
        clock_offset=intake.clock.offset_s,
        clock_drift=intake.clock.drift_s,
        publishers=publishers,
        predicted_for=predicted.age_s if predicted else 0.0,
        predicted_position_std=predicted.position_std_m if predicted else 0.0,
        predicted_attitude_std=predicted.attitude_std_rad if predicted else 0.0,
        gaps_bridged=gaps_bridged,
        suspicion=_NUMBER_OF_CAUSE[verdict.cause],
        suspicion_text=verdict.suspicion,
    )


def diagnostics(
    status: PoseStatus, verdict: Verdict, intake: PoseIntake, topic: str
) -> DiagnosticArray:
    """Return a status as diagnostics; a warning where only remarks or suspicion say something."""
    level, words = _LEVELS[verdict.status], verdict.words
    if verdict.cause is not Cause.NOTHING:
        words = f"{words}; {verdict.suspicion}"
    if verdict.remarks or verdict.cause is not Cause.NOTHING:
        level = max(level, DiagnosticStatus.WARN)
    counts = {f"refused: {reason.value}": str(intake.refused[reason]) for reason in Reason}
    return DiagnosticArray(
        header=status.header,
        status=[
            diagnostic_status(
                "pose_input: head pose",
                topic,
                level[0],
                words,
                {
                    "status": _STATUS_NAMES[verdict.status],
                    "age [s]": f"{status.age:.3f}",
                    "rate [Hz]": f"{status.rate:.1f}",
                    "position noise [mm]": f"{1e3 * status.position_noise:.3f}",
                    "least age on arrival [ms]": f"{1e3 * status.clock_offset:.1f}",
                    "its change [ms]": f"{1e3 * status.clock_drift:.2f}",
                    "publishers": str(status.publishers),
                    "accepted": str(status.accepted),
                    **counts,
                    "pauses": str(status.pauses),
                    "longest pause [s]": f"{status.longest_pause:.2f}",
                    "new places": str(status.new_places),
                    "gaps bridged": str(status.gaps_bridged),
                    "pose against joints": verdict.suspicion,
                },
            )
        ],
    )
