import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.mock.motion_capture import MotionCapture, Noise

POSITION = np.array([1.0, -2.0, 0.3])
ROTATION = Rotation.from_euler("ZYX", [0.5, -0.9, 0.2])


def measure(count: int, noise: Noise, seed: int = 1):
    cameras = MotionCapture(noise, 0.0, np.random.default_rng(seed))
    for i in range(count):
        cameras.capture(float(i), POSITION, ROTATION.as_quat())
    poses = cameras.report(float(count))
    assert len(poses) == count
    positions = np.array([p.position for p in poses])
    rotations = Rotation.from_quat([p.quaternion for p in poses])
    return positions - POSITION, (rotations * ROTATION.inv()).as_rotvec(), poses


def test_without_noise_poses_are_exact():
    offsets, turns, _ = measure(3, Noise())

    np.testing.assert_allclose(offsets, 0.0, atol=1e-15)
    np.testing.assert_allclose(turns, 0.0, atol=1e-15)


def test_errors_have_the_given_deviation_and_no_mean():
    count = 4000
    offsets, turns, _ = measure(count, Noise(0.0005, 0.002))

    # Five standard errors of a mean, and of a deviation, of this many samples.
    for errors, deviation in ((offsets, 0.0005), (turns, 0.002)):
        np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=5 * deviation / count**0.5)
        np.testing.assert_allclose(errors.std(axis=0), deviation, rtol=5 / (2 * count) ** 0.5)


def test_errors_of_the_axes_and_of_successive_poses_are_independent():
    count = 4000
    offsets, turns, _ = measure(count, Noise(0.0005, 0.002))
    errors = np.hstack((offsets, turns, np.roll(offsets, 1, axis=0)))

    correlation = np.corrcoef(errors.T) - np.eye(9)
    assert np.abs(correlation).max() < 5 / count**0.5


def test_quaternions_have_length_1():
    _, _, poses = measure(100, Noise(0.0, 1.0))

    np.testing.assert_allclose([np.linalg.norm(p.quaternion) for p in poses], 1.0, atol=1e-12)


def test_the_same_seed_gives_the_same_poses():
    first, again, other = (measure(5, Noise(1.0, 0.1), seed)[0] for seed in (1, 1, 2))

    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)


def test_a_pose_is_reported_after_its_delay_and_keeps_its_time():
    cameras = MotionCapture(Noise(), 0.02, np.random.default_rng(0))
    assert cameras.next_report_at == float("inf")
    for time in (1.00, 1.01):
        cameras.capture(time, POSITION, ROTATION.as_quat())

    assert cameras.next_report_at == pytest.approx(1.02)
    assert cameras.report(1.0199) == []
    assert [pose.time for pose in cameras.report(1.025)] == [1.00]
    assert [pose.time for pose in cameras.report(2.0)] == [1.01]


@pytest.mark.parametrize("values", [(-1.0, 0.0), (0.0, -1.0), (float("nan"), 0.0)])
def test_impossible_noise_is_refused(values):
    with pytest.raises(ValueError, match="noise"):
        Noise(*values)
