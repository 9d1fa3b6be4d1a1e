"""All that becomes of a measured pose until it is an estimate of the head, or is refused.

In this order: frame, time of capture, numbers, whether the body was seen, repeats, the way from the
markers to the head, jumps, the filter. After a gap that was bridged the filter goes on from there.
"""

from __future__ import annotations

import collections
import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from snake_control.config import PoseInputConfig
from snake_control.control.head_filter import (
    HeadEstimate,
    HeadFilter,
    Reason,
    Rejection,
    unusable,
)
from snake_control.control.pose_bridge import PoseBridge
from snake_control.control.pose_clock import ClockWatch
from snake_control.control.pose_freeze import FreezeWatch
from snake_control.control.pose_gate import JumpGate, JumpLimits, NewPlace
from snake_control.control.pose_mount import MarkerMount

Array = NDArray[np.float64]

ANY_FRAME = "any"


@dataclasses.dataclass(frozen=True)
class Measurement:
    """A pose as the motion capture reports it.

    Attributes:
        stamp_ns: time of capture [ns]; 0 if it does not say.
        frame_id: frame of the pose; empty if it does not say.
        position: of the tracked body, (3,) [m].
        quaternion: its attitude, [x, y, z, w].
        covariance: of position and small turns about the axes of the frame, (6, 6)
            [m^2, m rad, rad^2]; ``None`` if it does not say.
    """

    stamp_ns: int
    frame_id: str
    position: Array
    quaternion: Array
    covariance: Array | None = None


@dataclasses.dataclass(frozen=True)
class HeadPose:
    """A measured pose of the head, before the filter.

    Attributes:
        stamp_ns: time of capture [ns].
        position: of the tip in the world, (3,) [m].
        quaternion: attitude of the head in the world, [x, y, z, w].
    """

    stamp_ns: int
    position: Array
    quaternion: Array


class PoseIntake:
    """Judges poses one after the other, and counts.

    Attributes:
        accepted: poses that became estimates.
        refused: how many were not, by reason.
        pauses, longest_pause_s: times without good poses that were longer than the time-out.
        new_places: how often the head was found at another place.
        news: what happened at the last pose beside its result; empty if nothing did.
        set_back: whether the clock was found set back at the last pose.
        measured: the newest good pose as it was measured, ``None`` before the first.
    """

    def __init__(
        self,
        config: PoseInputConfig,
        future_tolerance_s: float,
        bridge: PoseBridge | None = None,
    ) -> None:
        """Set everything up, without a pose.

        Args:
            config: what is believed, and where the markers are.
            future_tolerance_s: how far ahead of this computer's clock a stamp may be.
            bridge: what bridges gaps; it is told what is refused, but what is taken only by
                ``PoseBridge.took``, once the estimate has gone on its way.
        """
        self._config = config
        self._bridge = bridge
        self._future_tolerance_ns = round(future_tolerance_s * 1e9)
        self._frames = {"", config.frame_id, *config.pose_frames}
        self._filter = HeadFilter(
            config.cutoff_hz, config.timeout_s, config.max_speed_m_s, config.max_turning_rad_s
        )
        self._freeze = FreezeWatch(config.frozen_noise_m, config.timeout_s)
        self._gate = JumpGate(
            JumpLimits(
                speed_m_s=config.max_speed_m_s,
                turning_rad_s=config.max_turning_rad_s,
                tolerance_m=config.jump_tolerance_m,
                tolerance_rad=config.jump_tolerance_rad,
                new_place_after=config.new_place_after_poses,
                horizon_s=config.timeout_s,
            )
        )
        self._mount = MarkerMount(config.marker_position_m, config.marker_rpy_rad, config.y_up)
        self._noise = np.diag(
            np.square(np.repeat([config.position_noise_m, config.rotation_noise_rad], 3))
        )
        self.clock = ClockWatch(
            config.clock_window_s,
            config.clock_tolerance_s,
            config.max_delay_s,
            config.clock_drift_s,
        )
        self.accepted = self.pauses = self.new_places = 0
        self.longest_pause_s = 0.0
        self.refused: collections.Counter[Reason] = collections.Counter()
        self.news = ""
        self.set_back = False
        self.measured: HeadPose | None = None

    @property
    def estimate(self) -> HeadEstimate | None:
        """The newest estimate, ``None`` before the first good pose."""
        return self._filter.estimate

    @property
    def noise_m(self) -> float:
        """Noise of the position as the poses show it, per axis [m]; NaN while unknown."""
        return self._freeze.noise_m

    def take(self, measurement: Measurement, now_ns: int) -> HeadEstimate | Rejection:
        """Take one pose.

        Args:
            measurement: as it came.
            now_ns: time of its arrival by this computer's clock [ns].

        Returns:
            The estimate at its time of capture, or why it was refused (the estimate then stays).
        """
        self.news = ""
        self.set_back = False
        before = self.estimate
        if before is not None and before.stamp_ns > now_ns + self._future_tolerance_ns:
            self.news = "the clock was set back: the filter starts anew"
            self.set_back = True
            self._filter.reset()
            self.clock.reset()
            if self._bridge is not None:
                self._bridge.reset()
            before = None
        result = self._judge(measurement, now_ns)
        if isinstance(result, Rejection):
            return self.refuse(result)
        self.accepted += 1
        if before is not None:
            pause_s = (result.stamp_ns - before.stamp_ns) * 1e-9
            if pause_s > self._config.timeout_s:
                self.pauses += 1
                self.longest_pause_s = max(self.longest_pause_s, pause_s)
        return result

    def refuse(self, rejection: Rejection) -> Rejection:
        """Count a pose that was refused, also one that did not even come (a body not seen)."""
        self.refused[rejection.reason] += 1
        if self._bridge is not None:
            self._bridge.refused(rejection.reason)
        return rejection

    def _judge(self, measurement: Measurement, now_ns: int) -> HeadEstimate | Rejection:
        if measurement.frame_id not in self._frames and ANY_FRAME not in self._config.pose_frames:
            return Rejection(
                Reason.WRONG_FRAME,
                f"poses are given in frame '{measurement.frame_id}', not in "
                f"'{self._config.frame_id}'; if both are the same, add it to pose_frames",
            )
        stamp_ns = measurement.stamp_ns
        if stamp_ns == 0:
            if self._config.unstamped == "refuse":
                return Rejection(
                    Reason.UNSTAMPED,
                    "pose has stamp 0; if its source cannot do better, set unstamped: arrival",
                )
            stamp_ns = now_ns
        else:
            self.clock.observe(now_ns, stamp_ns)
        ahead_ns = stamp_ns - now_ns
        if ahead_ns > self._future_tolerance_ns:
            # Once accepted, it would make every later pose look out of order.
            return Rejection(
                Reason.AHEAD_OF_CLOCK,
                f"pose is stamped {ahead_ns * 1e-9:.3f} s ahead of this computer's clock",
            )
        position, xyzw = measurement.position, measurement.quaternion
        if rejection := unusable(position, xyzw):
            return rejection
        if not position.any():
            return Rejection(
                Reason.NOT_TRACKED,
                "position is exactly 0: what tracking systems send of a body that they do not see",
            )
        if rejection := self._repeats(stamp_ns, position, xyzw):
            return rejection
        covariance = self._noise if measurement.covariance is None else measurement.covariance
        position, rotation, covariance = self._mount.head(
            position, Rotation.from_quat(xyzw), covariance
        )
        judged = self._gate.judge(stamp_ns, position, rotation, self.estimate)
        if isinstance(judged, Rejection):
            return judged
        if isinstance(judged, NewPlace):
            self.new_places += 1
            self.news = str(judged)
            self._filter.reset()
        elif self._bridge is not None and self._in_order(stamp_ns):
            bridged = self._bridge.before(stamp_ns)
            if bridged is not None:
                self._filter.go_on_from(bridged)
        xyzw = rotation.as_quat()
        result = self._filter.update(stamp_ns, position, xyzw, covariance)
        if isinstance(result, HeadEstimate):
            self.measured = HeadPose(stamp_ns, position, xyzw)
        return result

    def _in_order(self, stamp_ns: int) -> bool:
        return self.estimate is None or stamp_ns > self.estimate.stamp_ns

    def _repeats(self, stamp_ns: int, position: Array, xyzw: Array) -> Rejection | None:
        after_s = self._config.frozen_after_s
        if after_s == 0:
            return None
        same_s = self._freeze.repeats_for(stamp_ns, np.concatenate([position, xyzw]))
        if same_s is None:
            return None
        if same_s < after_s:
            return Rejection(Reason.REPEATED, "pose is the one before to the last bit")
        return Rejection(
            Reason.FROZEN,
            f"poses have been the same to the last bit for {same_s:.2f} s: the body is not "
            "tracked, or its source stands still (a simulator without noise: frozen_after_s: 0)",
        )
