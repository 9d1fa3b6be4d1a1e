import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snake_control.control.rate_limit import RateLimit

S = 1_000_000_000


def through(limit, times_ns):
    return [time for time in times_ns if limit.allows(time)]


@pytest.mark.parametrize("source_hz", [30.0, 99.0, 100.0])
def test_a_source_within_the_rate_loses_nothing(source_hz):
    times = [round(k / source_hz * S) for k in range(2000)]
    assert through(RateLimit(100.0), times) == times


def uneven(by_s):
    late = np.random.default_rng(4).uniform(0.0, by_s, 2000)
    return sorted(round((0.01 * k + late[k]) * S) for k in range(2000))


def test_intervals_that_are_uneven_by_up_to_a_period_cost_nothing():
    assert through(RateLimit(100.0), uneven(0.01)) == uneven(0.01)


def test_what_comes_in_bursts_loses_some_and_leaves_no_long_gap():
    left = through(RateLimit(100.0), uneven(0.04))
    assert 1500 < len(left) < 2000
    assert max(np.diff(left)) < 0.05 * S


@pytest.mark.parametrize(("source_hz", "rate_hz"), [(120.0, 100.0), (240.0, 100.0), (360.0, 50.0)])
def test_of_a_quicker_source_the_rate_is_left_and_no_gap(source_hz, rate_hz):
    times = [round(k / source_hz * S) for k in range(round(10 * source_hz))]
    left = through(RateLimit(rate_hz), times)
    assert len(left) == pytest.approx(10 * rate_hz, abs=2)
    assert max(np.diff(left)) <= (1 / rate_hz + 1 / source_hz) * S


@given(st.lists(st.integers(0, S // 20), min_size=1, max_size=200), st.floats(1.0, 500.0))
def test_no_more_than_the_rate_and_two_in_any_time(intervals, rate_hz):
    left = through(RateLimit(rate_hz), np.cumsum(intervals).tolist())
    assert left
    for first in range(len(left)):
        for last in range(first, len(left)):
            span_s = (left[last] - left[first]) / S
            assert last - first + 1 <= math.floor(span_s * rate_hz + 2.0 + 1e-3)


def test_what_is_late_gives_no_more():
    limit = RateLimit(10.0)
    late = [10 * S, 10 * S, 9 * S, 10 * S, 9 * S, 10 * S]
    assert through(limit, late) == [10 * S, 10 * S]


def test_a_clock_that_is_set_back_begins_anew():
    limit = RateLimit(10.0)
    assert through(limit, [10 * S] * 3) == [10 * S] * 2
    limit.reset()
    assert through(limit, [9 * S] * 3) == [9 * S] * 2
