"""The links as bodies, against the geometry and against what a search over points finds."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.model.bodies import Bodies
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.geometry import geometry, link_centers, link_points
from support.robots import PAPER, ROBOTS


def posture(robot: RobotConfig, seed: int, largest: float = 1.5) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-largest, largest, robot.joints)


def on_floor(robot: RobotConfig, phi: np.ndarray) -> np.ndarray:
    return np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi))


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(3))
def test_the_links_are_where_the_geometry_has_them(name, seed):
    robot = ROBOTS[name]
    phi = posture(robot, seed)
    q, bodies = on_floor(robot, phi), Bodies(robot, phi)
    np.testing.assert_allclose(bodies.centers, link_centers(geometry(robot, q)), atol=1e-12)
    ahead = -np.diff(link_points(robot, q), axis=0) / (2 * robot.half_length_m)
    np.testing.assert_allclose(bodies.frames[:, :, 0], ahead, atol=1e-12)
    for frame in bodies.frames:
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(5))
def test_the_lowest_corner_of_the_head_part_counts(seed):
    phi = posture(PAPER, seed)
    bodies = Bodies(PAPER, phi)
    half = np.array((PAPER.half_length_m, *(0.5 * np.array(PAPER.link_size_m))))
    corners = [
        center + frame @ (half * signs)
        for center, frame in zip(bodies.centers[:5], bodies.frames[:5], strict=True)
        for signs in itertools.product((-1, 1), repeat=3)
    ]
    assert bodies.ground_clearance == pytest.approx(min(corner[2] for corner in corners))


@pytest.mark.parametrize(
    ("neck", "clearance"),
    [(0.0, 0.02 - 0.016), (-0.1, 0.02 - 0.34 * np.sin(0.1) - 0.016 * np.cos(0.1))],
)
def test_a_head_that_is_bowed_goes_into_the_floor(neck, clearance):
    phi = np.zeros(11)
    phi[4] = neck
    assert Bodies(PAPER, phi).ground_clearance == pytest.approx(clearance)


def test_a_planar_snake_has_nothing_to_drive_into_the_floor():
    robot = ROBOTS["planar"]
    assert Bodies(robot, posture(robot, 1)).ground_clearance == np.inf


@pytest.mark.parametrize("name", ROBOTS)
def test_a_straight_robot_is_free_of_itself(name):
    robot = ROBOTS[name]
    assert Bodies(robot, np.zeros(robot.joints)).self_clearance > 0.0


@pytest.mark.parametrize("seed", range(6))
def test_how_near_two_links_are_is_what_a_search_over_their_points_finds(seed):
    phi = posture(PAPER, seed, largest=2.5)
    bodies = Bodies(PAPER, phi)
    along = np.linspace(-PAPER.half_length_m, PAPER.half_length_m, 141)
    lines = bodies.centers[:, None] + along[None, :, None] * bodies.frames[:, None, :, 0]
    thick = [0.025] * 12
    for link in PAPER.wheeled_links:
        thick[link - 1] = PAPER.wheel_offset_m
    least = np.inf
    for i, j in itertools.combinations(range(12), 2):
        if j == i + 1:
            continue
        apart = np.linalg.norm(lines[i][:, None] - lines[j][None, :], axis=2).min()
        free = min(thick[i] + thick[j], 0.9 * 0.068 * (j - i - 1))
        least = min(least, apart - free)
    # The search misses the nearest points by less than its step.
    assert -1e-9 <= least - bodies.self_clearance < 5e-4


def test_a_curled_body_is_in_itself():
    phi = np.zeros(11)
    phi[5:] = 1.2
    assert Bodies(PAPER, phi).self_clearance < -0.01
    phi[5:] = 0.6
    assert Bodies(PAPER, phi).self_clearance > 0.0
