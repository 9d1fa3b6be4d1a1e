"""Poses that repeat: a fault of what carries noise, the habit of a simulator."""

import math

import numpy as np
import pytest

from snake_control.control.pose_freeze import FreezeWatch

STEP_NS = 10_000_000
NOISE_M = 5e-6
LEVEL = (0.0, 0.0, 0.0, 1.0)


def watch():
    return FreezeWatch(NOISE_M, 0.1)


def feed(found, count, noise, start=0, speed=0.05, jitter=0.0):
    """Poses of a head that swings to and fro; returns the last one and its stamp."""
    rng = np.random.default_rng(start)
    for k in range(start, start + count):
        stamp = round((k + rng.uniform(-jitter, jitter)) * STEP_NS)
        x = 0.05 * math.sin(speed / 0.05 * stamp * 1e-9)
        position = np.array([x, 0.2, 0.3]) + rng.normal(0.0, noise, 3)
        assert found.repeats_for(stamp, [*position, *LEVEL]) is None
    return position, stamp


@pytest.mark.parametrize("noise", [2e-5, 5e-4, 5e-3])
def test_noise_is_measured_though_the_head_moves_and_times_are_uneven(noise):
    found = watch()
    feed(found, 600, noise, speed=0.1, jitter=0.4)
    # A median of 50 lengths, from which neighbours share three of four poses.
    assert found.noise_m == pytest.approx(noise, rel=0.5)


@pytest.mark.parametrize("noise", [2e-5, 5e-4])
def test_a_repeat_after_noise_is_told_with_its_time(noise):
    found = watch()
    feed(found, 100, noise, speed=0.0)
    position, last = feed(found, 200, noise, start=100)
    for k in range(1, 30):
        same_s = found.repeats_for(last + k * STEP_NS, [*position, *LEVEL])
        assert same_s == pytest.approx(0.01 * k)
    feed(found, 10, noise, start=400)


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_smooth_motion_that_ends_may_rest(jitter):
    found = watch()
    position, last = feed(found, 1000, 0.0, speed=0.3, jitter=jitter)
    assert found.noise_m < NOISE_M
    for k in range(1, 100):
        assert found.repeats_for(last + k * STEP_NS, [*position, *LEVEL]) is None


def test_a_simulator_whose_stamps_are_late_may_rest():
    found, rng = watch(), np.random.default_rng(9)
    for k in range(400):
        stamp = round((k + rng.uniform(0.0, 0.9)) * STEP_NS)
        assert found.repeats_for(stamp, [5e-4 * k, 0.2, 0.3, *LEVEL]) is None
    for j in range(1, 100):
        same = [5e-4 * k, 0.2, 0.3, *LEVEL]
        assert found.repeats_for(stamp + j * STEP_NS, same) is None


def test_without_a_past_nothing_is_said():
    found = watch()
    assert math.isnan(found.noise_m)
    for k in range(100):
        assert found.repeats_for(k * STEP_NS, [1.0, 2.0, 3.0, *LEVEL]) is None


def test_a_pause_is_no_noise():
    found = watch()
    for k in range(60):
        # Four poses without noise, then a step after a pause: no four are neighbours.
        stamp = (k // 4) * 1_000_000_000 + (k % 4) * STEP_NS
        found.repeats_for(stamp, [0.1 * (k // 4), 1e-4 * (k % 4), 0.3, *LEVEL])
    assert math.isnan(found.noise_m) or found.noise_m < NOISE_M
