"""The way of a pose from the motion capture to an estimate: order of the checks, counts, news."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.config import PoseInputConfig
from snake_control.control.head_filter import HeadEstimate, Reason, Rejection
from snake_control.control.pose_intake import Measurement, PoseIntake

STEP_NS = 10_000_000
DELAY_NS = 5_000_000
LEVEL = (0.0, 0.0, 0.0, 1.0)
HEAD = np.array([0.5, -0.2, 0.3])


class Stream:
    """Poses at 100 Hz of a head at rest, with noise."""

    def __init__(self, noise=5e-4, **params):
        self.intake = PoseIntake(PoseInputConfig(**params), 0.005)
        self._rng = np.random.default_rng(6)
        self._noise = noise
        self.stamp_ns = 1_000_000_000_000

    def send(self, position=None, xyzw=LEVEL, frame="world", step_ns=STEP_NS, **fields):
        self.stamp_ns += step_ns
        if position is None:
            position = HEAD + self._rng.normal(0.0, self._noise, 3)
        stamp = fields.pop("stamp_ns", self.stamp_ns)
        measured = Measurement(stamp, frame, np.asarray(position, float), np.array(xyzw), **fields)
        return self.intake.take(measured, self.stamp_ns + DELAY_NS)

    def run(self, count, **changes):
        return [self.send(**changes) for _ in range(count)]


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"position": (math.nan, 0, 0)}, Reason.NOT_FINITE),
        ({"position": (2000.0, 0, 0)}, Reason.TOO_FAR),
        ({"xyzw": (0, 0, 0, 0.9)}, Reason.NOT_A_ROTATION),
        ({"frame": "camera"}, Reason.WRONG_FRAME),
        ({"stamp_ns": 0}, Reason.UNSTAMPED),
        ({"stamp_ns": 2_000_000_000_000}, Reason.AHEAD_OF_CLOCK),
        ({"position": (0, 0, 0)}, Reason.NOT_TRACKED),
        ({"position": (0.9, 0, 0)}, Reason.JUMP),
        ({"step_ns": 0}, Reason.OUT_OF_ORDER),
    ],
)
def test_a_bad_pose_is_refused_counted_and_changes_nothing(fields, reason):
    stream = Stream()
    stream.run(30)
    before = stream.intake.estimate
    result = stream.send(**fields)
    assert isinstance(result, Rejection)
    assert result.reason is reason
    assert stream.intake.refused == {reason: 1}
    assert stream.intake.estimate is before
    assert stream.intake.accepted == 30
    assert isinstance(stream.send(), HeadEstimate)


@pytest.mark.parametrize("frames", [("map", "mocap"), ("any",)])
def test_frames_that_are_named_are_accepted(frames):
    stream = Stream(pose_frames=frames)
    assert isinstance(stream.send(frame="map"), HeadEstimate)
    assert isinstance(stream.send(frame=""), HeadEstimate)


def test_an_unstamped_pose_may_have_the_time_of_its_arrival():
    stream = Stream(unstamped="arrival")
    result = stream.send(stamp_ns=0)
    assert isinstance(result, HeadEstimate)
    assert result.stamp_ns == stream.stamp_ns + DELAY_NS
    # It says nothing of the clocks.
    stream.run(30, stamp_ns=0)
    assert math.isnan(stream.intake.clock.offset_s)


def test_the_age_on_arrival_is_watched():
    stream = Stream()
    stream.run(30)
    assert stream.intake.clock.offset_s == pytest.approx(DELAY_NS * 1e-9)


def test_repeats_are_left_out_at_once_and_named_frozen_later():
    stream = Stream()
    stream.run(60)
    last = stream.intake.estimate
    frozen = HEAD + 1e-4
    stream.send(frozen)
    results = stream.run(30, position=frozen)
    assert [r.reason for r in results[:9]] == [Reason.REPEATED] * 9
    assert [r.reason for r in results[9:]] == [Reason.FROZEN] * 21
    assert "0.30 s" in results[-1].text
    assert stream.intake.estimate.stamp_ns == last.stamp_ns + STEP_NS
    assert isinstance(stream.send(), HeadEstimate)
    assert stream.intake.pauses == 1
    assert stream.intake.longest_pause_s == pytest.approx(0.31)


@pytest.mark.parametrize("params", [{"frozen_after_s": 0.0}, {"noise": 0.0}])
def test_a_source_without_noise_or_watch_may_repeat(params):
    stream = Stream(**params)
    stream.run(60)
    assert all(isinstance(r, HeadEstimate) for r in stream.run(60, position=HEAD))


def test_a_carried_robot_is_found_again_and_starts_at_rest():
    stream = Stream()
    for k in range(100):
        stream.send(HEAD + [0.001 * k, 0, 0])
    assert stream.intake.estimate.velocity[0] == pytest.approx(0.1, rel=0.05)
    results = [stream.send(HEAD + [1.5 + 1e-5 * k, 0, 0]) for k in range(31)]
    found = [k for k, r in enumerate(results) if isinstance(r, HeadEstimate)]
    assert found == [29, 30]
    assert stream.intake.new_places == 1
    assert not stream.intake.news
    assert stream.intake.refused == {Reason.JUMP: 29}
    first = results[29]
    np.testing.assert_array_equal(first.velocity, np.zeros(3))
    assert first.position[0] == pytest.approx(HEAD[0] + 1.5, abs=1e-3)
    again = Stream()
    again.run(2)
    again.run(30, position=HEAD + 1.0)
    assert "another place, 1.732 m" in again.intake.news


def test_a_clock_that_is_set_back_starts_everything_anew():
    stream = Stream()
    stream.run(40)
    stream.stamp_ns -= 3_600_000_000_000
    assert isinstance(stream.send(), HeadEstimate)
    assert "set back" in stream.intake.news
    assert math.isnan(stream.intake.clock.offset_s)


def test_the_markers_offset_and_the_jump_are_judged_at_the_head():
    stream = Stream(marker_position_m=(0.0, 0.0, 0.5), marker_rpy_rad=(0.0, 0.0, 1.0))
    # The markers swing about the tip by 0.1 rad, 5 cm away from where they were.
    for k, angle in enumerate(np.linspace(0.0, 0.1, 11)):
        head = Rotation.from_rotvec([angle, 0, 0])
        markers = HEAD + head.apply([0, 0, 0.5])
        xyzw = (head * Rotation.from_rotvec([0, 0, 1.0])).as_quat()
        result = stream.send(markers, xyzw)
        assert isinstance(result, HeadEstimate), k
        np.testing.assert_allclose(result.position, HEAD, atol=1e-9)


def test_the_covariance_of_the_source_goes_before_the_parameters():
    given = np.diag([4e-6] * 3 + [9e-6] * 3)
    with_it, without = Stream(), Stream(position_noise_m=0.002, rotation_noise_rad=0.003)
    for _ in range(100):
        a, b = with_it.send(covariance=given), without.send()
    np.testing.assert_allclose(a.pose_covariance, b.pose_covariance, atol=1e-18)
    np.testing.assert_allclose(a.twist_covariance, b.twist_covariance, atol=1e-18)
