"""What is drawn is what the model says, under names that stay."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from scipy.spatial.transform import Rotation
from snake_interfaces.msg import ControllerState
from visualization_msgs.msg import Marker

from snake_control.model.floor import head_pose_on_floor
from snake_control.model.geometry import geometry, link_centers, link_points, wheel_contacts
from snake_control.model.rotation import rotation_from_rpy
from snake_control.model.stability import support
from snake_control.nodes.controller_messages import Step
from snake_control.nodes.conversions import array, header, pose_message
from snake_control.nodes.markers import RobotMarkers
from support.robots import PAPER, ROBOTS

W_D = np.array([0.1, -0.2, 0.25, 0.3, -0.4, 2.0])


def standing(robot):
    """A posture on the floor, turned and away from the origin."""
    phi = np.resize(robot.start_joint_angles_rad, robot.joints) + 0.1
    return np.concatenate((head_pose_on_floor(robot, phi, np.array([0.3, -0.1, 0.7])), phi))


def step_of(robot, status=ControllerState.STATUS_TRACKING, text="tracking", **changes):
    return dataclasses.replace(Step.at(0, robot), status=status, text=text, **changes)


def drawn(robot, q, w_d=None, step=None):
    step = step or step_of(robot)
    message = RobotMarkers(robot, "map").draw(1_500_000_000, q, w_d, step)
    found = {(marker.ns, marker.id): marker for marker in message.markers}
    assert len(found) == len(message.markers)
    return found


def rgb(marker) -> tuple[float, float, float]:
    return (round(marker.color.r, 2), round(marker.color.g, 2), round(marker.color.b, 2))


GREEN, AMBER, RED = (0.30, 0.65, 0.30), (0.95, 0.75, 0.10), (0.85, 0.20, 0.15)


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_links_wheels_and_floor_are_those_of_the_model(robot):
    q = standing(robot)
    found = drawn(robot, q, W_D)
    g = geometry(robot, q)
    centers, points = link_centers(g), link_points(robot, q)
    for link in range(1, robot.links + 1):
        box = found["links", link]
        assert box.type == Marker.CUBE
        np.testing.assert_allclose(array(box.pose.position), centers[link - 1], atol=1e-9)
        axis = Rotation.from_quat(array(box.pose.orientation)).apply([1.0, 0.0, 0.0])
        along = (points[link - 1] - points[link]) / (2 * robot.half_length_m)
        np.testing.assert_allclose(axis, along, atol=1e-9)
        assert box.scale.x == pytest.approx(2 * robot.half_length_m)
    for link, contacts in zip(robot.wheeled_links, wheel_contacts(g), strict=True):
        for side, contact in enumerate(contacts):
            wheel = found["wheels", 2 * link + side]
            assert wheel.type == Marker.CYLINDER
            np.testing.assert_allclose(array(wheel.pose.position)[:2], contact, atol=1e-9)
            assert wheel.pose.position.z == pytest.approx(robot.wheel_radius_m, abs=1e-9)
            axle = Rotation.from_quat(array(wheel.pose.orientation)).apply([0.0, 0.0, 1.0])
            across = contacts[0] - contacts[1]
            assert abs(axle[:2] @ across) == pytest.approx(2 * robot.wheel_offset_m)
    stand = support(g)
    corners = np.array([array(p) for p in found["support_polygon", 0].points])
    np.testing.assert_allclose(corners[:-1, :2], stand.polygon, atol=1e-9)
    np.testing.assert_allclose(corners[-1], corners[0], atol=1e-9)
    mass = found["P_G", 0].pose.position
    np.testing.assert_allclose([mass.x, mass.y, mass.z], [*stand.center_of_mass[:2], 0], atol=1e-9)
    assert rgb(found["P_G", 0]) == rgb(found["support_polygon", 0])
    assert rgb(found["P_G", 0]) == (GREEN if stand.d_min > 0 else RED)
    assert found["status", 0].text == f"tracking\nd_min {1e3 * stand.d_min:.1f} mm"
    tail, tip = (array(p) for p in found["reference", 0].points)
    np.testing.assert_allclose(tip, W_D[:3])
    direction = (tip - tail) / np.linalg.norm(tip - tail)
    np.testing.assert_allclose(direction, rotation_from_rpy(W_D[3:])[:, 0], atol=1e-9)
    start, end = (array(p) for p in found["head_axis", 0].points)
    np.testing.assert_allclose(start, q[:3])
    np.testing.assert_allclose(end - start, points[0] - points[1], atol=1e-9)


def test_names_stay_and_what_is_gone_disappears():
    painter = RobotMarkers(PAPER, "world")
    q = standing(PAPER)
    first = {(m.ns, m.id) for m in painter.draw(1, q, W_D, step_of(PAPER)).markers}
    message = painter.draw(2_000_000_005, q + 0.01, W_D, step_of(PAPER))
    assert {(m.ns, m.id) for m in message.markers} == first
    assert {m.action for m in message.markers} == {Marker.ADD}
    assert {m.lifetime.nanosec for m in message.markers} == {500_000_000}
    assert {m.lifetime.sec for m in message.markers} == {0}
    assert {(m.header.stamp.sec, m.header.stamp.nanosec) for m in message.markers} == {(2, 5)}
    waiting = painter.draw(3, None, None, step_of(PAPER, ControllerState.STATUS_STALE, "why"))
    assert [(m.ns, m.text) for m in waiting.markers] == [("status", "why")]
    assert rgb(waiting.markers[0]) == RED


def test_the_planned_path_is_shown_while_there_is_one():
    painter = RobotMarkers(PAPER, "world")
    path = Path(header=header(0, "world"))
    path.poses = [PoseStamped(pose=pose_message(W_D + 0.1 * i)) for i in range(3)]

    def shown():
        markers = painter.draw(1, None, None, step_of(PAPER)).markers
        return [array(p).tolist() for m in markers if m.ns == "planned_path" for p in m.points]

    assert shown() == []
    painter.follow(path)
    np.testing.assert_allclose(shown(), [W_D[:3] + 0.1 * i for i in range(3)])
    painter.follow(Path(header=header(0, "world")))
    assert shown() == []
    path.header.frame_id = "elsewhere"
    painter.follow(path)
    assert shown() == []


def test_limits_that_bite_are_seen_where_they_bite():
    q = standing(PAPER)
    result = SimpleNamespace(speed_limited=(2, 3), range_limited=(3, 7))
    reasons = (ControllerState.REASON_FALL, ControllerState.REASON_SINGULAR_BODY)
    limited = step_of(
        PAPER, ControllerState.STATUS_LIMITED, "limited", result=result, reasons=reasons
    )
    found = drawn(PAPER, q, step=limited)
    limits = {number: rgb(m) for (ns, number), m in found.items() if ns == "limits"}
    assert limits == {2: AMBER, 3: RED, 7: RED}
    np.testing.assert_allclose(
        array(found["limits", 7].pose.position), link_points(PAPER, q)[7], atol=1e-9
    )
    assert rgb(found["support_polygon", 0]) == rgb(found["status", 0]) == AMBER
    assert {rgb(found["links", link]) for link in range(6, 13)} == {AMBER}
    assert AMBER not in {rgb(found["links", link]) for link in range(1, 6)}
    for reason in (ControllerState.REASON_SINGULAR_HEAD, ControllerState.REASON_FLOOR):
        head = dataclasses.replace(limited, reasons=(reason,))
        assert rgb(drawn(PAPER, q, step=head)["links", 1]) == AMBER


def test_a_robot_that_tips_stands_on_red():
    light = dataclasses.replace(PAPER, link_mass_kg=(0.1,) * 5 + (0.01,) * 7)
    q = standing(light)
    assert support(geometry(light, q)).d_min < 0
    assert rgb(drawn(light, q)["support_polygon", 0]) == RED
