"""Trajectories come from a file with one clear error for each mistake, or are built in."""

import math

import numpy as np
import pytest

from snake_control.errors import ConfigError, ConfigFileError
from snake_control.experiment.study.trajectories import built_in, read_trajectories
from support.robots import PAPER, ROBOTS

GOOD = """
straight: {kind: line, start_pose: [0, 0, 0.2, 0.39, 0.39, 0], velocity: [1e-2, 0, 0, 0, 0, 0]}
left: {kind: arc, start_pose: [0, 0, 0.2, 0, 0, 0], speed_m_s: 0.01, radius_m: 0.5}
"""


def test_built_in_begins_with_table_1():
    names = [trajectory.name for trajectory in built_in(PAPER)]
    assert len(set(names)) == len(names) == 3
    first = built_in(PAPER)[0].make().sample(10.0)
    np.testing.assert_allclose(first.w_d, [0.1, 0, 0.2, math.pi / 8, math.pi / 8, 0])
    longer = built_in(ROBOTS["long head, two H-SCPs"])[0].make().sample(0.0)
    assert longer.w_d[2] == pytest.approx(0.2 * 0.05 / 0.034)


def test_a_file(tmp_path):
    path = tmp_path / "t.yaml"
    path.write_text(GOOD)
    straight, left = read_trajectories(path)
    np.testing.assert_allclose(straight.make().sample(2.0).w_d[:2], [0.02, 0])
    assert left.make().sample(10.0).w_d[5] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: {kind: spiral}", "a.kind = 'spiral': allowed: line, arc"),
        ("a: {kind: line, start_pose: [0, 0], velocity: [0, 0, 0, 0, 0, 0]}", "a.start_pose"),
        ("a: {kind: line, start_pose: [0, 0, 0, 0, 0, .nan]}", r"a.start_pose\[5\]"),
        ("a: {kind: line, start_pose: [0, 0, 0, 0, 0, 0]}", "a.velocity = None"),
        ("a: {kind: arc, start_pose: [0, 0, 0, 0, 0, 0], speed_m_s: 0, radius_m: 1}", "speed_m_s"),
        ("a: {kind: arc, start_pose: [0, 0, 0, 0, 0, 0], speed_m_s: 1, radius_m: 0}", "radius_m"),
        ("a: {kind: arc, start_pose: [0, 0, 0, 0, 0, 0], velocity: 1}", "a.velocity = 1: allowed"),
        ("a: 3", "a = 3"),
        ("a: {kind: [line]}", r"a.kind = \['line'\]: allowed: line, arc"),
        ("a: {kind: line, start_pose: [0, 0, 0, 0, 0, 1" + 400 * "0" + "]}", "a.start_pose"),
    ],
)
def test_a_mistake_is_named(tmp_path, text, words):
    path = tmp_path / "t.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words):
        read_trajectories(path)


@pytest.mark.parametrize("text", ["[]", "", "a: [", "a: 2001-13-01", b"\xff\xfe", None])
def test_a_file_that_is_no_map(tmp_path, text):
    path = tmp_path / "t.yaml"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigFileError, match=r"t\.yaml"):
        read_trajectories(path)
