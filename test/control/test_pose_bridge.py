"""Gaps of poses: which are bridged, for how long, and how poses are taken up again."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from snake_control.config import PoseInputConfig
from snake_control.control.head_filter import HeadEstimate, Reason, Rejection
from snake_control.control.pose_bridge import PoseBridge
from snake_control.control.pose_hypotheses import Cause
from snake_control.control.pose_intake import Measurement, PoseIntake
from snake_control.control.pose_watch import PoseWatch
from support.moving_head import MovingHead
from support.robots import PAPER

MS = 1_000_000
BEGIN_NS = 1_000_000_000_000


class Stream:
    """Poses and joint states of a moving head, and what is published of them.

    Attributes:
        published: estimates in their order, with the time of each and whether it was predicted.
        errors: distance of each from the true head [m].
    """

    def __init__(self, interval=1, delay=2, joints=True, noise=2e-4, **params):
        config = PoseInputConfig(**params)
        self.bridge = PoseBridge(PAPER, config, 0.005)
        self.intake = PoseIntake(config, 0.005, self.bridge)
        self.head = MovingHead(PAPER)
        self.joints_come = joints
        self.published: list[tuple[int, HeadEstimate, bool]] = []
        self.errors: list[float] = []
        self._interval, self._delay, self._noise = interval, delay, noise
        self._rng = np.random.default_rng(4)
        self._count = 0
        self._poses: list[tuple[int, Measurement]] = []
        self._truth: dict[int, np.ndarray] = {}

    def run(self, seconds, poses=True, joints_late_ns=2 * MS, off=(0.0, 0.0, 0.0)):
        """Go on, with or without poses; return the last result of one."""
        result = None
        for _ in range(round(seconds * 100)):
            now = BEGIN_NS + 10 * MS * self._count
            self._truth[now] = self.head.position
            if self._count % self._interval == 0 and poses:
                place = self.head.position + off + self._rng.normal(0.0, self._noise, 3)
                measured = Measurement(now, "world", place, self.head.quaternion)
                self._poses.append((now + 10 * MS * self._delay, measured))
            while self._poses and self._poses[0][0] <= now:
                result = self.take(self._poses.pop(0)[1], now)
            if self._count % 2 == 0 and self.joints_come:
                late = now + joints_late_ns
                answer = self.bridge.joints(now, self.head.phi, self.head.phi_dot, late)
                if answer is not None:
                    self._publish(now, answer.estimate, True)
            self._count += 1
            self.head.step()
        return result

    def take(self, measured, now):
        result = self.intake.take(measured, now)
        if isinstance(result, HeadEstimate):
            if not self.published or result.stamp_ns > self.published[-1][1].stamp_ns:
                self._publish(now, result, False)
            self.bridge.took(result, now)
        return result

    def _publish(self, now, estimate, predicted):
        self.published.append((now, estimate, predicted))
        truth = self._truth.get(estimate.stamp_ns)
        if truth is not None:
            self.errors.append(float(np.linalg.norm(estimate.position - truth)))

    @property
    def predicted(self):
        return [estimate for _, estimate, predicted in self.published if predicted]


def test_a_gap_of_0_2_s_is_bridged_with_growing_uncertainty_and_without_a_jump():
    stream = Stream()
    stream.run(3.0)
    assert not stream.predicted
    before = len(stream.published)
    stream.run(0.2, poses=False)
    assert stream.bridge.prediction.age_s > 0.15
    stream.run(1.0)
    assert stream.bridge.gaps == 1
    assert stream.bridge.prediction is None
    assert len(stream.predicted) >= 7

    stamps = [estimate.stamp_ns for _, estimate, _ in stream.published]
    assert all(a < b for a, b in pairwise(stamps))
    # Nobody who waits for 0.1 s by the stamps has to stop.
    ages = [now - before.stamp_ns for (_, before, _), (now, _, _) in pairwise(stream.published)]
    assert max(ages) < 95 * MS
    for get in (lambda e: e.pose_covariance, lambda e: e.twist_covariance):
        variances = np.array([np.diag(get(estimate)) for estimate in stream.predicted])
        assert (np.diff(variances, axis=0) > 0).all()
        assert (variances[0] > np.diag(get(stream.published[before - 1][1]))).all()
    # What the filter lags behind is there without a gap, too.
    assert max(stream.errors[before - 10 :]) < 1.2 * max(stream.errors[: before - 10]) + 2e-4
    speeds = np.array([estimate.velocity for _, estimate, _ in stream.published])
    jumps = np.linalg.norm(np.diff(speeds, axis=0), axis=1) / np.diff(np.array(stamps) * 1e-9)
    assert jumps[before - 10 :].max() < 1.5 * jumps[before - 200 : before - 1].max()


def test_a_longer_gap_is_bridged_up_to_the_limit_only():
    stream = Stream(bridge_s=0.2)
    stream.run(2.0)
    last_ns = stream.published[-1][1].stamp_ns
    stream.run(0.6, poses=False)
    ages = [(estimate.stamp_ns - last_ns) * 1e-9 for estimate in stream.predicted]
    # Two poses were still under way.
    assert 0.16 < max(ages) <= 0.2 + 0.02 + 1e-9
    assert isinstance(stream.run(0.03), HeadEstimate)
    np.testing.assert_array_equal(stream.published[-1][1].velocity, np.zeros(3))


def test_a_pose_soon_after_the_limit_goes_on_from_the_last_prediction():
    stream = Stream(bridge_s=0.2)
    stream.run(2.0)
    stream.run(0.24, poses=False)
    stream.run(0.1)
    velocity = stream.published[-1][1].velocity
    assert np.linalg.norm(velocity) > 0
    assert max(stream.errors[-20:]) < 1.2 * max(stream.errors[:190]) + 2e-4


@pytest.mark.parametrize(("interval", "delay"), [(1, 7), (3, 2), (5, 2), (5, 4)])
def test_poses_that_come_late_or_seldom_as_usual_are_no_gap(interval, delay):
    stream = Stream(interval=interval, delay=delay)
    stream.run(4.0)
    assert len(stream.published) > 300 / interval
    assert not stream.predicted


def test_a_gap_of_poses_that_come_late_leads_no_stamp_back():
    stream = Stream(delay=7)
    stream.run(2.0)
    stream.run(0.15, poses=False)
    stream.run(0.5)
    assert stream.predicted
    stamps = [estimate.stamp_ns for _, estimate, _ in stream.published]
    assert all(a < b for a, b in pairwise(stamps))
    assert not stream.published[-1][2]
    assert max(stream.errors[190:]) < 1.2 * max(stream.errors[:190]) + 2e-4


def test_without_joint_states_of_this_moment_nothing_is_bridged():
    for changes in ({"joints_late_ns": 110 * MS}, {"joints_late_ns": -6 * MS}):
        stream = Stream()
        stream.run(1.0, **changes)
        stream.run(0.3, poses=False, **changes)
        assert not stream.predicted
    stream = Stream(joints=False)
    stream.run(1.0)
    stream.run(0.3, poses=False)
    assert not stream.predicted
    # The old rule: the filter starts anew, at rest.
    stream.run(0.03)
    np.testing.assert_array_equal(stream.published[-1][1].velocity, np.zeros(3))


def test_joint_states_that_cease_end_it():
    stream = Stream()
    stream.run(1.0)
    stream.run(0.12, poses=False)
    count = len(stream.predicted)
    assert count > 1
    stream.joints_come = False
    stream.run(0.2, poses=False)
    assert len(stream.predicted) == count


def test_poses_that_contradict_are_not_bridged():
    stream = Stream()
    stream.run(1.0)
    result = stream.run(0.25, off=(0.5, 0.0, 0.0))
    assert isinstance(result, Rejection)
    assert result.reason is Reason.JUMP
    assert not stream.predicted
    stream.run(0.5)
    # Back at the old place: gaps count again.
    stream.run(0.2, poses=False)
    assert stream.predicted


def test_a_body_that_is_not_seen_is_bridged():
    stream = Stream()
    stream.run(1.0)
    for _ in range(15):
        stream.intake.refuse(Rejection(Reason.NOT_TRACKED, "not there"))
        stream.run(0.01, poses=False)
    assert stream.predicted


def test_a_clock_that_was_set_back_is_no_gap():
    stream = Stream()
    stream.run(1.0)
    stream.run(0.15, poses=False)
    assert stream.bridge.prediction is not None
    measured = Measurement(BEGIN_NS // 2, "world", stream.head.position, stream.head.quaternion)
    result = stream.intake.take(measured, BEGIN_NS // 2)
    assert stream.intake.set_back
    assert isinstance(result, HeadEstimate)
    np.testing.assert_array_equal(result.velocity, np.zeros(3))
    assert stream.bridge.prediction is None
    stream.intake.take(
        Measurement(BEGIN_NS // 2 + 10 * MS, "world", stream.head.position, stream.head.quaternion),
        BEGIN_NS // 2 + 10 * MS,
    )
    assert not stream.intake.set_back


def test_markers_that_are_not_where_they_are_thought_to_be_are_named():
    """The watch is fed with what the intake makes of a pose: that of the head, as configured."""
    intake = PoseIntake(PoseInputConfig(marker_position_m=(0.0, 0.0, 0.03)), 0.005)
    head, watch = MovingHead(PAPER, 0.4), PoseWatch(PAPER)
    rng = np.random.default_rng(2)
    for step in range(3000):
        now = BEGIN_NS + 10 * MS * step
        place = head.position + rng.normal(0.0, 2e-4, 3)
        assert isinstance(
            intake.take(Measurement(now, "world", place, head.quaternion), now), HeadEstimate
        )
        assert intake.measured.stamp_ns == now
        watch.joints(now, head.phi)
        watch.pose(now, intake.measured.position, intake.measured.quaternion)
        if watch.verdict.cause is not Cause.NOTHING:
            break
        head.step()
    assert watch.verdict.cause is Cause.WRONG_MARKER_OFFSET
    # It was at the tip, and is taken for a place above it.
    np.testing.assert_allclose(watch.verdict.marker_offset_m, [0.0, 0.0, -0.03], atol=0.01)
