"""Every sub-task: gradient against finite differences, finite in all postures, exact values."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from snake_control.config import (
    BASE_SUB_TASKS,
    HEAD_SUB_TASKS,
    Circle,
    ControllerConfig,
    RobotConfig,
)
from snake_control.control.sub_tasks import BUILT_IN
from snake_control.model.clearance import clearances
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.geometry import geometry
from snake_control.model.posture import Posture
from support.derivatives import gradient
from support.robots import PAPER, ROBOTS, random_q

HEADLESS = ("manipulability", "log_manipulability")


def circles_near(robot, q) -> tuple[Circle, ...]:
    """Circles at the first, a middle and the last base link, some of them overlapping it."""
    g = geometry(robot, q)
    centers = g.to_world(g.centers)[[0, len(g.centers) // 2, -1], :2]
    aside = 2 * robot.half_length_m * np.array([[0.4, 1.0], [1.1, -0.7], [-2.0, 0.3]])
    return tuple(
        Circle(float(x), float(y), radius * robot.half_length_m)
        for (x, y), radius in zip(centers + aside, (0.5, 1.0, 3.0), strict=True)
    )


def make(name, robot, q):
    if name == "joint_range":
        # So narrow that many joints are within the margin, and some beyond the end.
        robot = dataclasses.replace(robot, joint_limits_rad=(0.5,), start_joint_angles_rad=(0.0,))
    controller = ControllerConfig(
        obstacles=circles_near(robot, q), obstacle_margin_m=0.1, joint_range_margin_rad=0.3
    )
    return BUILT_IN[name](robot, controller)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
@pytest.mark.parametrize("name", BUILT_IN)
def test_gradient(name, robot, seed):
    if robot.planar and name in HEADLESS:
        return
    q = random_q(robot, seed)
    task = make(name, robot, q)
    expected = gradient(
        lambda x: task.value(Posture(robot, x)), q, h=1e-3 if "singularity" in name else 1e-5
    )
    found = task.gradient(Posture(robot, q))
    assert found.shape == q.shape
    assert np.abs(found).max() > 0
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
    # The parts that the composition reads are worked out by themselves in some sub-tasks.
    n_h = robot.head_links
    if name in HEAD_SUB_TASKS:
        np.testing.assert_array_equal(task.by_head(Posture(robot, q)), found[6 : 6 + n_h])
    if name in BASE_SUB_TASKS:
        np.testing.assert_array_equal(task.by_base(Posture(robot, q)), found[6 + n_h :])


def test_the_configuration_knows_the_same_names():
    assert set(BUILT_IN) == set(HEAD_SUB_TASKS) | set(BASE_SUB_TASKS)


def on_floor(robot, phi) -> np.ndarray:
    phi = np.asarray(phi, dtype=float)
    return np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi))


right = math.pi / 2
AWKWARD = {
    "all straight, singular head": np.zeros(11),
    "straight base": [-0.11, 0.1, 0.2, 0.0, 1.1] + [0.0] * 6,
    "arc": [-0.11, 0.1, 0.2, 0.0, 1.1] + [0.3] * 6,
    "folded": [-0.11, 0.1, 0.2, 0.0, 1.1, right, -right, -right, right, right, -right],
    "far beyond all ranges": [-0.11, 0.1, 0.2, 0.0, 1.1] + [1e3] * 6,
    "almost straight": [-0.11, 0.1, 0.2, 0.0, 1.1] + [1e-160] * 6,
}


@pytest.mark.parametrize("phi", AWKWARD.values(), ids=AWKWARD)
@pytest.mark.parametrize("name", BUILT_IN)
def test_gradients_are_finite_in_awkward_postures(name, phi):
    if name in ("log_singularity", "singularity") and phi is AWKWARD["all straight, singular head"]:
        return
    q = on_floor(PAPER, phi)
    found = make(name, PAPER, q).gradient(Posture(PAPER, q))
    assert np.isfinite(found).all()
    assert np.abs(found).max() < 1e30


def test_the_largest_V_b1_has_a_finite_gradient():
    robot = RobotConfig(
        links=200,
        wheelless_links=tuple(range(7, 200, 2)),
        joint_axes=PAPER.joint_axes[:5] + ("yaw",) * 194,
        start_joint_angles_rad=(0.0,),
    )
    q = random_q(robot, 1)
    posture = Posture(robot, q)
    assert posture.log_V_b1 > 230
    assert np.isfinite(make("singularity", robot, q).gradient(posture)).all()


def test_log_manipulability_where_V_h_is_below_what_doubles_hold():
    robot = RobotConfig(
        links=200,
        joint_axes=PAPER.joint_axes[:5] + ("yaw",) * 194,
        half_length_m=0.01,
        start_joint_angles_rad=(0.0,),
    )
    q = random_q(robot, 1)
    task = make("log_manipulability", robot, q)
    posture = Posture(robot, q)
    assert posture.V_h == 0.0
    expected = gradient(lambda x: task.value(Posture(robot, x)), q)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(task.gradient(posture), expected, atol=1e-6)
    np.testing.assert_array_equal(task.by_head(posture), task.gradient(posture)[6:11])


def test_scale_free_forms_do_not_see_the_size():
    large = dataclasses.replace(
        PAPER,
        half_length_m=5 * PAPER.half_length_m,
        wheel_offset_m=5 * PAPER.wheel_offset_m,
        wheel_radius_m=5 * PAPER.wheel_radius_m,
    )
    q = random_q(PAPER, 3)
    far = q.copy()
    far[:3] *= 5
    for name in ("log_manipulability", "wheel_axes", "relative_fall"):
        small, big = make(name, PAPER, q), make(name, large, far)
        assert big.value(Posture(large, far)) == pytest.approx(
            small.value(Posture(PAPER, q)), rel=1e-9
        )
        np.testing.assert_allclose(
            big.gradient(Posture(large, far))[6:],
            small.gradient(Posture(PAPER, q))[6:],
            rtol=1e-6,
            atol=1e-9,
        )


def test_log_singularity_in_singular_shapes_is_what_its_docstring_says():
    for bend in (0.0, 0.3):
        q = random_q(PAPER, 1)
        q[11:] = bend
        posture = Posture(PAPER, q)
        task = make("log_singularity", PAPER, q)
        assert -345.0 <= task.value(posture) < -50.0
        found = task.gradient(posture)
        assert 1.0 < np.abs(found).max() < 1e6


def test_joint_range_acts_within_its_margin_alone():
    controller = ControllerConfig(joint_range_margin_rad=0.5)
    task = BUILT_IN["joint_range"](PAPER, controller)

    def at(angle):
        phi = np.zeros(11)
        phi[7] = angle
        posture = Posture(PAPER, np.concatenate((np.zeros(6), phi)))
        return task.value(posture), task.gradient(posture)[13]

    assert at(1.89) == (0.0, 0.0)
    assert at(-1.89) == (0.0, 0.0)
    assert at(2.15) == pytest.approx((-0.125, -1.0))
    assert at(-2.4) == pytest.approx((-0.5, 2.0))


@pytest.mark.parametrize(
    ("center", "expected"),
    [
        # The first base link of a planar snake lies from (0, 0) to (-0.068, 0), 0.064 wide.
        ((-0.03, 0.10), 0.10 - 0.01 - 0.032),
        ((0.05, 0.0), 0.05 - 0.01 - 0.032),
        ((0.03, 0.04), 0.05 - 0.01 - 0.032),
        ((-0.03, 0.0), -0.01 - 0.032),
    ],
)
def test_clearance(center, expected):
    robot = dataclasses.replace(
        ROBOTS["planar"], half_length_m=0.034, wheel_offset_m=0.032, wheel_radius_m=0.02
    )
    g = geometry(robot, np.zeros(robot.links + 5))
    found = clearances(g, np.array([center]), np.array([0.01]))
    assert found.clearance.shape == (robot.links, 1)
    assert found.clearance[0, 0] == pytest.approx(expected)
    assert np.hypot(*found.away[0, 0]) == pytest.approx(1.0)


def test_obstacles_beyond_the_margin_do_nothing():
    q = random_q(PAPER, 1)
    far = ControllerConfig(obstacles=(Circle(5.0, 5.0, 0.1),))
    nothing = ControllerConfig(obstacles=())
    for controller in (far, nothing):
        task = BUILT_IN["obstacles"](PAPER, controller)
        assert task.value(Posture(PAPER, q)) == 0.0
        np.testing.assert_array_equal(task.gradient(Posture(PAPER, q)), 0.0)
