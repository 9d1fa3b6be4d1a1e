"""The URDF, read the way its readers do, is the robot of the configuration."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.model.rotation import rotation_from_rpy
from snake_control.model.urdf import link_inertias, urdf
from support.mechanics import links
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))


def numbers(text):
    return np.array([float(number) for number in text.split()])


def placed(element):
    """Rotation and position of an <origin>."""
    origin = element.find("origin")
    return Rotation.from_euler("xyz", numbers(origin.get("rpy"))).as_matrix(), numbers(
        origin.get("xyz")
    )


@ALL
def test_joints_and_links_are_where_the_model_has_them(robot):
    root = ElementTree.fromstring(urdf(robot))
    q = random_q(robot, 1)
    frames = {"link_1": (rotation_from_rpy(q[3:6]), q[:3])}
    for i, joint in enumerate(root.findall("joint"), start=1):
        assert joint.get("name") == f"joint_{i}"
        R, p = frames[joint.find("parent").get("link")]
        turn, shift = placed(joint)
        angle = Rotation.from_rotvec(numbers(joint.find("axis").get("xyz")) * q[5 + i]).as_matrix()
        frames[joint.find("child").get("link")] = (R @ turn @ angle, p + R @ shift)
    for i, (turns, center, _, _) in enumerate(links(robot, q), start=1):
        R, p = frames[f"link_{i}"]
        inertial = root.find(f"link[@name='link_{i}']/inertial")
        np.testing.assert_allclose(R, turns, atol=1e-12)
        np.testing.assert_allclose(p + R @ placed(inertial)[1], center, atol=1e-12)


@ALL
def test_it_is_one_tree_from_link_1(robot):
    root = ElementTree.fromstring(urdf(robot))
    names = [link.get("name") for link in root.findall("link")]
    assert names == [f"link_{i}" for i in range(1, robot.links + 1)]
    children = [joint.find("child").get("link") for joint in root.findall("joint")]
    assert sorted(children) == sorted(names[1:])


def test_limits_are_those_of_the_configuration():
    robot = dataclasses.replace(
        PAPER,
        joint_limits_rad=(-1.0, 2.0) * 11,
        joint_speed_limits_rad_s=tuple(range(1, 12)),
        joint_torque_limits_n_m=(0.75,),
        joint_friction=(0.02,),
    )
    for i, joint in enumerate(ElementTree.fromstring(urdf(robot)).findall("joint"), start=1):
        assert joint.get("type") == "revolute"
        assert {k: float(v) for k, v in joint.find("limit").attrib.items()} == {
            "lower": -1.0,
            "upper": 2.0,
            "velocity": i,
            "effort": 0.75,
        }
        assert float(joint.find("dynamics").get("damping")) == 0.02


@ALL
def test_masses_inertias_and_shapes(robot):
    root = ElementTree.fromstring(urdf(robot))
    for i, link in enumerate(root.findall("link"), start=1):
        mass = float(link.find("inertial/mass").get("value"))
        assert mass == robot.link_mass_kg[i - 1]
        inertia = link.find("inertial/inertia")
        moments = [float(inertia.get(name)) for name in ("ixx", "iyy", "izz")]
        np.testing.assert_array_equal(moments, link_inertias(robot)[i - 1])
        box = numbers(link.find("visual/geometry/box").get("size"))
        # Of a box of many points.
        axes = [(np.arange(20) + 0.5) / 20 - 0.5] * 3
        points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3) * box
        squares = mass * np.mean(points**2, axis=0)
        np.testing.assert_allclose(moments, squares.sum() - squares, rtol=3e-3)


@ALL
def test_wheels_stand_on_the_floor_at_the_wheeled_links_only(robot):
    root = ElementTree.fromstring(urdf(robot))
    found = {}
    for i, link in enumerate(root.findall("link"), start=1):
        for visual in link.findall("visual"):
            wheel = visual.find("geometry/cylinder")
            if wheel is not None:
                R, p = placed(visual)
                # A cylinder lies along its own z.
                np.testing.assert_allclose(np.abs(R[:, 2]), [0, 1, 0], atol=1e-12)
                assert float(wheel.get("radius")) == robot.wheel_radius_m
                found.setdefault(i, []).append(p)
    assert tuple(found) == robot.wheeled_links
    for wheels in found.values():
        expected = [[-robot.half_length_m, side * robot.wheel_offset_m, 0] for side in (1, -1)]
        np.testing.assert_allclose(wheels, expected)


def test_no_wheels_are_drawn_without_a_radius():
    assert "cylinder" not in urdf(dataclasses.replace(PAPER, wheel_radius_m=0.0))
