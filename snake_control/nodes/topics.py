"""Every topic and service of the nodes: name, type and quality of service, in one place.

All names are relative, so that one namespace holds one robot; `~/x` belongs to one node.
"""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    Twist,
    TwistStamped,
)
from nav_msgs.msg import Odometry, Path
from rcl_interfaces.msg import Log
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from sensor_msgs.msg import JointState
from snake_interfaces.action import FollowHeadTrajectory, GoToPosture, Reshape
from snake_interfaces.msg import (
    BusState,
    ControllerState,
    HeadReference,
    HeadTrajectoryStatus,
    JointVelocityCommand,
    PlantState,
    PoseStatus,
)
from snake_interfaces.srv import InjectFault
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    # Part of every installed ROS, but not of the wheels.
    TFMessage = None


@dataclasses.dataclass(frozen=True)
class Topic:
    """A topic's relative name, message type and QoS (the same on both sides)."""

    name: str
    type: type
    qos: QoSProfile

    def of(self, node: str) -> Topic:
        """Return a topic of a node's own, ``~/x``, as others name it."""
        return dataclasses.replace(self, name=self.name.replace("~", node, 1))

    @property
    def newest_only(self) -> QoSProfile:
        """QoS of a subscriber that is late: it takes the newest message, and no old ones first."""
        return QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=1,
            reliability=self.qos.reliability,
            durability=self.qos.durability,
        )


@dataclasses.dataclass(frozen=True)
class ForeignTopic:
    """A topic whose type comes with a package that not everybody has installed.

    Attributes:
        name, qos: as for ``Topic``.
        package, type_name: where the type is.
        origin: how to get the package.
    """

    name: str
    package: str
    type_name: str
    qos: QoSProfile
    origin: str

    def load(self) -> Topic:
        """Return the topic with its type.

        Raises:
            ImportError: the package is not there.
        """
        module = importlib.import_module(f"{self.package}.msg")
        return Topic(self.name, getattr(module, self.type_name), self.qos)


@dataclasses.dataclass(frozen=True)
class Action:
    """An action's name and type."""

    name: str
    type: Any


@dataclasses.dataclass(frozen=True)
class Service:
    """A service's name and type."""

    name: str
    type: Any


def _reliable(depth: int, durability: DurabilityPolicy = DurabilityPolicy.VOLATILE) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )


_STATE = _reliable(10)
# Of commands and references only the newest counts.
_COMMAND = _reliable(1)
_LATCHED = _reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)

JOINT_VELOCITY_COMMAND = Topic("joint_velocity_command", JointVelocityCommand, _COMMAND)
JOINT_STATES = Topic("joint_states", JointState, _STATE)
BUS_STATE = Topic("bus_state", BusState, _STATE)
EMERGENCY_STOP_ACTIVE = Topic("~/emergency_stop_active", Bool, _LATCHED)
# Absolute by ROS convention: one aggregator serves the whole graph.
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, _STATE)

# Best effort takes poses of reliable publishers, too; of each only the newest few count.
MOCAP_POSE = Topic("mocap/pose", PoseStamped, qos_profile_sensor_data)
MOCAP_POSE_WITH_COVARIANCE = Topic(
    "mocap/pose_with_covariance", PoseWithCovarianceStamped, qos_profile_sensor_data
)
MOCAP_TRANSFORM = Topic("mocap/transform", TransformStamped, qos_profile_sensor_data)
MOCAP_ODOMETRY = Topic("mocap/odometry", Odometry, qos_profile_sensor_data)
MOCAP_RIGID_BODIES = ForeignTopic(
    "mocap/rigid_bodies",
    "mocap4r2_msgs",
    "RigidBodies",
    qos_profile_sensor_data,
    "build https://github.com/MOCAP4ROS2-Project/mocap4r2_msgs (Jazzy has no apt package of it)",
)
MOCAP_NAMED_POSES = ForeignTopic(
    "mocap/poses",
    "motion_capture_tracking_interfaces",
    "NamedPoseArray",
    qos_profile_sensor_data,
    "sudo apt install ros-jazzy-motion-capture-tracking-interfaces",
)
# Absolute by ROS convention, and with many senders.
MOCAP_TF = ForeignTopic(
    "/tf",
    "tf2_msgs",
    "TFMessage",
    QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=100, reliability=ReliabilityPolicy.BEST_EFFORT
    ),
    "sudo apt install ros-jazzy-tf2-msgs",
)
MOCAP_TF_STATIC = dataclasses.replace(
    MOCAP_TF, name="/tf_static", qos=_reliable(100, DurabilityPolicy.TRANSIENT_LOCAL)
)
HEAD_ODOMETRY = Topic("head/odometry", Odometry, _STATE)
HEAD_STATUS = Topic("head/status", PoseStatus, _STATE)

HEAD_REFERENCE = Topic("head/reference", HeadReference, _COMMAND)
HEAD_PLANNED_PATH = Topic("head/planned_path", Path, _LATCHED)
HEAD_PATH = Topic("head/path", Path, _STATE)
HEAD_TRAJECTORY = Topic("head/trajectory", MultiDOFJointTrajectory, _STATE)
# Each status counts: one may say why a motion was refused while another goes on.
HEAD_TRAJECTORY_STATUS = Topic(
    "head/trajectory_status",
    HeadTrajectoryStatus,
    _reliable(10, DurabilityPolicy.TRANSIENT_LOCAL),
)
CMD_VEL = Topic("cmd_vel", TwistStamped, _COMMAND)
CMD_VEL_UNSTAMPED = Topic("cmd_vel", Twist, _COMMAND)

CONTROLLER_STATE = Topic("controller_state", ControllerState, _STATE)
MARKERS = Topic("markers", MarkerArray, _COMMAND)

PLANT_STATE = Topic("ground_truth/plant_state", PlantState, _STATE)

ROBOT_DESCRIPTION = Topic("robot_description", String, _LATCHED)
# Absolute, as tf2's listeners have it: frames of several robots differ by their prefix.
TF = None if TFMessage is None else Topic("/tf", TFMessage, _reliable(100))
# ROS's own: what the nodes log.
ROSOUT = Topic("/rosout", Log, _reliable(1000, DurabilityPolicy.TRANSIENT_LOCAL))

_OWNERS = {EMERGENCY_STOP_ACTIVE.name: "bus_driver"}
ALL = tuple(
    topic.of(_OWNERS[topic.name]) if topic.name.startswith("~") else topic
    for topic in tuple(globals().values())
    if isinstance(topic, Topic)
)
"""Every topic of one robot as others name it, for recordings; one name may have several types."""

SET_TORQUE = Service("~/set_torque", SetBool)
RECOVER = Service("~/recover", Trigger)
EMERGENCY_STOP = Service("~/emergency_stop", Trigger)
RESET_EMERGENCY_STOP = Service("~/reset_emergency_stop", Trigger)
INJECT_FAULT = Service("~/inject_fault", InjectFault)
CLEAR_FAULTS = Service("~/clear_faults", Trigger)
ENABLE = Service("~/enable", SetBool)
START = Service("~/start", Trigger)
STOP = Service("~/stop", Trigger)
PREVIEW = Service("~/preview", Trigger)
RETURN = Service("~/return", Trigger)

FOLLOW_HEAD_TRAJECTORY = Action("follow_head_trajectory", FollowHeadTrajectory)
GO_TO_POSTURE = Action("go_to_posture", GoToPosture)
RESHAPE = Action("reshape", Reshape)
