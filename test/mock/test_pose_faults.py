"""Faults of the motion capture: what they do to poses, when they end, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from snake_control.mock.faults import FaultError
from snake_control.mock.motion_capture import MotionCapture, Noise
from snake_control.mock.pose_faults import POSE_KINDS, PoseFault

HERE = np.array([1.0, -2.0, 0.3])
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


def reported(fault, noise=5e-4, delay_s=0.02, seed=1):
    """Poses of 0.3 s at 100 Hz; the fault begins after 0.1 s. By time of capture."""
    cameras = MotionCapture(Noise(noise), delay_s, np.random.default_rng(seed))
    found, k = {}, 0
    for now in np.arange(0.0, 1.0, 0.001):
        if fault and round(now * 1000) == 100:
            cameras.faults.inject(fault, now)
        if k < 30 and now >= k * 0.01 - 1e-9:
            cameras.capture(round(k * 0.01, 6), HERE + [0.001 * k, 0, 0], LEVEL)
            k += 1
        for pose in cameras.report(now):
            found[round(pose.time * 100)] = (pose, now)
    return found


@pytest.fixture(scope="module")
def good():
    return {k: pose for k, (pose, _) in reported(None).items()}


def spoilt(kind, **fields):
    return reported(PoseFault(kind, duration_s=0.1, **fields))


def differing(found, good):
    """Captures whose values are others than without the fault."""
    return [
        k
        for k, (pose, _) in found.items()
        if not np.array_equal(pose.position, good[k].position)
        or not np.array_equal(pose.quaternion, good[k].quaternion)
        or pose.elsewhere
    ]


def test_a_dropout_leaves_poses_out(good):
    found = spoilt("pose_dropout")
    assert sorted(set(good) - set(found)) == list(range(10, 20))
    assert differing(found, good) == []


@pytest.mark.parametrize("kind", ["pose_jump", "pose_noise", "pose_quaternion", "pose_nan"])
def test_values_are_wrong_while_it_lasts_and_right_again(good, kind):
    assert differing(spoilt(kind), good) == list(range(10, 20))


def test_how_wrong_they_are(good):
    jumped = spoilt("pose_jump", value=0.5)
    np.testing.assert_allclose(jumped[15][0].position - good[15].position, [0.5, 0, 0])
    short = spoilt("pose_quaternion", value=0.25)
    assert np.linalg.norm(short[15][0].quaternion) == pytest.approx(0.25)
    noisy = reported(PoseFault("pose_noise", value=0.005))
    errors = [noisy[k][0].position - good[k].position for k in range(10, 30)]
    # Of 60 numbers a deviation is known to 9 %.
    assert np.std(errors) == pytest.approx(0.005, rel=0.4)


def test_a_freeze_repeats_the_last_pose_to_the_last_bit(good):
    found = spoilt("pose_freeze")
    for k in range(10, 20):
        np.testing.assert_array_equal(found[k][0].position, good[9].position)
        assert found[k][0].time == pytest.approx(0.01 * k)
    np.testing.assert_array_equal(found[20][0].position, good[20].position)


def test_a_delay_keeps_stamps_and_order(good):
    found = spoilt("pose_delay", value=0.055)
    assert differing(found, good) == []
    arrivals = [now for _, (_, now) in sorted(found.items())]
    assert arrivals == sorted(arrivals)
    ages = [now - pose.time for pose, now in found.values()]
    assert ages[:10] == pytest.approx([0.02] * 10, abs=2e-3)
    assert ages[10:20] == pytest.approx([0.075] * 10, abs=2e-3)
    assert ages[-1] == pytest.approx(0.02, abs=2e-3)


def test_a_wrong_frame_is_marked(good):
    assert differing(spoilt("pose_frame"), good) == list(range(10, 20))


def test_a_share_of_the_poses():
    found = reported(PoseFault("pose_jump", probability=0.5), noise=0.0)
    off = sum(pose.position[0] > 1.1 for pose, _ in found.values())
    assert 3 <= off <= 17


def test_clearing_ends_them():
    cameras = MotionCapture(Noise(), 0.0, np.random.default_rng(0))
    cameras.faults.inject(PoseFault("pose_dropout"), 0.0)
    assert cameras.faults.clear() == 1
    cameras.capture(1.0, HERE, LEVEL)
    assert len(cameras.report(1.0)) == 1


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"kind": "no_reply"}, "fault"),
        ({"kind": "pose_jump", "value": 99.0}, "value"),
        ({"kind": "pose_nan", "value": 1.0}, "value"),
        ({"kind": "pose_jump", "duration_s": -1.0}, "duration"),
        ({"kind": "pose_jump", "probability": 0.0}, "probability"),
    ],
)
def test_what_cannot_be_is_refused(fields, field):
    with pytest.raises(FaultError) as caught:
        PoseFault(**fields)
    assert caught.value.field == field


def test_the_table_of_the_docs_is_the_table_of_the_code():
    text = (Path(__file__).parents[2] / "docs" / "pose.md").read_text()
    lines = text.partition("| kind | what happens to a pose |")[2].partition("\n\n")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in lines.splitlines()
        if line.startswith("| `")
    ]
    assert rows == [
        [
            f"`{kind.name}`",
            kind.does,
            f"{kind.value}, {kind.low:g} to {kind.high:g}" if kind.value else "",
            f"{kind.default:g}" if kind.value else "",
        ]
        for kind in POSE_KINDS.values()
    ]
