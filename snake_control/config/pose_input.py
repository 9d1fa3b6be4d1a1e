"""The group of the configuration that belongs to the node ``pose_input``."""

from __future__ import annotations

import dataclasses
import math

from snake_control.config.parameter import parameter
from snake_control.errors import ConfigError

SOURCES = (
    "pose",
    "pose_with_covariance",
    "transform",
    "odometry",
    "rigid_bodies",
    "named_poses",
    "tf",
)
"""Where poses come from; docs/pose.md says which topic and type each of them is."""

_SOURCES_OF_MANY_BODIES = ("rigid_bodies", "named_poses", "tf")


@dataclasses.dataclass(frozen=True)
class PoseInputConfig:
    """Parameters of the node ``pose_input``."""

    source: str = parameter("pose", "type of the poses (docs/pose.md)", choices=SOURCES)
    body: str = parameter(
        "",
        "name of the rigid body on the head, or of its frame; rigid_bodies, named_poses and tf "
        "need it, transform and odometry take poses of any other body for none of ours",
    )
    tf_reference_frame: str = parameter(
        "world", "source tf: frame in which the pose of `body` is looked up"
    )
    frame_id: str = parameter("world", "frame in which the head pose is published")
    child_frame_id: str = parameter("link_1", "frame of the head, origin at its tip")
    pose_frames: tuple[str, ...] = parameter(
        (),
        "other names that the motion capture gives to frame_id, such as map or vicon_world; any: "
        "whatever it says. Poses of another frame are refused",
    )
    y_up: bool = parameter(
        False, "the y axis of the motion capture points up; it is turned so that z does"
    )
    marker_position_m: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "where the origin of the tracked body is, in link_1: x, y, z [m]",
        low=-10.0,
        high=10.0,
    )
    marker_rpy_rad: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "how the tracked body is turned against link_1: roll, pitch, yaw [rad]",
        low=-2 * math.pi,
        high=2 * math.pi,
    )
    unstamped: str = parameter(
        "refuse",
        "what becomes of a pose with stamp 0: refuse, or arrival for the time of its arrival, "
        "which hides how late it is",
        choices=("refuse", "arrival"),
    )
    cutoff_hz: float = parameter(
        3.0, "bandwidth of the filter that yields pose and twist", low=0.1, high=100.0
    )
    max_rate_hz: float = parameter(
        125.0,
        "odometry is published no more often than this on average; all poses serve the filter",
        low=20.0,
        high=1000.0,
    )
    timeout_s: float = parameter(
        0.1, "without a pose this fresh the head pose is not valid [s]", low=0.01, high=10.0
    )
    bridge_s: float = parameter(
        0.3,
        "for so long since the last good pose the joints say where the head is, where no poses "
        "come; 0: never [s]",
        low=0.0,
        high=1.0,
    )
    watch: bool = parameter(
        True, "compare the poses with the joints, and say what seems to be wrong (docs/pose.md)"
    )
    position_noise_m: float = parameter(
        0.0005,
        "standard deviation of a measured position, per axis, where the source gives none; the "
        "covariance of the odometry follows from it [m]",
        low=0.0,
        high=1.0,
    )
    rotation_noise_rad: float = parameter(
        0.002, "the same for a measured rotation, per axis [rad]", low=0.0, high=1.0
    )
    max_speed_m_s: float = parameter(
        1.0, "faster than this no head moves: the pose is an outlier [m/s]", low=0.01, high=100.0
    )
    max_turning_rad_s: float = parameter(
        6.0, "faster than this no head turns: the pose is an outlier [rad/s]", low=0.1, high=100.0
    )
    jump_tolerance_m: float = parameter(
        0.03, "distance that no pose is refused for, however soon it follows [m]", low=0, high=10.0
    )
    jump_tolerance_rad: float = parameter(
        0.15, "angle that no pose is refused for, however soon it follows [rad]", low=0, high=4.0
    )
    new_place_after_poses: int = parameter(
        30,
        "so many outliers in a row that agree with each other are believed, if they last for "
        "timeout_s: the robot was carried",
        low=2,
        high=100000,
    )
    frozen_after_s: float = parameter(
        0.1,
        "poses that stay the same to the last bit for so long, after poses that carried noise, "
        "are frozen; 0: never look [s]",
        low=0.0,
        high=60.0,
    )
    frozen_noise_m: float = parameter(
        5e-6, "poses with less noise than this may repeat: a simulator's [m]", low=0.0, high=1.0
    )
    clock_window_s: float = parameter(
        10.0,
        "the offset of the stamps is the least age on arrival within this time [s]",
        low=0.5,
        high=600.0,
    )
    max_delay_s: float = parameter(
        0.05,
        "warn when no pose within clock_window_s is younger than this on arrival [s]",
        low=0.001,
        high=10.0,
    )
    clock_tolerance_s: float = parameter(
        0.001,
        "warn when stamps are further than this ahead of this computer's clock [s]",
        low=0.0,
        high=0.005,
    )
    clock_drift_s: float = parameter(
        0.002,
        "warn when the offset of the stamps has changed by more than this in six windows [s]",
        low=1e-5,
        high=1.0,
    )
    diagnostics_period_s: float = parameter(1.0, "period of /diagnostics [s]", low=0.1, high=60.0)

    def __post_init__(self) -> None:
        for name in ("marker_position_m", "marker_rpy_rad"):
            if len(getattr(self, name)) != 3:
                raise ConfigError(name, list(getattr(self, name)), "give 3 numbers")
        if self.source in _SOURCES_OF_MANY_BODIES and not self.body:
            raise ConfigError(
                "body", self.body, f"source {self.source} has many bodies: name the one of the head"
            )
