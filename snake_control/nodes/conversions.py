"""Between messages and the arrays of the other rooms.

Whatever comes in is checked here: a ``MessageError`` says what is wrong with a message.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, Quaternion, TwistStamped, Vector3
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from snake_interfaces.msg import HeadReference
from std_msgs.msg import Header

from snake_control.control.head_filter import QUATERNION_TOLERANCE, HeadEstimate
from snake_control.control.reference import Reference
from snake_control.errors import SnakeError
from snake_control.model.rotation import (
    quaternion_from_rpy,
    rotation_from_rpy,
    rpy_from_quaternion,
    rpy_rate_map,
)
from snake_control.trajectory.teleop import HeadVelocityCommand

Array = NDArray[np.float64]

HEAD_FRAME = "link_1"

# Nearer to a pitch of +-90 degrees the rates of roll and yaw mean nothing.
_COS_PITCH_MIN = 1e-3


class MessageError(SnakeError, ValueError):
    """A message that cannot be used; the text says why, without the topic's name."""


def header(stamp_ns: int, frame_id: str = "") -> Header:
    """Return a header; time in nanoseconds of the node's clock."""
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return Header(stamp=Time(sec=seconds, nanosec=nanoseconds), frame_id=frame_id)


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message with a header [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def array(value: Point | Vector3 | Quaternion) -> Array:
    """Return x, y, z (and w of a quaternion) as an array."""
    values = [value.x, value.y, value.z]
    if isinstance(value, Quaternion):
        values.append(value.w)
    return np.array(values)


def vector(values: Sequence[float] | Array) -> Vector3:
    """Return three numbers as a message."""
    x, y, z = map(float, values)
    return Vector3(x=x, y=y, z=z)


def point(values: Sequence[float] | Array) -> Point:
    """Return three numbers as a message."""
    x, y, z = map(float, values)
    return Point(x=x, y=y, z=z)


def quaternion(values: Sequence[float] | Array) -> Quaternion:
    """Return [x, y, z, w] as a message."""
    x, y, z, w = map(float, values)
    return Quaternion(x=x, y=y, z=z, w=w)


def pose_message(w: Array) -> Pose:
    """Return [x, y, z, R, P, Y] as a message."""
    return Pose(position=point(w[:3]), orientation=quaternion(quaternion_from_rpy(w[3:])))


def pose_array(pose: Pose) -> Array:
    """Return a pose as [x, y, z, R, P, Y], shape (6,) [m, rad].

    Raises:
        MessageError: not finite, or the quaternion is not of length 1.
    """
    position, xyzw = array(pose.position), array(pose.orientation)
    require_finite("position", position)
    require_finite("orientation", xyzw)
    norm = float(np.linalg.norm(xyzw))
    if abs(norm - 1.0) > QUATERNION_TOLERANCE:
        raise MessageError(f"its quaternion has length {norm:.3g}, it must be 1")
    return np.concatenate([position, rpy_from_quaternion(xyzw)])


def poses_array(poses: Sequence[Pose], what: str = "pose") -> Array:
    """Return poses as [x, y, z, R, P, Y], (k, 6) [m, rad].

    Args:
        poses: any number of them.
        what: what to call one of them in errors.

    Raises:
        MessageError: names the pose that is none.
    """
    rows = []
    for i, pose in enumerate(poses):
        try:
            rows.append(pose_array(pose))
        except MessageError as error:
            raise MessageError(f"{what} {i}: {error}") from error
    return np.reshape(np.array(rows), (-1, 6))


def frame_of_poses(message: Any, world_frame_id: str) -> str:
    """Return what the poses of a message are relative to, as trajectories call it.

    Raises:
        MessageError: another frame than the world's and the head's.
    """
    frame = message.header.frame_id
    if frame == HEAD_FRAME:
        return "start"
    if frame != world_frame_id:
        raise MessageError(
            f"its frame is '{frame}', expected '{world_frame_id}', or '{HEAD_FRAME}' for poses "
            "relative to the head"
        )
    return "world"


def rpy_rates(rpy: Array, angular_velocity: Array) -> Array:
    """Return the rates of R, P, Y that an angular velocity in the world means.

    Args:
        rpy: roll, pitch, yaw, shape (3,) [rad].
        angular_velocity: in the world, shape (3,) [rad/s].

    Raises:
        MessageError: at a pitch of +-90 degrees there are none.
    """
    if abs(math.cos(rpy[1])) < _COS_PITCH_MIN:
        raise MessageError(f"pitch is {rpy[1]:.4f} rad: roll and yaw have no rates there")
    return np.linalg.solve(rpy_rate_map(rpy), angular_velocity)


def diagnostic_status(
    name: str, hardware: str, level: int, text: str, values: Mapping[str, str]
) -> DiagnosticStatus:
    """Return one status of a diagnostics message; ``level`` as in DiagnosticStatus."""
    return DiagnosticStatus(
        level=bytes((level,)),
        name=name,
        message=text,
        hardware_id=hardware,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def of_robot(array: DiagnosticArray, namespace: str) -> DiagnosticArray:
    """Put a robot's namespace before names and hardware ids: all robots share /diagnostics."""
    robot = namespace.strip("/")
    if robot:
        for status in array.status:
            status.name = f"{robot}/{status.name}"
            status.hardware_id = f"{robot}: {status.hardware_id}"
    return array


def turned_covariance(turn: Array, covariance: Array) -> Array:
    """Return a covariance of two vectors, (6, 6), after both were turned by ``turn``, (3, 3)."""
    blocks = covariance.reshape(2, 3, 2, 3)
    return (turn @ blocks.transpose(0, 2, 1, 3) @ turn.T).transpose(0, 2, 1, 3).reshape(6, 6)


def odometry_message(estimate: HeadEstimate, frame_id: str, child_frame_id: str) -> Odometry:
    """Return a filtered head motion as a message: pose in the world, twist in the head's frame."""
    # By rows the axes of the head, in the world.
    to_head = estimate.rotation.as_matrix().T
    message = Odometry(header=header(estimate.stamp_ns, frame_id), child_frame_id=child_frame_id)
    message.pose.pose.position = point(estimate.position)
    message.pose.pose.orientation = quaternion(estimate.rotation.as_quat())
    message.twist.twist.linear = vector(to_head @ estimate.velocity)
    message.twist.twist.angular = vector(to_head @ estimate.angular_velocity)
    message.pose.covariance = estimate.pose_covariance.ravel()
    message.twist.covariance = turned_covariance(to_head, estimate.twist_covariance).ravel()
    return message


def head_motion(message: Odometry, frame_id: str) -> tuple[Array, Array]:
    """Return w and its rate, shape (6,) each, from a message with the twist in the head's frame.

    Raises:
        MessageError: another frame than ``frame_id``, not finite, no rotation.
    """
    require_frame(message, frame_id)
    w = pose_array(message.pose.pose)
    linear, angular = array(message.twist.twist.linear), array(message.twist.twist.angular)
    require_finite("twist", linear, angular)
    rotation = rotation_from_rpy(w[3:])
    return w, np.concatenate([rotation @ linear, rpy_rates(w[3:], rotation @ angular)])


def reference_message(reference: Reference, stamp: int, frame_id: str) -> HeadReference:
    """Return a reference for the time ``stamp`` [ns] as a message, twist in ``frame_id``."""
    message = HeadReference(header=header(stamp, frame_id), pose=pose_message(reference.w_d))
    message.twist.linear = vector(reference.w_d_dot[:3])
    message.twist.angular = vector(rpy_rate_map(reference.w_d[3:]) @ reference.w_d_dot[3:])
    message.time_scale = float(reference.time_scale)
    return message


def reference_from(message: HeadReference, frame_id: str) -> Reference:
    """Return the reference in a message.

    Raises:
        MessageError: another frame than ``frame_id``, not finite, no rotation.
    """
    require_frame(message, frame_id)
    w_d = pose_array(message.pose)
    linear, angular = array(message.twist.linear), array(message.twist.angular)
    require_finite("twist", linear, angular)
    scale = message.time_scale
    if not 0.0 <= scale <= 1.0:
        raise MessageError(f"its time_scale is {scale}, allowed: 0 to 1")
    rates = np.concatenate([linear, rpy_rates(w_d[3:], angular)])
    return Reference(w_d, rates, time_scale=scale)


def joint_motion(message: JointState, names: Sequence[str]) -> tuple[Array, Array]:
    """Return angles and velocities of the named joints, in that order, shape (n-1,) each.

    Velocities that a message does not have are 0.

    Raises:
        MessageError: a joint is missing or twice there, lengths differ, or a value is not finite.
    """
    given = list(message.name)
    if len(message.position) != len(given):
        raise MessageError(f"{len(given)} names but {len(message.position)} positions")
    if len(message.velocity) not in (0, len(given)):
        raise MessageError(f"{len(given)} names but {len(message.velocity)} velocities")
    missing = [name for name in names if name not in given]
    if missing:
        raise MessageError(f"{', '.join(missing)} missing")
    doubled = [name for name in names if given.count(name) > 1]
    if doubled:
        raise MessageError(f"{', '.join(doubled)} given twice")
    order = [given.index(name) for name in names]
    phi = np.array([message.position[i] for i in order])
    phi_dot = np.array([message.velocity[i] for i in order]) if message.velocity else 0.0 * phi
    for what, values in (("position", phi), ("velocity", phi_dot)):
        for name, value in zip(names, values, strict=True):
            if not math.isfinite(value):
                raise MessageError(f"{what} of {name} is {value}")
    return phi, phi_dot


def head_velocity_command(message: TwistStamped, world_frame_id: str) -> HeadVelocityCommand:
    """Return a velocity command for the head.

    ``header.frame_id`` says in which frame both linear and angular velocity are: empty or
    ``world_frame_id`` for the world, ``link_1`` for the level frame that has the head's yaw.

    Args:
        message: the command.
        world_frame_id: name of the world frame.

    Raises:
        MessageError: another frame, or not finite.
    """
    frame = message.header.frame_id
    if frame not in ("", world_frame_id, HEAD_FRAME):
        raise MessageError(
            f"its frame is '{frame}'; allowed: '{world_frame_id}' (or empty) or '{HEAD_FRAME}'"
        )
    linear, angular = array(message.twist.linear), array(message.twist.angular)
    require_finite("twist", linear, angular)
    return HeadVelocityCommand(linear, angular, in_heading_frame=frame == HEAD_FRAME)


def require_frame(message: Any, frame_id: str) -> None:
    """Raise ``MessageError`` unless the message is given in ``frame_id``."""
    if message.header.frame_id != frame_id:
        raise MessageError(f"its frame is '{message.header.frame_id}', expected '{frame_id}'")


def require_finite(what: str, *values: Array) -> None:
    """Raise ``MessageError`` naming ``what`` unless all values are finite."""
    for value in values:
        if not np.isfinite(value).all():
            raise MessageError(f"its {what} is not finite: {value.tolist()}")
