"""Decides when a gap of motion capture is bridged by the joints, and how poses are taken up again.

A gap begins when poses are missing for longer than usual, and joint states are newer than the last
one by a good part of its time-out, so that nobody who waits for that long has to stop. It ends with
the next good pose, or where the predictor ends it. Poses that are refused because they speak
against their source (a jump, another frame, no numbers) are not bridged: then nobody knows where
the head is.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from snake_control.config import PoseInputConfig, RobotConfig
from snake_control.control.head_filter import HeadEstimate, Reason
from snake_control.control.head_prediction import HeadPredictor, Prediction, PredictionLimits

_BEHIND = 0.3
"""A pose that is older than a joint state by more than this share of its time-out is missed."""
_LATE_INTERVALS = 1.2
_LEAST_SILENCE = 0.25
"""Poses are missing after so many usual intervals, and this share of the time-out."""
_GAIN = 0.1

_ABSENT = (Reason.NOT_TRACKED, Reason.FROZEN, Reason.REPEATED, Reason.OUT_OF_ORDER)
"""A pose refused for these says no more than that the body was not seen."""


class PoseBridge:
    """Bridges gaps between measured poses.

    Attributes:
        prediction: the newest one since the last good pose, ``None`` if there is none.
        gaps: how many were bridged.
    """

    def __init__(
        self, robot: RobotConfig, config: PoseInputConfig, future_tolerance_s: float
    ) -> None:
        """Begin without poses and joints.

        Args:
            robot: whose joints these are.
            config: time-out and noise of the poses, and for how long to bridge.
            future_tolerance_s: how far ahead of this computer's clock a stamp may be.
        """
        self._timeout_ns = round(config.timeout_s * 1e9)
        self._tolerance_ns = round(future_tolerance_s * 1e9)
        self._predictor = HeadPredictor(
            robot,
            PredictionLimits(
                bridge_s=config.bridge_s,
                position_std_m=config.position_noise_m,
                attitude_std_rad=config.rotation_noise_rad,
            ),
        )
        self._per_s = 1.0 / config.timeout_s
        self.gaps = 0
        self.reset()

    def reset(self) -> None:
        """Forget everything, for a clock that was set back."""
        self._predictor.reset()
        self._measured: HeadEstimate | None = None
        self._arrived_ns = 0
        self._interval_ns = 0.0
        self._contradicted = False
        self.prediction: Prediction | None = None

    def joints(
        self, stamp_ns: int, phi: np.ndarray, phi_dot: np.ndarray, now_ns: int
    ) -> Prediction | None:
        """Take one joint state.

        Args:
            stamp_ns: when the joints were read [ns].
            phi, phi_dot: angles and velocities of all joints, (n-1,) [rad, rad/s].
            now_ns: time of its arrival by this computer's clock [ns].

        Returns:
            The head at ``stamp_ns``, with the covariance of a prediction, if poses are missing, it
            can be predicted, and it is newer than what was predicted before; ``None`` otherwise.

        Raises:
            ModelError: wrong shape or not finite.
        """
        if not -self._tolerance_ns <= now_ns - stamp_ns <= self._timeout_ns:
            return None
        self._predictor.joints(stamp_ns, phi, phi_dot)
        newest = self._measured if self.prediction is None else self.prediction.estimate
        if newest is None or stamp_ns <= newest.stamp_ns or not self._missing(stamp_ns, now_ns):
            return None
        answer = self._predictor.predict(stamp_ns)
        if not isinstance(answer, Prediction):
            return None
        if self.prediction is None:
            self.gaps += 1
        self.prediction = self._with_covariance(answer)
        return self.prediction

    def took(self, estimate: HeadEstimate, now_ns: int) -> None:
        """Take what the filter made of a good pose that came at ``now_ns``."""
        if self._measured is not None:
            step_ns = min(estimate.stamp_ns - self._measured.stamp_ns, self._timeout_ns)
            gain = _GAIN if self._interval_ns else 1.0
            self._interval_ns += gain * (step_ns - self._interval_ns)
        self._predictor.measured(estimate)
        self._measured, self._arrived_ns = estimate, now_ns
        self._contradicted = False
        self.prediction = None

    def refused(self, reason: Reason) -> None:
        """Take notice of a pose that was refused."""
        if reason not in _ABSENT:
            self._contradicted = True

    def before(self, stamp_ns: int) -> HeadEstimate | None:
        """Return where the filter goes on from at the first good pose after a gap.

        That is one usual interval before that pose, or where the joints end, so that neither pose
        nor twist jumps.

        Args:
            stamp_ns: time of capture of that pose [ns].

        Returns:
            The prediction for that time, or the last one there was; ``None`` if none was given out
            in this gap.
        """
        newest_ns = self._predictor.newest_ns
        if self.prediction is None or newest_ns is None:
            return None
        at_ns = min(stamp_ns - max(round(self._interval_ns), 1), newest_ns)
        answer = self._predictor.predict(at_ns)
        if isinstance(answer, Prediction):
            return self._with_covariance(answer).estimate
        last = self.prediction.estimate
        return last if last.stamp_ns < stamp_ns else None

    def _missing(self, stamp_ns: int, now_ns: int) -> bool:
        """Whether a pose is missed at a joint state of ``stamp_ns`` that comes at ``now_ns``."""
        # After the first pose alone nobody knows when the next one is due.
        if self._measured is None or self._contradicted or not self._interval_ns:
            return False
        if self.prediction is not None:
            return True
        silence_ns = max(_LATE_INTERVALS * self._interval_ns, _LEAST_SILENCE * self._timeout_ns)
        return (
            stamp_ns - self._measured.stamp_ns > _BEHIND * self._timeout_ns
            and now_ns - self._arrived_ns > silence_ns
        )

    def _with_covariance(self, prediction: Prediction) -> Prediction:
        """Return a prediction with what is uncertain of it.

        Nobody knows in which direction it errs, so its whole standard deviation is that of every
        axis, beside that of the measured pose. That of the twist is as much in one time-out.
        """
        assert self._measured is not None
        std = np.repeat([prediction.position_std_m, prediction.attitude_std_rad], 3)
        return dataclasses.replace(
            prediction,
            estimate=dataclasses.replace(
                prediction.estimate,
                pose_covariance=self._measured.pose_covariance + np.diag(std**2),
                twist_covariance=self._measured.twist_covariance
                + np.diag((self._per_s * std) ** 2),
            ),
        )
