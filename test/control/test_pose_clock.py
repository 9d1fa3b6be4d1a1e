"""The offset of the clock that stamps poses: found through jitter, and judged."""

import math

import numpy as np
import pytest

from snake_control.control.pose_clock import ClockWatch

MS = 1_000_000
WINDOW_S = 2.0


def watched(offset_ms, seconds=1.0, rng=None, watch=None, start_s=0.0):
    """A watch that has seen poses at 100 Hz; ``offset_ms`` is a number or a function of time."""
    watch = watch or ClockWatch(WINDOW_S, 0.001, 0.05, 0.002)
    rng = rng or np.random.default_rng(1)
    for k in range(round(seconds * 100)):
        t = start_s + k * 0.01
        offset = offset_ms(t) if callable(offset_ms) else offset_ms
        stamp = round(t * 1e9)
        watch.observe(stamp + round((offset + rng.exponential(8.0)) * MS), stamp)
    return watch


def test_the_least_age_is_the_offset_whatever_the_jitter():
    watch = watched(12.0, 2.0)
    # Of 200 exponential delays of 8 ms on average the least is below 0.4 ms almost surely.
    assert watch.offset_s == pytest.approx(0.012, abs=4e-4)
    assert watch.problem == ""


def test_a_few_poses_say_nothing():
    watch = watched(80.0, 0.1)
    assert math.isnan(watch.offset_s)
    assert math.isnan(watch.drift_s)
    assert watch.problem == ""


@pytest.mark.parametrize(
    ("offset_ms", "text"), [(-3.0, "ahead of this computer's clock"), (80.0, "80 ms old")]
)
def test_clocks_that_are_apart_are_named(offset_ms, text):
    assert text in watched(offset_ms).problem


def test_an_offset_within_tolerance_is_none():
    assert watched(-0.9, 2.0).problem == ""


def test_a_window_forgets():
    watch = watched(80.0, 3.0)
    assert watch.problem
    watched(10.0, 0.5, watch=watch, start_s=3.0)
    assert watch.offset_s == pytest.approx(0.010, abs=2e-3)
    watched(80.0, 2.5, watch=watch, start_s=3.5)
    assert watch.offset_s == pytest.approx(0.080, abs=2e-3)


def test_drift_is_found_and_jitter_is_none():
    # 300 ppm: 3.6 ms in six windows of two seconds.
    drifting = watched(lambda t: 10.0 + 0.3 * t, 16.0)
    assert drifting.drift_s == pytest.approx(300e-6 * 12.0, rel=0.2)
    assert "drift apart by 18" in drifting.problem or "drift apart by 17" in drifting.problem
    assert watched(10.0, 16.0).problem == ""


def test_a_clock_that_was_set_begins_anew():
    watch = watched(10.0)
    watch.reset()
    assert math.isnan(watch.offset_s)
    watched(20.0, watch=watch, start_s=-100.0)
    assert watch.offset_s == pytest.approx(0.020, abs=2e-3)
