"""What the messages of each source say, and that each source is heard on real DDS.

Fields of packages that are not installed everywhere are read from plain objects here; where the
package is there, its real messages are sent, too.
"""

import importlib
import importlib.util
import math
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import Pose, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from snake_interfaces.msg import PoseStatus

from snake_control.config import PoseInputConfig
from snake_control.control.head_filter import Reason, Rejection
from snake_control.nodes import pose_sources as s
from snake_control.nodes import topics
from snake_control.nodes.conversions import array, header, point, quaternion, vector
from support.graph import Graph

STAMP = 1_795_401_446_954_348_310
PLACE = (0.4, -0.3, 0.2)
XYZW = Rotation.from_euler("ZYX", [2.5, -0.8, 0.1]).as_quat()
COVARIANCE = np.diag([1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 6e-6])
FOREIGN = {
    "rigid_bodies": topics.MOCAP_RIGID_BODIES,
    "named_poses": topics.MOCAP_NAMED_POSES,
    "tf": topics.MOCAP_TF,
}


def pose(place=PLACE):
    return Pose(position=point(place), orientation=quaternion(XYZW))


def transform(parent, child, place=PLACE, xyzw=XYZW, stamp=STAMP):
    message = TransformStamped(header=header(stamp, parent), child_frame_id=child)
    message.transform.translation, message.transform.rotation = vector(place), quaternion(xyzw)
    return message


def with_covariance(kind, covariance=COVARIANCE, **fields):
    message = kind(header=header(STAMP, "map"), **fields)
    message.pose.pose = pose()
    message.pose.covariance = np.asarray(covariance).ravel()
    return message


def rigid_bodies(**bodies):
    found = [SimpleNamespace(rigid_body_name=n, markers=[], pose=p) for n, p in bodies.items()]
    return SimpleNamespace(header=header(STAMP, "map"), frame_number=7, rigidbodies=found)


def named_poses(**bodies):
    found = [SimpleNamespace(name=n, pose=p) for n, p in bodies.items()]
    return SimpleNamespace(header=header(STAMP, "map"), poses=found)


@pytest.mark.parametrize(
    "measured",
    [
        s.from_pose_with_covariance(with_covariance(PoseWithCovarianceStamped)),
        s.from_odometry(with_covariance(Odometry, child_frame_id="head"), "head"),
        s.from_odometry(with_covariance(Odometry, child_frame_id="head"), ""),
        s.from_transform(transform("map", "head"), "head"),
        s.from_rigid_bodies(rigid_bodies(foot=pose((9.0, 9.0, 9.0)), head=pose()), "head"),
        s.from_named_poses(named_poses(foot=pose((9.0, 9.0, 9.0)), head=pose()), "head"),
    ],
)
def test_time_frame_and_pose_are_taken(measured):
    assert (measured.stamp_ns, measured.frame_id) == (STAMP, "map")
    np.testing.assert_array_equal(measured.position, PLACE)
    np.testing.assert_array_equal(measured.quaternion, XYZW)
    if measured.covariance is not None:
        np.testing.assert_array_equal(measured.covariance, COVARIANCE)


@pytest.mark.parametrize(
    "covariance",
    [np.zeros((6, 6)), np.diag([-1.0, 0, 0, 0, 0, 0]), np.diag([math.nan, 1, 1, 1, 1, 1])],
)
def test_a_covariance_that_says_nothing_is_none(covariance):
    message = with_covariance(PoseWithCovarianceStamped, covariance)
    assert s.from_pose_with_covariance(message).covariance is None


def test_poses_of_other_bodies_are_not_ours():
    assert s.from_transform(transform("map", "foot"), "head") is None
    assert s.from_odometry(with_covariance(Odometry, child_frame_id="foot"), "head") is None


@pytest.mark.parametrize(
    "measured",
    [
        s.from_rigid_bodies(rigid_bodies(foot=pose(), arm=pose()), "head"),
        s.from_named_poses(named_poses(foot=pose(), arm=pose()), "head"),
    ],
)
def test_a_body_that_is_missing_was_not_tracked(measured):
    assert isinstance(measured, Rejection)
    assert measured.reason is Reason.NOT_TRACKED
    assert "'head' is not among those seen: arm, foot" in measured.text


def frames(**changes):
    given = {"source": "tf", "body": "head", "tf_reference_frame": "room", **changes}
    return s._Frames(PoseInputConfig(**given))


def tf(*transforms):
    return SimpleNamespace(transforms=list(transforms))


def test_tf_is_followed_along_the_frames():
    found = frames()
    turn = Rotation.from_euler("z", math.pi / 2)
    found.take_static(tf(transform("room", "cameras", (1.0, 0.0, 0.0), turn.as_quat(), 0)))
    assert found.take(tf(transform("elsewhere", "other"))) is None
    measured = found.take(tf(transform("cameras", "head", (0.5, 0.25, 0.2))))
    assert (measured.stamp_ns, measured.frame_id) == (STAMP, "world")
    np.testing.assert_allclose(measured.position, [0.75, 0.5, 0.2])
    expected = turn * Rotation.from_quat(XYZW)
    assert (Rotation.from_quat(measured.quaternion) * expected.inv()).magnitude() < 1e-12
    # Nothing new about the body.
    assert found.take(tf(transform("elsewhere", "other", stamp=STAMP + 5))) is None
    assert found.take(tf(transform("cameras", "head", stamp=STAMP + 9))).stamp_ns == STAMP + 9


def test_bad_numbers_in_tf_concern_only_the_body():
    found = frames()
    assert found.take(tf(transform("room", "other", xyzw=(0, 0, 0, 0)))) is None
    bad = found.take(tf(transform("room", "head", (math.nan, 0, 0))))
    assert isinstance(bad, Rejection)
    assert bad.reason is Reason.NOT_FINITE


def message_of(source, stamp):
    """A real message of a source whose package is installed."""
    if source == "pose_with_covariance":
        return with_covariance(PoseWithCovarianceStamped)
    if source == "odometry":
        return with_covariance(Odometry, child_frame_id="head")
    if source == "transform":
        return transform("map", "head")
    module = importlib.import_module(f"{FOREIGN[source].package}.msg")
    if source == "tf":
        return module.TFMessage(transforms=[transform("map", "head", stamp=stamp)])
    if source == "rigid_bodies":
        body = module.RigidBody(rigid_body_name="head", pose=pose())
        return module.RigidBodies(header=header(0, "map"), rigidbodies=[body])
    body = module.NamedPose(name="head", pose=pose())
    return module.NamedPoseArray(header=header(0, "map"), poses=[body])


TOPICS = {
    "pose_with_covariance": topics.MOCAP_POSE_WITH_COVARIANCE,
    "odometry": topics.MOCAP_ODOMETRY,
    "transform": topics.MOCAP_TRANSFORM,
    **FOREIGN,
}


@pytest.mark.real_time
@pytest.mark.parametrize("source", TOPICS)
def test_a_source_is_heard(source):
    topic = TOPICS[source]
    if isinstance(topic, topics.ForeignTopic):
        pytest.importorskip(f"{topic.package}.msg", reason=f"{topic.package} is not installed")
        topic = topic.load()
    with Graph() as graph:
        odometry = graph.subscribe(topics.HEAD_ODOMETRY)
        status = graph.subscribe(topics.HEAD_STATUS)
        graph.start(
            "pose_input",
            params={
                "source": source,
                "body": "head",
                "pose_frames": ["map"],
                "tf_reference_frame": "map",
                "marker_position_m": [0.0, 0.0, 0.1],
            },
        )
        publisher = graph.publisher(topic, wait=True)

        def arrived():
            now = graph.now_ns()
            message = message_of(source, now)
            if source != "tf":
                message.header.stamp = header(now).stamp
            publisher.publish(message)
            return odometry.last

        last = graph.wait_for(arrived, 20.0, f"odometry of {source}")
        assert last.header.frame_id == "world"
        lever = Rotation.from_quat(XYZW).apply([0.0, 0.0, 0.1])
        np.testing.assert_allclose(array(last.pose.pose.position), PLACE - lever, atol=1e-9)
        graph.wait_for(
            lambda: arrived() and status.last and status.last.status == PoseStatus.STATUS_VALID,
            20.0,
            "validity",
        )
        if source in ("pose_with_covariance", "odometry"):
            # Once the unknown speed of the start has faded.
            def known():
                covariance = arrived().pose.covariance
                return abs(covariance[35] / covariance[28] - 6 / 5) < 0.01

            graph.wait_for(known, 20.0, "the covariance that was given")


@pytest.mark.real_time
@pytest.mark.parametrize("source", FOREIGN)
def test_a_package_that_is_missing_is_named(source):
    package = FOREIGN[source].package
    if importlib.util.find_spec(package) is not None:
        pytest.skip(f"{package} is installed")
    with Graph() as graph:
        process = graph.start("pose_input", params={"source": source, "body": "head"})
        assert process.wait(30.0) == 2
        output = process.output()
        assert f"source = '{source}'" in output
        assert f"{package} cannot be imported" in output
        assert FOREIGN[source].origin in output
        assert "Traceback" not in output
