"""Trajectories in YAML and CSV: what they mean, and what is wrong with them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.errors import ConfigFileError
from snake_control.model.rotation import quaternion_from_rpy
from snake_control.trajectory.course_text import parse_course, read_course
from snake_control.trajectory.plan import Plan
from snake_control.trajectory.segments import Line, Poses, Settings

HEAD = np.array([0.3, -0.2, 0.2, 0.4, 0.3, 0.5])
EXAMPLES = sorted((Path(__file__).parents[2] / "config" / "trajectories").iterdir())


def plan(text: str, name: str = "file.yaml") -> Plan:
    return Plan(TrajectoryGeneratorConfig(), parse_course(text, name), Reference(HEAD, np.zeros(6)))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_the_examples_can_be_planned(path: Path) -> None:
    course = read_course(path)
    start = Reference(np.array([0, 0, 0.319, 0, -0.99, 0]), np.zeros(6))
    assert Plan(TrajectoryGeneratorConfig(), course, start).duration > 10.0


def test_every_kind_of_segment_and_its_settings() -> None:
    course = parse_course(
        """
        speed_m_s: 2e-2          # a number, although PyYAML would make it a text
        acceleration_m_s2: 1e-2
        join: blend
        segments:
          - line: {by: [0.1, 0, 0]}
          - line: {to: [0.1, 0.1, 0, 0, 0, 0.1], frame: segment, join: rest, speed_m_s: 1e-2}
          - line: {velocity: [0.01, 0, 0], duration_s: 5}
          - arc: {radius_m: -0.5, angle_rad: 0.5}
          - circle: {radius_m: 0.5}
          - eight: {radius_m: 0.4, rounds: 0.5}
          - waypoints: {poses: [[0.1, 0, 0], [0.2, 0, 0, 0, 0, 0.1]], times_s: [20, 40.0]}
          - hold: {duration_s: 2}
          - return_to_start
        """,
        "tour.yaml",
    )
    assert [s.kind for s in course.segments] == (
        ["line", "line", "line", "arc", "circle", "eight", "waypoints", "hold", "return_to_start"]
    )
    assert course.settings == Settings(join="blend", speed_m_s=0.02, acceleration_m_s2=0.01)
    second, poses = course.segments[1], course.segments[6]
    assert isinstance(second, Line)
    assert isinstance(poses, Poses)
    assert second.settings == Settings(frame="segment", join="rest", speed_m_s=0.01)
    assert poses.times_s == (20.0, 40.0)
    assert course.names[3] == "segment 4 (arc)"


def test_a_list_alone_is_a_trajectory_and_a_return_comes_back() -> None:
    made = plan("[{circle: {radius_m: 0.3, turns: 0.25}}, {return_to_start: {}}]")
    end = made.made()(0.0).sample(made.duration)
    np.testing.assert_allclose(end.w_d, HEAD, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "segments = None: give a list of segments"),
        ("speed_m_s: 0.1", "segments = None"),
        ("segments: []", r"segments = \[\]: give one or more"),
        ("frme: start\nsegments: [return_to_start]", "frme = 'start'.*did you mean frame"),
        (
            "frame: map\nsegments: [return_to_start]",
            "frame = 'map': allowed: start, segment, world",
        ),
        ("[3]", "segment 1 = 3: give one of line, arc"),
        ("[{lin: {}}]", "segment 1 = 'lin': allowed: line, arc"),
        ("[{line: {by: [0, 0, 1], to: [0, 0, 1]}}]", r"segment 1 \(line\): to, by, velocity"),
        ("[{line: {by: [0, 1]}}]", r"segment 1 \(line\): by = \[0.0, 1.0\]: give 3 numbers"),
        ("[{line: {by: [0, 1, '1e-3']}}]", r"by\[2\] = '1e-3': give a number"),
        ("[{line: {by: [0, 1, .nan]}}]", r"by\[2\] = nan: give a finite number"),
        ("[{line: {velocity: [0, 1, 0]}}]", "duration_s = None: give it with velocity"),
        ("[{line: {by: [0, 1, 0], speed: 0.1}}]", "speed = 0.1: .*did you mean speed_m_s"),
        ("[{line: {by: [0, 1, 0], speed_m_s: -1}}]", "speed_m_s = -1.*0.0001 to 1"),
        ("[return_to_start, {circle: {}}]", r"segment 2 \(circle\): radius_m = None: give it"),
        ("[{circle: {radius_m: 0}}]", "radius_m = 0.0: at least 0.001"),
        ("[{circle: {radius_m: 1, turns: 0}}]", "turns = 0"),
        ("[{hold: 3}]", r"segment 1 \(hold\): fields = 3: give a map of duration_s"),
        ("[{waypoints: {times_s: [1]}}]", "poses = None: give a list of poses"),
        ("[{waypoints: {poses: [[1, 2, 3], [1, 2]]}}]", r"poses\[1\] = \[1.0, 2.0\]"),
        ("[{waypoints: {poses: [[1, 2, 3]], times_s: [1, 2]}}]", "give one for each of 1 poses"),
        ("[{return_to_start: {radius_m: 1}}]", r"segment 1 \(return_to_start\): radius_m = 1"),
        ("- line: {by: [1,", "is not valid YAML"),
    ],
)
def test_a_mistake_in_yaml_is_named_with_file_segment_field_and_value(text, words) -> None:
    with pytest.raises(ConfigFileError, match=f"^tour.yaml: .*{words}"):
        parse_course(text, "tour.yaml", is_csv=False)


TIMED = """# metres, radians
t,x,y,z,roll,pitch,yaw
5,0.3,-0.2,0.2,0.4,0.3,0.5

15,0.4,-0.2,0.2,0.4,0.3,0.5
"""


def test_times_of_a_table_count_from_its_first_row() -> None:
    made = plan(TIMED)
    assert made.duration == pytest.approx(10.0)
    assert made.where(8.0) == "line 5"


def test_the_head_first_goes_to_the_first_row_and_rests_there() -> None:
    made = plan(TIMED.replace("0.3,-0.2", "0.3,-0.1", 1).replace("0.4,-0.2", "0.4,-0.1"))
    assert made.duration == pytest.approx(10.0 + 0.1 / 0.01 + 1.0)
    assert made.where(3.0) == "on the way to line 3"
    at = made.made()(0.0).sample(11.0)
    np.testing.assert_allclose(at.w_d[:2], [0.3, -0.1], atol=1e-9)
    np.testing.assert_allclose(at.w_d_dot, 0.0, atol=1e-9)


def test_without_times_a_table_is_followed_at_a_speed() -> None:
    rows = [f"{0.3 + 0.01 * i},-0.2,0.2,0.4,0.3,0.5" for i in range(11)]
    made = plan("x,y,z,roll,pitch,yaw\n" + "\n".join(rows))
    assert made.duration == pytest.approx(11.0, rel=1e-3)


@given(
    rpy=st.tuples(st.floats(-3, 3), st.floats(-1.3, 1.3), st.floats(-3, 3)),
    order=st.permutations(["t", "x", "y", "z", "qx", "qy", "qz", "qw"]),
)
def test_quaternions_and_any_order_of_columns(rpy, order) -> None:
    q = dict(zip(("qx", "qy", "qz", "qw"), quaternion_from_rpy(rpy), strict=True))
    values = {"t": 1.0, "x": 1.0, "y": 2.0, "z": 0.3} | q
    text = ",".join(order) + "\n" + ",".join(f"{values[c]:.12g}" for c in order)
    course = parse_course(text, "poses.csv")
    [line] = course.segments
    assert isinstance(line, Line)
    assert line.to is not None
    np.testing.assert_allclose(line.to[:3], [1.0, 2.0, 0.3])
    off = [math.remainder(a - b, math.tau) for a, b in zip(line.to[3:], rpy, strict=True)]
    np.testing.assert_allclose(off, 0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1 = None: it has no header"),
        ("0,0,0,0,0,0\n", "line 1 = '0,0,0,0,0,0': give x,y,z"),
        ("t,x,y,z,roll,pitch\n", "line 1 = 't,x,y,z,roll,pitch': give x,y,z"),
        ("t,x,y,z,roll,pitch,yaw,speed\n", "line 1 = "),
        ("x,y,z,roll,pitch,yaw\n", "line 1 = .*: no poses follow"),
        ("x,y,z,roll,pitch,yaw\n0,0,0,0,0\n", "line 2 = '0,0,0,0,0': give 6 values"),
        ("x,y,z,roll,pitch,yaw\n#\n0,0,0,0,0,a\n", "line 3: yaw = 'a': give a number"),
        ("x,y,z,roll,pitch,yaw\n0,0,0,0,0,inf\n", "line 2: yaw = 'inf': give a finite number"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,1,1,0,0\n", "line 2: qx,qy,qz,qw = .* this one has 1.41"),
        (TIMED.replace("15,", "5,"), "line 5: t = 5.0: more than 5"),
    ],
)
def test_a_mistake_in_a_table_is_named_with_its_line(text, words) -> None:
    with pytest.raises(ConfigFileError, match=f"^poses.csv: {words}"):
        parse_course(text, "poses.csv", is_csv=True)


def test_a_missing_file_and_one_that_is_no_text(tmp_path: Path) -> None:
    with pytest.raises(ConfigFileError, match=r"none.csv: cannot be read: No such file"):
        read_course(tmp_path / "none.csv")
    path = tmp_path / "binary.csv"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigFileError, match="is no text in UTF-8"):
        read_course(path)


@given(st.text(max_size=60))
def test_any_text_is_a_trajectory_or_a_clear_error(text: str) -> None:
    for is_csv in (True, False):
        try:
            parse_course(text, "some", is_csv)
        except ConfigFileError as error:
            assert str(error).startswith("some: ")  # noqa: PT017
