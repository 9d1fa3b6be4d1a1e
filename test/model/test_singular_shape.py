"""The singular shapes of Fig. 5 and the measure of how near the robot is to one."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.model.geometry import PlanarBase, geometry, planar_base
from snake_control.model.singular_shape import ShapeKind, singular_shape
from snake_control.model.structure import structure
from snake_control.model.wheel_axes import axis_spread
from support.derivatives import gradient
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


def folded_up(robot: RobotConfig) -> np.ndarray:
    """All base links on one spot, each turned back on the one in front; exactly so for PAPER."""
    q = np.zeros(robot.links + 5)
    q[6 + robot.head_links :] = np.pi * np.where(np.arange(structure(robot).n_b - 1) < 4, 1, -1)
    return q


@ALL
@pytest.mark.filterwarnings("error")
def test_axes_through_one_spot_meet_there(robot):
    g = geometry(robot, folded_up(robot))
    found = singular_shape(g)
    assert found.nearness == pytest.approx(1.0, abs=1e-6)
    assert all(np.isfinite(found.center)) == (found.kind is ShapeKind.ARC)
    spread, by_q = axis_spread(g)
    assert spread == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite(by_q).all()


@pytest.mark.filterwarnings("error")
def test_the_spread_goes_on_without_a_jump_to_where_all_centres_coincide():
    """Directions differ, so that only the centres' coming together makes the spread vanish."""
    g = base_of(PAPER, some_angles(PAPER, 0))
    wheeled = g.s.wheeled
    forward, middles = g.forward.copy(), g.middles.copy()
    forward[wheeled] = np.exp(1j * np.array([0.0, 0.5, 1.3, 2.1]))
    arms = np.exp(1j * np.array([0.2, 1.9, 3.3, 5.1])) * PAPER.half_length_m

    def nearness(share: float) -> float:
        middles[wheeled] = share * arms
        return singular_shape(with_links(g, forward, middles)).nearness

    # Above a millionth of l the size does not matter, below it the axes count as meeting.
    assert nearness(1e-5) == pytest.approx(nearness(1.0), abs=1e-9)
    below = [nearness(share) for share in (1e-6, 1e-7, 1e-8, 0.0)]
    assert below == sorted(below)
    assert nearness(1.0) < 0.9
    assert below[-1] == pytest.approx(1.0)


def closed_chains() -> tuple[RobotConfig, np.ndarray]:
    """A base whose four wheeled links stand on one spot, in different directions."""
    robot = RobotConfig(
        links=15,
        wheelless_links=(7, 8, 10, 11, 13, 14),
        joint_axes=PAPER.joint_axes[:5] + ("yaw",) * 9,
        start_joint_angles_rad=(0.0,),
    )
    heading, headings = 0.0, [0.0]
    for turn in (1.0, 0.7, 0.9):
        # Two links between lead from one wheeled link's rear end to the next one's front end.
        back = heading + turn / 2 + np.pi
        aside = np.arccos(np.cos(turn / 2) / 2)
        heading += turn
        headings += [back + aside, back - aside, heading]
    q = np.zeros(20)
    q[11:] = np.diff(headings)
    return robot, q


@pytest.mark.parametrize("bend", [1e-3, 1e-7])
def test_gradient_of_the_spread_beside_wheels_on_one_spot(bend):
    """Above the smallest extent, and below it, where the extent counts as constant."""
    robot, q = closed_chains()
    assert np.ptp(geometry(robot, q).centers[[0, 3, 6, 9]], axis=0).max() < 1e-15
    q[11:] += bend * np.array([1.0, -0.7, 0.4, 0.9, -1.1, 0.3, 0.6, -0.2, 0.8])

    def value(x):
        return axis_spread(geometry(robot, x))[0]

    found = axis_spread(geometry(robot, q))[1]
    expected = gradient(value, q, 1e-2 * bend)
    assert np.abs(expected).max() > 1e-3
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())
