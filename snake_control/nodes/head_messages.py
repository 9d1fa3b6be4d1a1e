"""Motions of the head in messages of others: nav_msgs/Path and MultiDOFJointTrajectory."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose
from nav_msgs.msg import Path
from numpy.typing import NDArray
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from snake_control.nodes.conversions import (
    HEAD_FRAME,
    MessageError,
    array,
    frame_of_poses,
    point,
    poses_array,
    require_finite,
    rpy_rates,
    stamp_ns,
)
from snake_control.trajectory.course_text import MOST_POSES
from snake_control.trajectory.plan import Course, course_through, timed_course

Array = NDArray[np.float64]

_REST = 1e-6


@dataclasses.dataclass(frozen=True)
class MessageMotion:
    """What a message asks for.

    Attributes:
        course: makes the course that begins so long after the message came [s]; what is wrong with
            the message is a ``SnakeError``.
        is_dated: whether the course depends on that time.
        wait_s: how long after the message came to begin [s].
    """

    course: Callable[[float], Course]
    is_dated: bool = False
    wait_s: float = 0.0


def path_motion(
    message: Path, now_ns: int, tolerance_s: float, world_frame_id: str
) -> MessageMotion:
    """Return the motion of a path: by the stamps of its poses if they rise, else at a speed.

    Args:
        message: the path.
        now_ns: time of the clock that stamps messages [ns].
        tolerance_s: how far in the past the first stamp may be that means now [s].
        world_frame_id: name of the world frame.
    """
    stamps = [stamp_ns(pose) for pose in message.poses[: MOST_POSES + 1]]
    wait_s = max(0.0, (stamp_ns(message) - now_ns) * 1e-9)
    if len(set(stamps)) < 2:
        return MessageMotion(
            lambda _: course_through(
                _path_poses(message), (), frame_of_poses(message, world_frame_id)
            ),
            wait_s=wait_s,
        )
    ahead_s = (stamps[0] - now_ns) * 1e-9
    is_ahead = ahead_s > 0.0
    # It may be asked for twice.
    poses = cache(lambda: _path_poses(message))

    def course(elapsed: float) -> Course:
        frame = frame_of_poses(message, world_frame_id)
        if stamps[0] and stamp_ns(message) and ahead_s < -tolerance_s:
            raise MessageError(
                f"pose 0 is stamped {-ahead_s:.3g} s in the past (at most stamp_tolerance_s = "
                f"{tolerance_s:g}); for times relative to the first pose give it the stamp 0"
            )
        lead_s = None
        if is_ahead:
            lead_s = ahead_s - elapsed
            if lead_s <= 0.0:
                raise MessageError(
                    f"the time of pose 0 has passed while it was rehearsed, {-lead_s:.2g} s ago: "
                    "send it earlier"
                )
        times = [(stamp - stamps[0]) * 1e-9 for stamp in stamps]
        names = [f"pose {i}" for i in range(len(stamps))]
        return timed_course(poses(), times, names, frame, lead_s=lead_s)

    return MessageMotion(course, is_dated=is_ahead)


def _path_poses(message: Path) -> Array:
    if len(message.poses) > MOST_POSES:
        raise MessageError(f"{len(message.poses)} poses, allowed: {MOST_POSES}")
    for i, pose in enumerate(message.poses):
        if pose.header.frame_id not in ("", message.header.frame_id):
            raise MessageError(
                f"pose {i}: its frame is '{pose.header.frame_id}', that of the path "
                f"'{message.header.frame_id}'"
            )
    return poses_array([pose.pose for pose in message.poses])


def trajectory_motion(
    message: MultiDOFJointTrajectory, now_ns: int, tolerance_s: float, world_frame_id: str
) -> MessageMotion:
    """Return the motion of a trajectory.

    Args:
        message: the transforms of ``link_1``, or of the one joint there is, with times from its
            stamp on (0: from now).
        now_ns: time of the clock that stamps messages [ns].
        tolerance_s: how far in the past its stamp may be that means now [s].
        world_frame_id: name of the world frame.
    """
    stamp = stamp_ns(message)
    ahead_s = (stamp - now_ns) * 1e-9

    def course(_: float) -> Course:
        if stamp and ahead_s < -tolerance_s:
            raise MessageError(
                f"it is stamped {-ahead_s:.3g} s in the past (at most stamp_tolerance_s = "
                f"{tolerance_s:g}); give the stamp 0 to begin at once"
            )
        frame = frame_of_poses(message, world_frame_id)
        points = message.points
        if len(points) > MOST_POSES:
            raise MessageError(f"{len(points)} points, allowed: {MOST_POSES}")
        joint = _joint(message.joint_names)
        poses = poses_array([_transform(i, p, joint) for i, p in enumerate(points)], "point")
        times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points]
        rates = _rates(points, joint, poses, frame)
        if not times or times[0] > 0.0:
            return course_through(poses, times, frame, rates, "point")
        names = [f"point {i}" for i in range(len(points))]
        return timed_course(poses, times, names, frame, rates)

    return MessageMotion(course, wait_s=max(0.0, ahead_s) if stamp else 0.0)


def _joint(names: Sequence[str]) -> int:
    if HEAD_FRAME in names:
        return list(names).index(HEAD_FRAME)
    if len(names) > 1:
        raise MessageError(f"its joints are {', '.join(names)}; give one, or {HEAD_FRAME}")
    return 0


def _transform(number: int, given: MultiDOFJointTrajectoryPoint, joint: int) -> Pose:
    if len(given.transforms) <= joint:
        raise MessageError(f"point {number}: it has {len(given.transforms)} transforms")
    transform = given.transforms[joint]
    return Pose(position=point(array(transform.translation)), orientation=transform.rotation)


def _rates(points: Sequence[Any], joint: int, poses: Array, frame: str) -> Array | None:
    """Return the rates of [x, y, z, R, P, Y] at each point, ``None`` if there are none."""
    have = [len(p.velocities) > joint for p in points]
    if not any(have):
        return None
    if not all(have):
        raise MessageError(f"point {have.index(False)}: it has no velocity, and others have one")
    if frame != "world":
        raise MessageError("velocities are understood in the world only")
    rates = []
    for i, (given, pose) in enumerate(zip(points, poses, strict=True)):
        twist = given.velocities[joint]
        linear, angular = array(twist.linear), array(twist.angular)
        try:
            require_finite("velocity", linear, angular)
            rates.append(np.concatenate([linear, rpy_rates(pose[3:], angular)]))
        except MessageError as error:
            raise MessageError(f"point {i}: {error}") from error
    if np.abs(rates[-1]).max() > _REST:
        raise MessageError(f"point {len(points) - 1}: the last velocity must be 0")
    return np.array(rates)
