"""Where poses come from: the topics of each source, and how a message becomes a measurement.

The types of ``rigid_bodies``, ``named_poses`` and ``tf`` are imported only where one of them is
chosen; conversion reads their fields and needs no type.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from snake_control.config import PoseInputConfig
from snake_control.control.head_filter import Reason, Rejection, unusable
from snake_control.control.pose_intake import Measurement
from snake_control.control.transform_tree import Edge, TransformTree
from snake_control.errors import ConfigError
from snake_control.nodes import topics
from snake_control.nodes.conversions import array, stamp_ns

Array = NDArray[np.float64]

Convert = Callable[[Any], Measurement | Rejection | None]
"""What a message says: a pose, that the body was not seen, or nothing about the body."""


@dataclasses.dataclass(frozen=True)
class Feed:
    """A topic to subscribe to, and what its messages say."""

    topic: topics.Topic
    convert: Convert


def feeds(config: PoseInputConfig) -> list[Feed]:
    """Return the topics of the source that a configuration names, the one with poses first.

    Raises:
        ConfigError: the messages of the source are not installed; names the package.
    """
    body = config.body
    if config.source == "tf":
        frames = _Frames(config)
        return [
            Feed(_loaded(topics.MOCAP_TF), frames.take),
            Feed(_loaded(topics.MOCAP_TF_STATIC), frames.take_static),
        ]
    topic, convert = {
        "pose": (topics.MOCAP_POSE, from_pose),
        "pose_with_covariance": (topics.MOCAP_POSE_WITH_COVARIANCE, from_pose_with_covariance),
        "transform": (topics.MOCAP_TRANSFORM, lambda m: from_transform(m, body)),
        "odometry": (topics.MOCAP_ODOMETRY, lambda m: from_odometry(m, body)),
        "rigid_bodies": (topics.MOCAP_RIGID_BODIES, lambda m: from_rigid_bodies(m, body)),
        "named_poses": (topics.MOCAP_NAMED_POSES, lambda m: from_named_poses(m, body)),
    }[config.source]
    if isinstance(topic, topics.ForeignTopic):
        topic = _loaded(topic, config.source)
    return [Feed(topic, convert)]


def _loaded(topic: topics.ForeignTopic, source: str = "tf") -> topics.Topic:
    try:
        return topic.load()
    except ImportError as error:
        raise ConfigError(
            "source",
            source,
            f"{topic.package} cannot be imported ({error}): {topic.origin}, and source the "
            "setup.bash of where it is",
        ) from error


def from_pose(message: PoseStamped) -> Measurement:
    """Return the pose of a PoseStamped."""
    return _measurement(message, message.pose)


def from_pose_with_covariance(message: PoseWithCovarianceStamped) -> Measurement:
    """Return pose and covariance of a PoseWithCovarianceStamped."""
    return _measurement(message, message.pose.pose, message.pose.covariance)


def from_odometry(message: Odometry, body: str) -> Measurement | None:
    """Return pose and covariance of an Odometry; its twist is not used."""
    if body and message.child_frame_id != body:
        return None
    return _measurement(message, message.pose.pose, message.pose.covariance)


def from_transform(message: TransformStamped, body: str) -> Measurement | None:
    """Return the pose of a TransformStamped, of any child frame if no body is named."""
    if body and message.child_frame_id != body:
        return None
    transform = message.transform
    return Measurement(
        stamp_ns(message),
        message.header.frame_id,
        array(transform.translation),
        array(transform.rotation),
    )


def from_rigid_bodies(message: Any, body: str) -> Measurement | Rejection:
    """Return the pose of one body of a mocap4r2_msgs/RigidBodies."""
    named = {rigid.rigid_body_name: rigid.pose for rigid in message.rigidbodies}
    return _of_body(message, named, body)


def from_named_poses(message: Any, body: str) -> Measurement | Rejection:
    """Return the pose of one body of a motion_capture_tracking_interfaces/NamedPoseArray."""
    return _of_body(message, {named.name: named.pose for named in message.poses}, body)


def _of_body(message: Any, named: dict[str, Pose], body: str) -> Measurement | Rejection:
    if body not in named:
        there = ", ".join(sorted(named)) or "none"
        return Rejection(Reason.NOT_TRACKED, f"body '{body}' is not among those seen: {there}")
    return _measurement(message, named[body])


def _measurement(
    message: Any, pose: Pose, covariance: Sequence[float] | None = None
) -> Measurement:
    return Measurement(
        stamp_ns(message),
        message.header.frame_id,
        array(pose.position),
        array(pose.orientation),
        None if covariance is None else _covariance(covariance),
    )


def _covariance(values: Sequence[float]) -> Array | None:
    """Return a covariance; ``None`` where the sender says by zeros or -1 that it knows none."""
    matrix = np.array(values, dtype=float).reshape(6, 6)
    variances = np.diag(matrix)
    if not np.isfinite(matrix).all() or (variances < 0).any() or not variances.any():
        return None
    return matrix


class _Frames:
    """The pose of the body's frame out of all transforms that are sent."""

    def __init__(self, config: PoseInputConfig) -> None:
        self._tree = TransformTree()
        self._frame_id = config.frame_id
        self._reference, self._body = config.tf_reference_frame, config.body
        self._stamp_ns = -1

    def take_static(self, message: Any) -> None:
        """Take transforms that never change."""
        for transform in message.transforms:
            self._put(transform, static=True)

    def take(self, message: Any) -> Measurement | Rejection | None:
        """Take transforms; return the pose of the body if it is newer than the last one."""
        for transform in message.transforms:
            if rejection := self._put(transform, static=False):
                return rejection
        pose = self._tree.pose(self._reference, self._body)
        # Other transforms come in between; time may also have been set back.
        if pose is None or pose.stamp_ns is None or pose.stamp_ns == self._stamp_ns:
            return None
        self._stamp_ns = pose.stamp_ns
        # The frame in which it was looked up was chosen for the published one.
        return Measurement(pose.stamp_ns, self._frame_id, pose.position, pose.rotation.as_quat())

    def _put(self, message: TransformStamped, static: bool) -> Rejection | None:
        position = array(message.transform.translation)
        xyzw = array(message.transform.rotation)
        if rejection := unusable(position, xyzw):
            # Bad numbers of frames that are nobody's business here must not refuse a pose.
            return rejection if message.child_frame_id == self._body else None
        self._tree.put(
            message.child_frame_id,
            Edge(
                message.header.frame_id,
                None if static else stamp_ns(message),
                position,
                Rotation.from_quat(xyzw),
            ),
        )
        return None
