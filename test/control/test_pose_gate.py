"""Outliers are refused, a robot that was carried is found again."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from snake_control.control.head_filter import HeadEstimate, Reason, Rejection
from snake_control.control.pose_gate import JumpGate, JumpLimits, NewPlace

LIMITS = JumpLimits(1.0, 6.0, 0.03, 0.15, 10, 0.1)
STEP_NS = 10_000_000
LEVEL = Rotation.identity()
HERE = HeadEstimate(0, np.zeros(3), LEVEL, np.zeros(3), np.zeros(3))


def judge(gate, step, position, rotation=LEVEL):
    return gate.judge(step * STEP_NS, np.array(position, dtype=float), rotation, HERE)


@given(
    direction=st.sampled_from([(1, 0, 0), (0, -1, 0), (0.6, 0, 0.8)]),
    share=st.floats(0.0, 2.0),
    step=st.integers(1, 9),
)
@settings(max_examples=60, deadline=None)
def test_what_the_head_can_have_moved_passes_and_no_more(direction, share, step):
    distance = share * (0.03 + 1.0 * 0.01 * step)
    result = judge(JumpGate(LIMITS), step, distance * np.array(direction))
    if share < 0.999:
        assert result is None
    elif share > 1.001:
        assert isinstance(result, Rejection)
        assert result.reason is Reason.JUMP
        assert f"{distance:.3f} m" in result.text


def test_turns_are_judged_likewise():
    assert judge(JumpGate(LIMITS), 1, (0, 0, 0), Rotation.from_rotvec([0, 0.2, 0])) is None
    turned = judge(JumpGate(LIMITS), 1, (0, 0, 0), Rotation.from_rotvec([0, 0.22, 0]))
    assert isinstance(turned, Rejection)
    assert "0.22 rad" in turned.text


def test_a_long_pause_makes_no_jump_believable():
    assert isinstance(judge(JumpGate(LIMITS), 1000, (0.14, 0, 0)), Rejection)
    assert judge(JumpGate(LIMITS), 1000, (0.12, 0, 0)) is None


def test_the_first_pose_is_believed():
    assert JumpGate(LIMITS).judge(0, np.full(3, 9.0), LEVEL, None) is None


def test_outliers_that_agree_are_a_new_place():
    gate = JumpGate(LIMITS)
    # They may move, as a head does.
    results = [judge(gate, k, (0.5 + 0.001 * k, 0, 0)) for k in range(1, 12)]
    assert all(isinstance(result, Rejection) for result in results[:10])
    found = results[10]
    assert isinstance(found, NewPlace)
    assert found.poses == 11
    assert found.distance_m == pytest.approx(0.511)


def test_a_small_step_does_not_become_believable_by_waiting():
    # After 0.1 s a head may be 0.13 m away, but this one was there after 0.01 s.
    gate = JumpGate(LIMITS)
    results = [judge(gate, k, (0.1, 0, 0)) for k in range(1, 12)]
    assert all(isinstance(result, Rejection) for result in results[:10])
    assert isinstance(results[10], NewPlace)
    back = JumpGate(LIMITS)
    judge(back, 1, (0.1, 0, 0))
    assert judge(back, 2, (0.01, 0, 0)) is None


def test_they_must_last_for_the_horizon_however_many_there_are():
    gate = JumpGate(LIMITS)
    quick = [gate.judge(k * 1_000_000, np.array([0.5, 0, 0]), LEVEL, HERE) for k in range(1, 102)]
    assert all(isinstance(result, Rejection) for result in quick[:100])
    assert isinstance(quick[100], NewPlace)


def test_one_good_pose_begins_the_count_anew():
    gate = JumpGate(LIMITS)
    for k in range(1, 100):
        result = judge(gate, k, (0.5, 0, 0) if k % 10 else (0, 0, 0))
        assert not isinstance(result, NewPlace)


def test_outliers_that_do_not_agree_never_are():
    gate = JumpGate(dataclasses.replace(LIMITS, new_place_after=2))
    rng = np.random.default_rng(4)
    for k in range(1, 200):
        place = (2.0 * (k % 2) + 1.0, *rng.normal(0, 0.01, 2))
        assert isinstance(judge(gate, k, place), Rejection)
