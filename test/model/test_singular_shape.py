"""The singular shapes of Fig. 5 and the measure of how near the robot is to one."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.model.geometry import PlanarBase, planar_base
from snake_control.model.singular_shape import ShapeKind, singular_shape
from snake_control.model.structure import structure
from support.robots import PAPER, ROBOTS

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))


def base_of(robot: RobotConfig, angles: np.ndarray) -> PlanarBase:
    return planar_base(structure(robot), angles)


def some_angles(robot: RobotConfig, seed: int) -> np.ndarray:
    n_b = structure(robot).n_b
    return np.random.default_rng(seed).uniform(-0.6, 0.6, n_b - 1)


def with_links(g: PlanarBase, forward: np.ndarray, middles: np.ndarray) -> PlanarBase:
    """The same with other directions and centres of links, x + i y each."""
    other = copy.copy(g)
    other.forward, other.middles = forward, middles
    return other


def moved(g: PlanarBase, angle: float, shift: complex) -> PlanarBase:
    turn = np.exp(1j * angle)
    return with_links(g, g.forward * turn, g.middles * turn + shift)


@ALL
def test_a_straight_base_has_parallel_axes(robot):
    found = singular_shape(base_of(robot, np.zeros(structure(robot).n_b - 1)))
    assert found.nearness == pytest.approx(1.0, abs=1e-7)
    assert found.kind is ShapeKind.PARALLEL
    assert found.is_singular


def test_folded_at_right_angles_has_parallel_axes_too():
    """The wheelless links 7, 9, 11 stand across; the wheeled ones are parallel."""
    right = np.pi / 2
    found = singular_shape(base_of(PAPER, np.array([right, -right, -right, right, right, -right])))
    assert found.nearness == pytest.approx(1.0, abs=1e-7)
    assert found.kind is ShapeKind.PARALLEL


@ALL
@pytest.mark.parametrize("bend", [0.2, -0.45])
def test_an_arc_has_axes_through_its_center(robot, bend):
    g = base_of(robot, np.full(structure(robot).n_b - 1, bend))
    found = singular_shape(g)
    assert found.nearness == pytest.approx(1.0, abs=1e-7)
    assert found.kind is ShapeKind.ARC
    # Link centres touch a circle of this radius; it lies to the left for a left bend behind.
    radius = robot.half_length_m / np.tan(bend / 2)
    expected = g.centers[0] - radius * g.y[0]
    np.testing.assert_allclose(found.center, expected, atol=1e-6 * abs(radius))


@ALL
def test_place_heading_and_size_do_not_matter(robot):
    angles = some_angles(robot, 3)
    g = base_of(robot, angles)
    expected = singular_shape(g)
    elsewhere = singular_shape(moved(g, 2.3, 7.0 - 4.0j))
    assert elsewhere.nearness == pytest.approx(expected.nearness, abs=1e-9)
    assert elsewhere.kind is expected.kind
    larger = dataclasses.replace(robot, half_length_m=11 * robot.half_length_m)
    assert singular_shape(base_of(larger, angles)).nearness == pytest.approx(
        expected.nearness, abs=1e-12
    )


@ALL
@pytest.mark.parametrize("bend", [0.0, 0.3])
def test_it_rises_all_the_way_to_a_singular_shape(robot, bend):
    aside = 0.3 * some_angles(robot, 4)
    shares = np.linspace(1.0, 0.0, 21)
    found = [singular_shape(base_of(robot, bend + share * aside)).nearness for share in shares]
    assert np.all(np.diff(found) > 0)
    assert found[0] < 0.96
    assert found[-1] == pytest.approx(1.0, abs=1e-7)


def test_it_is_between_0_and_1():
    found = [singular_shape(base_of(PAPER, 3 * some_angles(PAPER, i))).nearness for i in range(200)]
    assert min(found) > 0
    assert max(found) < 1
    assert max(found) - min(found) > 0.5


def test_wheels_that_resist_all_motions_alike_are_as_far_as_can_be():
    g = base_of(PAPER, some_angles(PAPER, 0))
    around = np.pi / 4 + np.pi / 2 * np.arange(4)
    forward, middles = g.forward.copy(), g.middles.copy()
    middles[g.s.wheeled] = np.exp(1j * around)
    # At half a right angle to the spoke, the axes are spread over directions and moments alike.
    forward[g.s.wheeled] = np.exp(1j * (around + np.pi / 4))
    found = singular_shape(with_links(g, forward, middles))
    # Two directions share 4 between them, the moment has 2: trace 6, lambda_min 2.
    assert found.nearness == pytest.approx(0.0, abs=1e-12)
