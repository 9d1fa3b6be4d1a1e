"""The robot as URDF, from the same configuration as everything else.

Frame ``link_i`` stands at the front end (tip) of link i, x forward to the head; joint i turns
``link_(i+1)`` about that frame's origin, the rear end of link i. The root link is ``link_1``.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig

Array = NDArray[np.float64]

_AXES = {"pitch": "0 1 0", "yaw": "0 0 1"}
_COLOURS = {"head": "0.85 0.45 0.1 1", "base": "0.2 0.4 0.7 1", "wheel": "0.15 0.15 0.15 1"}
# How wide a wheel is drawn, over its radius; nothing depends on it.
_WHEEL_WIDTH_OVER_RADIUS = 0.5


def link_box_m(robot: RobotConfig) -> tuple[float, float, float]:
    """Return length, width and height of the box that stands for a link [m]."""
    width, height = robot.link_size_m
    return 2 * robot.half_length_m, width, height


def wheel_size_m(robot: RobotConfig) -> tuple[float, float]:
    """Return radius and width of a wheel as it is drawn [m]."""
    return robot.wheel_radius_m, _WHEEL_WIDTH_OVER_RADIUS * robot.wheel_radius_m


def link_inertias(robot: RobotConfig) -> Array:
    """Return the moments of inertia of every link, a uniform box, about its centre.

    Returns:
        About the link's x, y and z axis, (n, 3) [kg m^2].
    """
    sizes = np.square(link_box_m(robot))
    return np.outer(robot.link_mass_kg, sizes.sum() - sizes) / 12.0


def urdf(robot: RobotConfig) -> str:
    """Return the robot description: links, joints with limits, masses, inertias and shapes.

    Wheels are shapes only: the paper's wheels are massless and turn freely, and what they do to
    the robot are the constraints (1)-(3), not joints.
    """
    root = ElementTree.Element("robot", name="snake")
    for name, colour in _COLOURS.items():
        material = ElementTree.SubElement(root, "material", name=name)
        ElementTree.SubElement(material, "color", rgba=colour)
    inertias = link_inertias(robot)
    for link in range(1, robot.links + 1):
        _add_link(root, robot, link, inertias[link - 1])
    for joint in range(1, robot.links):
        _add_joint(root, robot, joint)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_link(root: ElementTree.Element, robot: RobotConfig, number: int, moments: Array) -> None:
    link = ElementTree.SubElement(root, "link", name=f"link_{number}")
    center = -robot.half_length_m
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_text(center, 0.0, 0.0), rpy=_text(0, 0, 0))
    ElementTree.SubElement(inertial, "mass", value=_text(robot.link_mass_kg[number - 1]))
    ixx, iyy, izz = (_text(moment) for moment in moments.tolist())
    ElementTree.SubElement(
        inertial, "inertia", ixx=ixx, ixy="0", ixz="0", iyy=iyy, iyz="0", izz=izz
    )
    box = ElementTree.Element("box", size=_text(*link_box_m(robot)))
    part = "head" if number <= robot.head_links else "base"
    _add_visual(link, box, (center, 0.0, 0.0), 0.0, part)
    if number in robot.wheeled_links and robot.wheel_radius_m > 0:
        radius, width = wheel_size_m(robot)
        for side in (robot.wheel_offset_m, -robot.wheel_offset_m):
            wheel = ElementTree.Element("cylinder", radius=_text(radius), length=_text(width))
            # A cylinder's axis is z; a wheel's is y.
            _add_visual(link, wheel, (center, side, 0.0), math.pi / 2, "wheel")


def _add_visual(
    link: ElementTree.Element,
    geometry: ElementTree.Element,
    xyz: tuple[float, float, float],
    roll: float,
    material: str,
) -> None:
    visual = ElementTree.SubElement(link, "visual")
    ElementTree.SubElement(visual, "origin", xyz=_text(*xyz), rpy=_text(roll, 0, 0))
    ElementTree.SubElement(visual, "geometry").append(geometry)
    ElementTree.SubElement(visual, "material", name=material)


def _add_joint(root: ElementTree.Element, robot: RobotConfig, number: int) -> None:
    joint = ElementTree.SubElement(
        root, "joint", name=robot.joint_names[number - 1], type="revolute"
    )
    ElementTree.SubElement(
        joint, "origin", xyz=_text(-2 * robot.half_length_m, 0, 0), rpy=_text(0, 0, 0)
    )
    ElementTree.SubElement(joint, "parent", link=f"link_{number}")
    ElementTree.SubElement(joint, "child", link=f"link_{number + 1}")
    ElementTree.SubElement(joint, "axis", xyz=_AXES[robot.joint_axes[number - 1]])
    lower, upper = robot.joint_range(number)
    ElementTree.SubElement(
        joint,
        "limit",
        lower=_text(lower),
        upper=_text(upper),
        effort=_text(robot.joint_torque_limits_n_m[number - 1]),
        velocity=_text(robot.joint_speed_limits_rad_s[number - 1]),
    )
    ElementTree.SubElement(
        joint, "dynamics", damping=_text(robot.joint_friction[number - 1]), friction="0"
    )


def _text(*numbers: float) -> str:
    # repr() gives every digit, so that a reader of the file has the very numbers of the config.
    return " ".join(repr(float(number)) for number in numbers)
