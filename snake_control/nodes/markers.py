"""Draws the robot, what it stands on, where it shall go and what keeps it, for RViz and Foxglove.

| namespace         | ids             | what                                                       |
|-------------------|-----------------|------------------------------------------------------------|
| `links`           | number of link  | boxes, of the size that the dynamics and the URDF have     |
| `wheels`          | 2 k, 2 k + 1    | left and right wheel of link k                             |
| `head_axis`       | 0               | arrow from the tip ahead                                   |
| `support_polygon` | 0               | green; amber if a fall is near, red once d_min is negative |
| `P_G`             | 0               | the centre of mass on the floor, in the same colour        |
| `reference`       | 0               | arrow that ends where the tip shall be, along its axis     |
| `planned_path`    | 0               | where the reference goes, while there is a plan            |
| `limits`          | number of joint | spheres at joints whose speed (amber) or range (red) bites |
| `status`          | 0               | text of the status and d_min, in the status's colour       |

Head and base turn amber while a singular posture of theirs slows the motion. What is no longer sent
disappears by its lifetime.
"""

from __future__ import annotations

import contextlib

import numpy as np
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.duration import Duration
from scipy.spatial.transform import Rotation
from snake_interfaces.msg import ControllerState
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from snake_control.config import RobotConfig
from snake_control.control.supervisor import NO_ANSWER
from snake_control.model.geometry import geometry
from snake_control.model.link_frames import link_frames
from snake_control.model.rotation import rotation_from_rpy
from snake_control.model.stability import support
from snake_control.model.urdf import link_box_m, wheel_size_m
from snake_control.nodes.controller_messages import Step
from snake_control.nodes.conversions import header, point, quaternion

Array = NDArray[np.float64]

_HEAD = ColorRGBA(r=0.85, g=0.45, b=0.10, a=1.0)
_BASE = ColorRGBA(r=0.20, g=0.45, b=0.70, a=1.0)
_WHEEL = ColorRGBA(r=0.15, g=0.15, b=0.15, a=1.0)
_REFERENCE = ColorRGBA(r=0.70, g=0.30, b=0.75, a=1.0)
_GOOD = ColorRGBA(r=0.30, g=0.65, b=0.30, a=1.0)
_NEAR = ColorRGBA(r=0.95, g=0.75, b=0.10, a=1.0)
_BAD = ColorRGBA(r=0.85, g=0.20, b=0.15, a=1.0)
_OF_HEAD = {ControllerState.REASON_SINGULAR_HEAD, ControllerState.REASON_FLOOR}

_LIFETIME = Duration(seconds=0.5).to_msg()
# A wheel's axis is y, a cylinder's z.
_UPRIGHT = Rotation.from_euler("x", 90, degrees=True)
_COLOR_OF_STATUS = {
    ControllerState.STATUS_TRACKING: _GOOD,
    ControllerState.STATUS_POSTURE: _GOOD,
    ControllerState.STATUS_RESHAPING: _GOOD,
    ControllerState.STATUS_LIMITED: _NEAR,
    ControllerState.STATUS_RECOVERING: _NEAR,
    ControllerState.STATUS_WAITING: _NEAR,
    ControllerState.STATUS_DISABLED: _NEAR,
}


class RobotMarkers:
    """Markers of one robot; each is the same object every time, filled anew."""

    def __init__(self, robot: RobotConfig, frame_id: str) -> None:
        """Prepare; ``frame_id`` is the world's."""
        self._robot, self._frame_id = robot, frame_id
        box, radius = link_box_m(robot), robot.wheel_radius_m
        self._size = 2.0 * robot.half_length_m
        numbers = range(1, robot.links + 1)
        self._links = [_marker("links", link, Marker.CUBE, box) for link in numbers]
        wheel = (2.0 * radius, 2.0 * radius, wheel_size_m(robot)[1])
        self._wheels = [
            _marker("wheels", 2 * link + side, Marker.CYLINDER, wheel, _WHEEL)
            for link in (robot.wheeled_links if radius > 0.0 else ())
            for side in (0, 1)
        ]
        arrow = (0.006, 0.014, 0.014)
        self._head_axis = _marker("head_axis", 0, Marker.ARROW, arrow, _HEAD)
        self._polygon = _marker("support_polygon", 0, Marker.LINE_STRIP, (0.003, 0.0, 0.0))
        self._mass = _marker("P_G", 0, Marker.SPHERE, (0.012,) * 3)
        self._reference = _marker("reference", 0, Marker.ARROW, (0.012, 0.024, 0.02), _REFERENCE)
        self._path = _marker("planned_path", 0, Marker.LINE_STRIP, (0.003, 0.0, 0.0), _REFERENCE)
        ball = (1.2 * max(robot.link_size_m),) * 3
        self._limits = [
            _marker("limits", joint, Marker.SPHERE, ball) for joint in range(1, robot.links)
        ]
        self._status = _marker("status", 0, Marker.TEXT_VIEW_FACING, (0.0, 0.0, 0.02))

    def follow(self, path: Path) -> None:
        """Draw another planned path from now on; none if it is empty or in another frame."""
        ours = path.header.frame_id == self._frame_id
        self._path.points = [pose.pose.position for pose in path.poses] if ours else []

    def draw(self, stamp_ns: int, q: Array | None, w_d: Array | None, step: Step) -> MarkerArray:
        """Return the markers of one moment.

        Args:
            stamp_ns: time of the posture.
            q: [w, phi], (n+5,) [m, rad]; ``None`` while unknown.
            w_d: wanted head pose, (6,) [m, rad]; ``None`` without a reference.
            step: what the controller decided last.
        """
        found: list[Marker] = []
        d_min: float | None = None
        if q is not None:
            # A posture that the controller refuses, and says so, cannot be drawn either.
            with contextlib.suppress(*NO_ANSWER):
                d_min = self._draw_floor(q, step)
                found += (self._polygon, self._mass, *self._draw_body(q, step))
        if w_d is not None:
            forward = rotation_from_rpy(w_d[3:])[:, 0]
            tail = w_d[:3] - 2.0 * self._size * forward
            self._reference.points = [point(tail), point(w_d[:3])]
            found.append(self._reference)
        if len(self._path.points) > 1:
            found.append(self._path)
        margin = "" if d_min is None else f"\nd_min {1e3 * d_min:.1f} mm"
        self._status.text = f"{step.text}{margin}"
        self._status.color = _COLOR_OF_STATUS.get(step.status, _BAD)
        found.append(self._status)
        stamped = header(stamp_ns, self._frame_id)
        for marker in found:
            marker.header = stamped
        return MarkerArray(markers=found)

    def _draw_floor(self, q: Array, step: Step) -> float:
        """Fill support polygon and P_G; return d_min [m]."""
        stand = support(geometry(self._robot, q))
        near = ControllerState.REASON_FALL in step.reasons
        color = _BAD if stand.d_min <= 0.0 else _NEAR if near else _GOOD
        corners = [point((*corner, 0.0)) for corner in stand.polygon]
        self._polygon.points = [*corners, corners[0]]
        self._mass.pose.position = point((*stand.center_of_mass[:2], 0.0))
        self._polygon.color = self._mass.color = color
        return float(stand.d_min)

    def _draw_body(self, q: Array, step: Step) -> list[Marker]:
        robot = self._robot
        origins, quaternions = link_frames(robot, q)
        rotations = Rotation.from_quat(quaternions)
        ahead = rotations.apply([1.0, 0.0, 0.0])
        centers = origins - robot.half_length_m * ahead
        head = not _OF_HEAD.isdisjoint(step.reasons)
        base = ControllerState.REASON_SINGULAR_BODY in step.reasons
        for i, marker in enumerate(self._links):
            _place(marker, centers[i], quaternions[i])
            near, color = (head, _HEAD) if i < robot.head_links else (base, _BASE)
            marker.color = _NEAR if near else color
        if self._wheels:
            wheeled = [link - 1 for link in robot.wheeled_links]
            sides = robot.wheel_offset_m * rotations[wheeled].apply([0.0, 1.0, 0.0])
            upright = (rotations[wheeled] * _UPRIGHT).as_quat()
            places = np.stack((centers[wheeled] + sides, centers[wheeled] - sides), axis=1)
            for i, marker in enumerate(self._wheels):
                _place(marker, places[i // 2, i % 2], upright[i // 2])
        self._head_axis.points = [point(origins[0]), point(origins[0] + self._size * ahead[0])]
        self._status.pose.position = point(origins[0] + [0.0, 0.0, self._size])
        return [*self._links, *self._wheels, self._head_axis, *self._draw_limits(origins, step)]

    def _draw_limits(self, origins: Array, step: Step) -> list[Marker]:
        if step.result is None:
            return []
        colors = dict.fromkeys(step.result.speed_limited, _NEAR)
        colors |= dict.fromkeys(step.result.range_limited, _BAD)
        found = []
        for joint, color in colors.items():
            marker = self._limits[joint - 1]
            # Joint i turns link i+1 about the origin of that link's frame.
            marker.pose.position = point(origins[joint])
            marker.color = color
            found.append(marker)
        return found


def _marker(
    namespace: str,
    number: int,
    kind: int,
    size: tuple[float, ...],
    color: ColorRGBA | None = None,
) -> Marker:
    marker = Marker(ns=namespace, id=number, type=kind, lifetime=_LIFETIME)
    marker.scale.x, marker.scale.y, marker.scale.z = size
    marker.pose.orientation.w = 1.0
    if color is not None:
        marker.color = color
    return marker


def _place(marker: Marker, position: Array, xyzw: Array) -> None:
    marker.pose.position = point(position)
    marker.pose.orientation = quaternion(xyzw)
