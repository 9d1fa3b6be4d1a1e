"""From a course to a motion that begins where the head is."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.errors import TrajectoryError
from snake_control.trajectory.plan import Course, Plan, at_speed, course_through
from snake_control.trajectory.segments import (
    Arc,
    Eight,
    Line,
    Poses,
    Segment,
    Settings,
    WholeCircle,
)

CONFIG = TrajectoryGeneratorConfig()
HEAD = np.array([0.1, -0.2, 0.2, 0.3, 0.4, 0.5])
REST = Reference(HEAD, np.zeros(6))
WORLD = Settings(frame="world")


def ahead(*ways: float) -> np.ndarray:
    poses = np.tile(HEAD, (len(ways), 1))
    poses[:, 0] += ways
    return poses


def through(poses: np.ndarray, times: list[float] | None = None) -> Course:
    rows = tuple(tuple(row) for row in np.atleast_2d(poses).tolist())
    return Course(
        (Poses(poses=rows, times_s=None if times is None else tuple(times), settings=WORLD),)
    )


def test_it_begins_where_the_head_is_and_takes_the_usual_speed() -> None:
    plan = Plan(CONFIG, through(ahead(0.05, 0.1)), REST)
    ramp = 2 * CONFIG.speed_m_s / CONFIG.acceleration_m_s2
    assert plan.duration == pytest.approx(0.1 / CONFIG.speed_m_s + ramp)
    assert plan.length == pytest.approx(0.1)
    motion = plan.made()(7.0)
    np.testing.assert_allclose(motion.sample(7.0).w_d, HEAD, atol=1e-12)
    np.testing.assert_allclose(motion.sample(7.0).w_d_dot, 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.sample(12.5).w_d[0], HEAD[0] + 0.05, atol=1e-9)
    np.testing.assert_allclose(motion.sample(18.0).w_d[0], HEAD[0] + 0.1, atol=1e-9)


def test_it_takes_over_from_a_motion_without_a_jump() -> None:
    moving = Reference(HEAD, np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.1]), time_scale=0.5)
    plan = Plan(CONFIG, through(ahead(0.05), [4.0]), moving)
    motion = plan.made()(0.0)
    np.testing.assert_allclose(motion.sample(0.0).w_d, HEAD, atol=1e-12)
    np.testing.assert_allclose(motion.sample(0.0).w_d_dot, 0.5 * moving.w_d_dot, atol=1e-12)
    assert plan.duration == pytest.approx(4.0)
    np.testing.assert_allclose(motion.sample(4.0).w_d, ahead(0.05)[0], atol=1e-12)


def test_poses_are_relative_to_the_start_the_segment_or_the_world() -> None:
    c, s = math.cos(HEAD[5]), math.sin(HEAD[5])
    to = (0.1, 0.05, 0.01, 0.0, 0.1, 0.2)

    def end(frame: str) -> np.ndarray:
        course = Course((Line(by=(0.0, 0.0, 0.02)), Line(to=to, settings=Settings(frame=frame))))
        plan = Plan(TrajectoryGeneratorConfig(speed_m_s=0.04), course, REST)
        return plan.made()(0.0).sample(plan.duration).w_d

    from_start = HEAD + [0.1 * c - 0.05 * s, 0.1 * s + 0.05 * c, 0.01, 0.0, 0.1, 0.2]
    np.testing.assert_allclose(end("start"), from_start)
    np.testing.assert_allclose(end("segment"), from_start + [0, 0, 0.02, 0, 0, 0])
    np.testing.assert_allclose(end("world"), to, atol=1e-12)


def test_where_names_segment_and_pose() -> None:
    course = Course(
        (Line(by=(0.1, 0, 0)), Poses(poses=((0.1, 0.1, 0), (0, 0.1, 0)), names=("p", "q"))),
        names=("segment 1", "segment 2"),
    )
    plan = Plan(CONFIG, course, REST)
    assert plan.where(1.0) == "segment 1"
    assert plan.where(14.0) == "segment 2, p"
    assert plan.where(plan.duration) == "segment 2, q"


@pytest.mark.parametrize(
    ("course", "words"),
    [
        (through(ahead(0.1), [0.0]), r"poses\[0\] is to be reached at 0 s"),
        (through(ahead(0.1), [-3.0]), r"poses\[0\] comes at -3 s, not after where it begins"),
        (through(ahead(0.1, 0.2), [9.0, 8.0]), r"poses\[1\] comes at 8 s"),
        (through(ahead(math.nan)), r"poses\[0\] is not finite"),
        (through(ahead(0.1), [1.0]), r"poses\[0\]: the head would move at 0.18. m/s after 0.5 s"),
        (through(HEAD + [[0, 0, 0, 0, 0, 2.0]], [5.0]), "turn at 0.7.* rad/s .* max_angular_speed"),
        (through(HEAD + [[0, 0, 0, 0, 1.1, 0]]), r"poses\[0\]: pitch 1.5 rad"),
        (through(ahead(0.01), [0.6]), r"poses\[0\]: the head would speed up by 0.16 m/s.2 after"),
        (through(HEAD[None]), "no way to go"),
    ],
)
def test_what_cannot_be_is_refused_with_what_and_where(course: Course, words: str) -> None:
    with pytest.raises(TrajectoryError, match=words):
        Plan(CONFIG, course, REST)


@pytest.mark.parametrize(
    ("segment", "words"),
    [
        (Line(by=(0.1, 0, 0), settings=Settings(speed_m_s=0.5)), "speed_m_s = 0.5: at most max_l"),
        (Line(by=(0.1, 0, 0), settings=Settings(turning_speed_rad_s=1.0)), "turning_speed_rad_s"),
        (Line(by=(0.1, 0, 0), settings=Settings(acceleration_m_s2=2.0)), "acceleration_m_s2 = 2"),
        (Line(velocity=(0.1, 0, 0), duration_s=10.0), "would move at 0.1 m/s"),
        (WholeCircle(radius_m=0.08), "the curve at x = .* has a radius of 0.08"),
        (WholeCircle(radius_m=-0.08), "the curve at"),
        (Eight(radius_m=0.06), "the curve at"),
        (Line(by=(0, 0, 0, 0, 0, 2.0)), "has a radius of 0 m and goes on for more than 1.2 rad"),
    ],
)
def test_a_refusal_names_the_segment(segment: Segment, words: str) -> None:
    course = Course((Line(by=(0.01, 0, 0)), segment), names=("segment 1", "segment 2"))
    with pytest.raises(TrajectoryError, match=f"^segment 2: .*{words}"):
        Plan(CONFIG, course, REST)


@pytest.mark.parametrize(
    ("poses", "times", "words"),
    [(np.empty((0, 6)), [], "no poses"), (ahead(0.1, 0.2), [1.0], "1 times for 2 poses")],
)
def test_wrong_poses_are_refused(poses: np.ndarray, times: list[float], words: str) -> None:
    with pytest.raises(TrajectoryError, match=words):
        course_through(poses, times)


def test_a_speed_from_outside_counts_where_nobody_said_one() -> None:
    course = course_through(ahead(0.1))
    assert Plan(CONFIG, at_speed(course, 0.02, 0.0), REST).duration == pytest.approx(7.0)
    said = dataclasses.replace(course, settings=Settings(frame="world", speed_m_s=0.01))
    assert Plan(CONFIG, at_speed(said, 0.02, 0.0), REST).duration == pytest.approx(11.0)
    for speed, turning, words in (
        (-1.0, 0.0, "speed is -1.0"),
        (0.0, math.nan, "turning_speed is"),
    ):
        with pytest.raises(TrajectoryError, match=words):
            at_speed(course, speed, turning)


@pytest.mark.parametrize("tight", [Arc(radius_m=0.08, angle_rad=1.1), WholeCircle(radius_m=0.11)])
def test_a_short_or_wider_curve_is_left_to_the_rehearsal(tight: Segment) -> None:
    assert Plan(CONFIG, Course((tight,)), REST).duration > 0.0
    loose = TrajectoryGeneratorConfig(min_turn_radius_m=0.0)
    assert Plan(loose, Course((WholeCircle(radius_m=0.05),)), REST).duration > 0.0
