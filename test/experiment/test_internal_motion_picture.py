"""The picture of the internal motion: what it shows is what the plant did."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.image import imread

from snake_control.experiment.internal_motion import describe, draw, internal_motions, save
from support.robots import PAPER, ROBOTS

PHASES = (-0.1, 0.0, 0.1)


@pytest.fixture(scope="module")
def motions():
    return internal_motions(PAPER, phases=PHASES)


def test_each_scp_turns_its_own_joints_and_the_head_stays(motions):
    assert [motion.joint for motion in motions] == [3, 6, 8, 10]
    by_joint = {motion.joint: motion.joints for motion in motions}
    assert by_joint[6] == (6, 7, 9, 11)
    assert by_joint[8] == (8, 9, 11)
    assert by_joint[10] == (10, 11)
    # The neck is straight at the start: its yaw joints 2 and 4 have nothing to do.
    assert by_joint[3] == (1, 3, 5, 7, 9, 11)
    for motion in motions:
        assert motion.head_moved.max() < 5e-5
        assert motion.body_moved_m > 100 * motion.head_moved[:3].max()
        turned = motion.q[:, 5 + motion.joint] - motion.q[1, 5 + motion.joint]
        np.testing.assert_allclose(turned, PHASES, atol=1e-12)
        assert f"phi_{motion.joint}: turns joints" in describe(motion)


def test_picture_has_a_column_for_each_and_a_row_for_each_phase(motions, tmp_path):
    figure = draw(motions, PAPER)
    axes = figure.get_axes()
    assert len(axes) == 4 * (len(PHASES) + 1)
    assert [a.get_title() for a in axes[:4]] == [
        r"H-SCP $\phi_{3}$",
        *(rf"B-SCP $\phi_{{{joint}}}$" for joint in (6, 8, 10)),
    ]
    save(motions, PAPER, tmp_path / "picture.png")
    assert imread(tmp_path / "picture.png")[..., :3].std() > 0.02


@pytest.mark.parametrize("name", ["fig_2", "planar"])
def test_other_robots(name):
    robot = ROBOTS[name]
    phi = 0.3 * np.cos(0.9 * np.arange(robot.joints)) if robot.planar else None
    motions = internal_motions(robot, phi, phases=(0.0, 0.05))
    assert [motion.joint for motion in motions] == list(robot.scp_joints)
    for motion in motions:
        assert motion.head_moved.max() < 5e-5
    assert draw(motions, robot).get_axes()
