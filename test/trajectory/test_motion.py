"""Motions one after the other: no jump in pose, rate or acceleration, whatever is joined."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.trajectory.motion import Braking, Motion
from snake_control.trajectory.plan import Course, Plan
from snake_control.trajectory.segments import (
    Arc,
    Eight,
    Line,
    Pause,
    Poses,
    Return,
    Segment,
    Settings,
    WholeCircle,
)

CONFIG = TrajectoryGeneratorConfig()
HEAD = np.array([0.3, -0.2, 0.2, 0.4, 0.3, 0.5])
H = 1e-5


def small(limit: float) -> st.SearchStrategy[float]:
    return st.floats(-limit, limit).map(lambda x: round(x, 4))


WAYS = st.tuples(small(0.3), small(0.3), small(0.02), small(0.2), small(0.2), small(0.3))
SETTINGS = st.builds(
    Settings,
    frame=st.sampled_from((None, "start", "segment")),
    join=st.sampled_from((None, "rest", "blend")),
    speed_m_s=st.sampled_from((None, 0.005, 0.02, 0.03)),
    turning_speed_rad_s=st.just(0.1),
    acceleration_m_s2=st.sampled_from((None, 0.01, 0.04)),
)
RADII = st.sampled_from((-0.5, 0.25, 0.4))
SEGMENTS: st.SearchStrategy[Segment] = st.one_of(
    st.builds(Line, by=WAYS, settings=SETTINGS),
    st.builds(Line, by=st.tuples(small(0.3), small(0.3), small(0.02)), settings=SETTINGS),
    st.builds(
        Line,
        velocity=st.tuples(small(0.02), small(0.02), small(0.005)),
        duration_s=st.floats(0.1, 20.0),
        settings=SETTINGS,
    ),
    st.builds(Arc, radius_m=RADII, angle_rad=st.floats(0.05, 2.0), settings=SETTINGS),
    st.builds(WholeCircle, radius_m=RADII, turns=st.floats(0.02, 1.0), settings=SETTINGS),
    st.builds(Eight, radius_m=RADII, rounds=st.floats(0.02, 0.5), settings=SETTINGS),
    st.builds(Pause, duration_s=st.floats(0.1, 5.0), settings=SETTINGS),
    st.builds(Return, settings=SETTINGS),
    st.builds(
        Poses,
        poses=st.lists(WAYS, min_size=1, max_size=4).map(tuple),
        settings=st.builds(Settings, frame=st.just("segment"), turning_speed_rad_s=st.just(0.1)),
    ),
    st.builds(
        Poses,
        poses=st.tuples(WAYS, WAYS),
        times_s=st.just((40.0, 95.0)),
        settings=st.builds(Settings, frame=st.just("start")),
    ),
)
# Braking from less takes some ten steps of the differences, which say nothing then.
RATES = st.tuples(small(0.03), small(0.03), small(0.01), small(0.1), small(0.1), small(0.1)).map(
    lambda rates: np.where(np.abs(rates) < 2e-3, 0.0, rates)
)


# What is smooth is smooth at any speed.
FREE = TrajectoryGeneratorConfig(
    max_linear_speed_m_s=10.0,
    max_angular_speed_rad_s=10.0,
    max_linear_acceleration_m_s2=0.1,
    min_turn_radius_m=0.0,
)


def assert_smooth(motion, t: list[float]) -> None:
    """Rate and acceleration are the derivatives of pose and rate, at every time."""
    for x in t:
        before, at, after = (motion.sample(x + k * H) for k in (-1, 0, 1))
        np.testing.assert_allclose((after.w_d - before.w_d) / (2 * H), at.w_d_dot, atol=1e-6)
        change = (after.w_d_dot - before.w_d_dot) / (2 * H)
        # A jump of the acceleration would be of the order of 1e-2; short braking changes it by 40
        # rad/s^3, which a difference of this width sees.
        np.testing.assert_allclose(change, at.w_d_ddot, atol=1e-3)


@settings(max_examples=60, deadline=None)
@given(segments=st.lists(SEGMENTS, min_size=1, max_size=5), rate=RATES)
def test_a_course_is_smooth_across_its_segments(segments, rate) -> None:
    try:
        plan = Plan(FREE, Course(tuple(segments)), Reference(HEAD, rate))
    except ValueError as error:
        # Ways that lead nowhere, or too steep ones, may come up.
        assert any(w in str(error) for w in ("no way to go", "pitch", "speed up"))  # noqa: PT017
        return
    motion = plan.made()(7.0)
    first, last = motion.sample(7.0), motion.sample(7.0 + plan.duration)
    np.testing.assert_allclose(first.w_d, HEAD, atol=1e-12)
    np.testing.assert_allclose(first.w_d_dot, rate, atol=1e-12)
    np.testing.assert_allclose(last.w_d_dot, 0.0, atol=1e-9)
    np.testing.assert_array_equal(motion.sample(1e6).w_d_dot, np.zeros(6))
    t = [7.0 + x for join in plan.begins for x in (join - 1e-4, join, join + 1e-4)]
    t += np.linspace(7.0 + 2 * H, 7.0 + plan.duration - 2 * H, 60).tolist()
    assert_smooth(motion, [x for x in t if 7.0 + H < x < 7.0 + plan.duration - H])


@settings(max_examples=50, deadline=None)
@given(rate=RATES, acceleration=RATES, scale=st.floats(0.05, 1.0))
def test_braking_takes_over_rate_and_acceleration(rate, acceleration, scale) -> None:
    motion: Motion = Braking(Reference(HEAD, rate, acceleration, scale), 0.1, 1.0)
    first = motion.sample(0.0)
    if motion.duration == 0.0:
        assert not rate.any()
        return
    np.testing.assert_allclose(first.w_d_dot, scale * rate, atol=1e-12)
    np.testing.assert_allclose(first.w_d_ddot, scale**2 * acceleration, atol=1e-12)
    end = motion.sample(motion.duration)
    np.testing.assert_allclose(end.w_d_dot, 0.0, atol=1e-12)
    np.testing.assert_allclose(end.w_d_ddot, 0.0, atol=1e-9)
    h = 1e-5 * motion.duration
    for x in np.linspace(0.1, 0.9, 5) * motion.duration:
        before, at, after = (motion.sample(x + k * h) for k in (-1, 0, 1))
        np.testing.assert_allclose((after.w_d - before.w_d) / (2 * h), at.w_d_dot, atol=1e-6)
        np.testing.assert_allclose(
            (after.w_d_dot - before.w_d_dot) / (2 * h), at.w_d_ddot, atol=1e-4 / motion.duration
        )


def lines(join: str) -> Plan:
    square = [(0.1, 0, 0), (0, 0.1, 0), (-0.1, 0, 0)]
    parts = tuple(Line(by=way) for way in square)
    return Plan(CONFIG, Course(parts, Settings(join=join, speed_m_s=0.02)), rest())


def rest() -> Reference:
    return Reference(HEAD, np.zeros(6))


def test_rest_stops_at_a_corner_and_blend_cuts_it() -> None:
    stopping, blended = lines("rest"), lines("blend")
    ramp = 2 * 0.02 / CONFIG.acceleration_m_s2
    assert blended.duration == pytest.approx(stopping.duration - 2 * ramp)
    c, s = math.cos(HEAD[5]), math.sin(HEAD[5])
    corner = HEAD[:2] + 0.1 * np.array([c, s])

    def nearest(plan: Plan) -> tuple[float, float]:
        motion = plan.made()(0.0)
        seen = [motion.sample(t) for t in np.linspace(0.0, plan.duration, 2001)]
        inner = [motion.sample(t) for t in np.linspace(ramp, plan.duration - ramp, 2001)]
        return (
            min(float(np.linalg.norm(r.w_d[:2] - corner)) for r in seen),
            min(float(np.linalg.norm(r.w_d_dot[:2])) for r in inner),
        )

    missed, slowest = nearest(stopping)
    assert missed < 1e-5
    assert slowest < 1e-4
    missed, slowest = nearest(blended)
    # Half way through the corner each of both has 0.0743 speed times ramp to go.
    assert missed == pytest.approx(math.sqrt(2) * 0.0743 * 0.02 * ramp, rel=0.01)
    assert slowest > 0.013


def test_lines_that_go_on_straight_are_blended_into_one() -> None:
    parts = (Line(by=(0.1, 0, 0)), Line(by=(0.1, 0, 0), settings=Settings(join="blend")))
    two = Plan(CONFIG, Course(parts), rest())
    one = Plan(CONFIG, Course((Line(by=(0.2, 0, 0)),)), rest())
    assert two.duration == pytest.approx(one.duration)
    for t in np.linspace(0.0, one.duration, 50):
        a, b = two.made()(0.0).sample(t), one.made()(0.0).sample(t)
        np.testing.assert_allclose(a.w_d, b.w_d, atol=1e-9)
        np.testing.assert_allclose(a.w_d_dot, b.w_d_dot, atol=1e-9)


def test_no_more_than_two_motions_overlap() -> None:
    parts = tuple(Line(by=(0.001 * k, 0, 0), settings=Settings(join="blend")) for k in (9, 1, 2))
    plan = Plan(CONFIG, Course(parts), Reference(HEAD, np.array([0.02, 0, 0, 0, 0, 0])))
    motion = plan.made()(0.0)
    assert_smooth(motion, np.linspace(2 * H, plan.duration - 2 * H, 200).tolist())
