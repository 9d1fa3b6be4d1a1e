"""Draws the robot, its support polygon and its reference for rviz2 or Foxglove."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from snake_control.config import RobotConfig
from snake_control.model.geometry import geometry, link_points, wheel_contacts
from snake_control.model.rotation import rotation_from_rpy
from snake_control.model.stability import support
from snake_control.nodes.conversions import header, point

Array = NDArray[np.float64]

_LINKS = ColorRGBA(r=0.20, g=0.45, b=0.70, a=1.0)
_WHEELS = ColorRGBA(r=0.15, g=0.15, b=0.15, a=1.0)
_SUPPORT = ColorRGBA(r=0.30, g=0.65, b=0.30, a=1.0)
_SUPPORT_LOST = ColorRGBA(r=0.85, g=0.20, b=0.15, a=1.0)
_REFERENCE = ColorRGBA(r=0.95, g=0.60, b=0.10, a=1.0)
_LIFETIME_NS = 500_000_000


def robot_markers(robot: RobotConfig, q: Array, stamp_ns: int, frame_id: str) -> list[Marker]:
    """Return links, wheels, support polygon and projected centre of mass for one posture.

    Args:
        robot: the robot.
        q: [w, phi], shape (n+5,) [m, rad].
        stamp_ns: time of the posture.
        frame_id: world frame.
    """
    g = geometry(robot, q)
    stand = support(g)
    thickness = 0.4 * robot.half_length_m
    links = _marker("links", Marker.LINE_STRIP, stamp_ns, frame_id, _LINKS, thickness)
    links.points = [point(p) for p in link_points(robot, q)]
    wheels = _marker("wheels", Marker.LINE_LIST, stamp_ns, frame_id, _WHEELS, 0.006)
    ends = wheel_contacts(g).reshape(-1, 2)
    wheels.points = [_above_floor(p, robot.wheel_radius_m) for p in ends]
    color = _SUPPORT if stand.d_min > 0 else _SUPPORT_LOST
    polygon = _marker("support_polygon", Marker.LINE_STRIP, stamp_ns, frame_id, color, 0.003)
    polygon.points = [_above_floor(p) for p in (*stand.polygon, stand.polygon[0])]
    mass = _marker("P_G", Marker.SPHERE_LIST, stamp_ns, frame_id, color, 0.012)
    mass.points = [_above_floor(stand.center_of_mass)]
    return [links, wheels, polygon, mass]


def reference_marker(w_d: Array, stamp_ns: int, frame_id: str, length: float) -> Marker:
    """Return an arrow that ends where the tip of the head shall be, along its wanted direction.

    Args:
        w_d: wanted head pose, shape (6,) [m, rad].
        stamp_ns: time of the reference.
        frame_id: world frame.
        length: of the arrow [m].
    """
    arrow = _marker("reference", Marker.ARROW, stamp_ns, frame_id, _REFERENCE, 0.012)
    arrow.scale.y = 0.024
    arrow.scale.z = 0.02
    forward = rotation_from_rpy(w_d[3:])[:, 0]
    arrow.points = [point(w_d[:3] - length * forward), point(w_d[:3])]
    return arrow


def marker_array(markers: list[Marker]) -> MarkerArray:
    """Return the message for a list of markers."""
    return MarkerArray(markers=markers)


def _marker(
    namespace: str, kind: int, stamp_ns: int, frame_id: str, color: ColorRGBA, width: float
) -> Marker:
    marker = Marker(header=header(stamp_ns, frame_id), ns=namespace, type=kind, color=color)
    marker.scale.x = width
    if kind == Marker.SPHERE_LIST:
        marker.scale.y = marker.scale.z = width
    marker.pose.orientation.w = 1.0
    # What is no longer sent disappears by itself.
    marker.lifetime.nanosec = _LIFETIME_NS
    return marker


def _above_floor(position: Array, height: float = 0.0) -> Point:
    return point([position[0], position[1], height])
