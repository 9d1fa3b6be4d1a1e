from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from snake_control.model.convex_hull import convex_hull
from snake_control.model.floor import GRAVITY_M_S2, base_pose, gravity_efforts, head_pose_on_floor
from snake_control.model.geometry import geometry, link_centers, wheel_contacts
from snake_control.model.stability import nearest_edge, support
from support.derivatives import gradient
from support.robots import PAPER, ROBOTS, random_q


@given(st.integers(0, 10_000), st.integers(3, 100))
def test_hull_against_qhull(seed, count):
    points = np.random.default_rng(seed).normal(size=(count, 2))
    found = convex_hull(points @ (1, 1j))
    expected = ConvexHull(points).vertices
    assert set(found) == set(expected)
    corners = points[found]
    following = np.roll(corners, -1, axis=0)
    area = np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0])
    assert area > 0, "counter-clockwise"


def test_straight_robot():
    """Straight on the floor: the polygon is a rectangle, P_G on its axis."""
    q = np.zeros(17)
    q[2] = PAPER.wheel_radius_m
    found = support(geometry(PAPER, q))
    half = PAPER.half_length_m
    front, back = -11 * half, -23 * half
    expected = {(front, 0.032), (front, -0.032), (back, 0.032), (back, -0.032)}
    assert {tuple(np.round(p, 12)) for p in found.polygon} == {
        tuple(np.round(p, 12)) for p in expected
    }
    np.testing.assert_allclose(found.center_of_mass, [-12 * half, 0.0], atol=1e-12)
    assert found.d_min == pytest.approx(min(half, 0.032))


def test_head_held_far_out_tips():
    """A head stretched out sideways carries P_G out of the polygon: d_min is negative."""
    axes = ("yaw", "pitch", "yaw", "pitch", "pitch") + ("yaw",) * 6
    robot = PAPER.__class__(joint_axes=axes, link_mass_kg=(1.0,) * 5 + (0.01,) * 7)
    q = np.zeros(17)
    q[2] = robot.wheel_radius_m
    found = support(geometry(robot, q))
    assert found.d_min < 0
    contacts = wheel_contacts(geometry(robot, q)).reshape(-1, 2)
    front = contacts[:, 0].max()
    assert found.d_min == pytest.approx(-(found.center_of_mass[0] - front))

    def value(x):
        return support(geometry(robot, x)).d_min

    bent = q + np.random.default_rng(0).uniform(-0.1, 0.1, 17)
    np.testing.assert_allclose(
        support(geometry(robot, bent)).gradient, gradient(value, bent, 1e-6), atol=1e-8
    )


def test_distance_beyond_a_corner():
    """Outside, beyond a corner, the nearest edge is met at that corner."""
    axes = ("yaw", "pitch", "yaw", "yaw", "pitch") + ("yaw",) * 6
    robot = PAPER.__class__(joint_axes=axes, link_mass_kg=(5.0,) * 5 + (0.01,) * 7)
    q = np.zeros(17)
    q[2] = robot.wheel_radius_m
    q[6:10] = (0.0, 0.0, -0.8, -0.8)
    # The base's heading is what joint angles add up to, seen from the head at yaw 0.
    found = support(geometry(robot, q))
    contacts = wheel_contacts(geometry(robot, q)).reshape(-1, 2)
    nearest = np.linalg.norm(contacts - found.center_of_mass, axis=1).min()
    assert found.d_min == pytest.approx(-nearest)

    def value(x):
        return support(geometry(robot, x)).d_min

    np.testing.assert_allclose(found.gradient, gradient(value, q, 1e-6), atol=1e-8)


@pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
def test_gravity_efforts_are_the_gradient_of_potential_energy(robot):
    phi = random_q(robot, 9)[6:]
    base = np.array([0.3, -0.2, 0.7])

    def energy(angles):
        w = head_pose_on_floor(robot, angles, base)
        heights = link_centers(geometry(robot, np.concatenate((w, angles))))[:, 2]
        return GRAVITY_M_S2 * float(np.dot(robot.link_mass_kg, heights))

    g = geometry(robot, np.concatenate((head_pose_on_floor(robot, phi, base), phi)))
    np.testing.assert_allclose(gravity_efforts(g), gradient(energy, phi), atol=1e-9)
    np.testing.assert_allclose(base_pose(g), base, atol=1e-12)
    # Level at wheel height, as the floor demands.
    np.testing.assert_allclose(g.base_rotation[:, 2], [0, 0, 1], atol=1e-12)
    assert g.base_origin[2] == pytest.approx(robot.wheel_radius_m)


def test_neck_torque_of_the_paper_robot():
    """0.42 to 0.53 N m at the neck's foot, a good third of an AX-12's stall torque."""
    phi = np.array(PAPER.start_joint_angles_rad)
    g = geometry(PAPER, np.concatenate((head_pose_on_floor(PAPER, phi, np.zeros(3)), phi)))
    assert 0.3 < abs(gravity_efforts(g)[4]) < 0.6


def test_a_robot_on_its_back_has_the_polygon_seen_from_above():
    """Turned over about the head's axis, everything seen from above is mirrored."""
    q = random_q(PAPER, 4)
    q[3:] = 0.0
    q[11:] = random_q(PAPER, 4)[11:]
    upright = support(geometry(PAPER, q))
    q[3] = np.pi
    found = support(geometry(PAPER, q))
    assert upright.d_min > 0.0
    assert found.d_min == pytest.approx(upright.d_min)
    mirrored = found.polygon * (1, -1) + (0, 2 * q[1])
    assert {tuple(p) for p in mirrored.round(12)} == {tuple(p) for p in upright.polygon.round(12)}
    following = np.roll(found.polygon, -1, axis=0)
    x, y = found.polygon.T
    assert np.sum(x * following[:, 1] - y * following[:, 0]) > 0, "counter-clockwise"

    def value(x):
        return support(geometry(PAPER, x)).d_min

    q += 0.05 * random_q(PAPER, 5)
    np.testing.assert_allclose(
        support(geometry(PAPER, q)).gradient, gradient(value, q, 1e-6), atol=1e-8
    )


def distance_to_segment(points: np.ndarray, point: np.ndarray) -> float:
    """Between a point and others, of which it is asserted that they lie on one line."""
    center = points.mean(axis=0)
    _, spread, (along, across) = np.linalg.svd(points - center)
    assert spread[1] < 1e-12
    reach = (points - center) @ along
    x, y = (point - center) @ along, (point - center) @ across
    return float(np.hypot(x - np.clip(x, reach.min(), reach.max()), y))


def folded_up(robot) -> np.ndarray:
    """All base links on one spot: their contacts lie on two, one on either side."""
    q = np.zeros(robot.links + 5)
    q[6 + robot.head_links :] = np.pi
    return q


def folded_up_upright(robot) -> np.ndarray:
    """The same, nose down, so that the two spots are one seen from above or a line."""
    q = folded_up(robot)
    q[3:6] = (0.3, np.pi / 2, 0.2)
    return q


def on_its_side(robot) -> np.ndarray:
    """The base's plane stands upright, so that all contacts are on one line seen from above."""
    q = random_q(robot, 6)
    q[3:5] = (np.pi / 2, 0.0)
    q[6 : 6 + robot.head_links] = 0.0
    return q


WITHOUT_WIDTH = [
    pytest.param(robot, posture, id=f"{name}, {posture.__name__}")
    for name, robot in ROBOTS.items()
    for posture in (folded_up, folded_up_upright, on_its_side)
    # A planar snake always lies on the floor.
    if posture is folded_up or not robot.planar
]


@pytest.mark.parametrize(("robot", "posture"), WITHOUT_WIDTH)
def test_nothing_stands_on_a_line_or_a_point(robot, posture):
    g = geometry(robot, posture(robot))
    found = support(g)
    contacts = wheel_contacts(g).reshape(-1, 2)
    expected = distance_to_segment(contacts, found.center_of_mass)
    assert found.d_min == pytest.approx(-expected, abs=1e-12)
    assert found.d_min <= 0.0
    assert np.isfinite(found.gradient).all()


def test_folded_up_it_falls_away_from_the_line_on_either_side():
    """The gradient is that of minus the distance, wherever P_G is beside the line."""
    for yaw in (0.4, -0.4):
        q = folded_up(PAPER)
        q[6:11] = (0.3, yaw, 0.2, yaw, 0.5)
        found = support(geometry(PAPER, q))
        assert found.d_min < -0.01

        def value(x):
            return support(geometry(PAPER, x)).d_min

        # The head's joints move P_G against the line and leave it a line.
        np.testing.assert_allclose(found.gradient[:11], gradient(value, q, 1e-6)[:11], atol=1e-8)


LINE = [0.0 + 0.0j, 2.0 + 0.0j]
SQUARE = [0j, 1 + 0j, 1 + 1j, 1j]


@pytest.mark.parametrize(
    ("corners", "point", "distance"),
    [
        (LINE, 1 + 1j, -1.0),
        (LINE, 1 - 1j, -1.0),
        (LINE, 1 + 0j, 0.0),
        (LINE, 5 + 0j, -3.0),
        (LINE, -1 + 0j, -1.0),
        # A corner on the line between the others, and noise of round-off beside it.
        ([0j, 1 + 1e-17j, 2 + 0j, 1 - 1e-17j], 5 + 0j, -3.0),
        ([0j, 0j], 3 + 4j, -5.0),
        ([0j, 1e-16 + 0j], 3 + 4j, -5.0),
        ([0j, 0j], 0j, 0.0),
        (SQUARE, 0.5 + 0.25j, 0.25),
        (SQUARE, 0.5 - 0.25j, -0.25),
        # Two contacts on one spot, to round-off: which way their edge points says nothing.
        ([0j, 1 + 0j, 1 + 1j, 1j, 1e-17 + 1j], 0.5 + 0.25j, 0.25),
    ],
)
def test_distance_to_polygons_without_width(corners, point, distance):
    edge, share, found = nearest_edge(corners, point, 1e-12)
    assert found == pytest.approx(distance, abs=1e-15)
    begin, end = corners[edge], corners[edge + 1 - len(corners)]
    assert abs(point - begin - share * (end - begin)) == pytest.approx(abs(distance), abs=1e-15)
