"""The groups of the configuration that belong to one node each."""

from __future__ import annotations

import dataclasses
import math

from snake_control.config.parameter import parameter
from snake_control.config.postures import PosturesConfig
from snake_control.config.robot import RobotConfig, per_joint
from snake_control.errors import ConfigError

SDK_BAUD_RATES = (9600, 19200, 57600, 115200, 500000, 1000000)
"""Rates that an AX-12 can be set to and that dynamixel_sdk can open."""


@dataclasses.dataclass(frozen=True)
class BusDriverConfig:
    """Parameters of the node ``bus_driver``."""

    port: str = parameter("/dev/ttyUSB0", "serial device, or any path that leads to one")
    baud_rate: int = parameter(1000000, "bits per second", choices=SDK_BAUD_RATES)
    rate_hz: float = parameter(50.0, "bus cycles per second", low=1.0, high=500.0)
    command_timeout_s: float = parameter(
        0.1, "without a command this fresh the joints hold [s]", low=0.02, high=1.0
    )
    reply_timeout_s: float = parameter(
        0.015, "how long to wait for a reply beyond its time on the wire [s]", low=0.001, high=0.1
    )
    retries: int = parameter(1, "how often a missed reply is asked for again", low=0, high=5)
    lost_after_misses: int = parameter(
        25, "missed reads in a row after which a servo counts as lost", low=1, high=1000
    )
    unheard_timeout_s: float = parameter(
        0.5,
        "stop when a driven joint has given no believable reading for so long; at usual rates that "
        "is before lost_after_misses [s]",
        low=0.1,
        high=60.0,
    )
    follow_timeout_s: float = parameter(
        1.0,
        "stop when a joint was told to move for so long and is not seen moving: blocked, or its "
        "sensor is stuck [s]",
        low=0.2,
        high=60.0,
    )
    look_ahead_s: float = parameter(
        0.15,
        "how far ahead of the joint its goal is kept, as time at its speed [s]; margin and slope "
        "of its compliance are added",
        low=0.04,
        high=1.0,
    )
    acceleration_limit_rad_s2: float = parameter(
        0.0, "limit of the change of commanded speed, 0 for none [rad/s^2]", low=0.0, high=1e4
    )
    torque_on_activate: bool = parameter(
        True, "switch torque on at activation, after goals were seeded from present positions"
    )
    torque_off_on_exit: bool = parameter(
        False, "switch torque off when the node ends (a raised head then falls)"
    )
    lower_before_torque_off: bool = parameter(
        False, "move slowly to lowering_angles_rad before torque goes off on purpose"
    )
    lowering_angles_rad: tuple[float, ...] = parameter(
        (0.0,),
        "where the joints stand when torque goes off, one for all or for each joint [rad]",
        low=-2 * math.pi,
        high=2 * math.pi,
    )
    lowering_posture: str = parameter(
        "", "the same by name, one of the group postures; then lowering_angles_rad counts no more"
    )
    lowering_speed_rad_s: float = parameter(
        0.2,
        "speed of the joint that has the longest way to go; the others arrive with it [rad/s]",
        low=0.02,
        high=2.0,
    )
    reconnect_first_s: float = parameter(
        0.5, "after a lost port: time until it is opened again [s]", low=0.05, high=60.0
    )
    reconnect_longest_s: float = parameter(
        5.0,
        "each try that fails doubles the time until the next, up to this [s]",
        low=0.05,
        high=600.0,
    )
    dry_run: bool = parameter(
        False,
        "write nothing to any servo: read them, and say what each command would make of them",
    )
    feedback_timeout_s: float = parameter(
        0.1,
        "while the reading of any joint is older, joint_states is not published [s]",
        low=0.01,
        high=10.0,
    )
    diagnostics_period_s: float = parameter(1.0, "period of /diagnostics [s]", low=0.1, high=60.0)
    temperature_warn_c: float = parameter(60.0, "warn from this temperature [degC]", low=0.0)
    voltage_low_warn_v: float = parameter(9.5, "warn below this voltage [V]", low=0.0)
    voltage_high_warn_v: float = parameter(12.6, "warn above this voltage [V]", low=0.0)
    communication_error_warn: float = parameter(
        0.05,
        "warn from this share of requests without a good reply at the first try",
        low=0.0,
        high=1.0,
    )
    load_warn: float = parameter(
        0.8, "warn from this load, as share of the largest output", low=0.0, high=1.0
    )
    torque_warn_n_m: float = parameter(
        0.3,
        "warn when gravity asks more of a joint, by the model: what an AX-12 should carry for "
        "long, a fifth of its stall torque [N m]",
        low=0.0,
        high=1e3,
    )
    autostart: bool = parameter(True, "configure and activate without a lifecycle manager")

    def __post_init__(self) -> None:
        if self.look_ahead_s * self.rate_hz < 2.0:
            raise ConfigError(
                "look_ahead_s",
                self.look_ahead_s,
                f"at least two bus cycles, {2.0 / self.rate_hz:g} s at rate_hz = "
                f"{self.rate_hz:g}, or joints pause between two goals",
            )
        if self.reconnect_longest_s < self.reconnect_first_s:
            raise ConfigError(
                "reconnect_longest_s",
                self.reconnect_longest_s,
                f"at least reconnect_first_s = {self.reconnect_first_s:g}",
            )
        if self.voltage_high_warn_v <= self.voltage_low_warn_v:
            raise ConfigError(
                "voltage_high_warn_v",
                self.voltage_high_warn_v,
                f"more than voltage_low_warn_v = {self.voltage_low_warn_v:g}",
            )

    def for_robot(self, robot: RobotConfig, postures: PosturesConfig) -> BusDriverConfig:
        """Return this with one lowering angle for each joint.

        Raises:
            ConfigError: as many as there are joints, or one; and inside the joints' ranges if they
                are to be used; or no posture of that name.
        """
        field = "lowering_angles_rad"
        angles = per_joint(field, self.lowering_angles_rad, robot.joints)
        if self.lowering_posture:
            angles = postures.angles("lowering_posture", self.lowering_posture)
        if self.lower_before_torque_off:
            for i, angle in enumerate(angles):
                lower, upper = robot.joint_range(i + 1)
                if not lower <= angle <= upper:
                    raise ConfigError(
                        f"{field}[{i}]",
                        angle,
                        f"inside the range of joint {i + 1}, {lower:g} to {upper:g}",
                    )
        return dataclasses.replace(self, lowering_angles_rad=angles)


@dataclasses.dataclass(frozen=True)
class ScpControllerConfig:
    """Parameters of the node ``scp_controller`` beside the shared groups."""

    rate_hz: float = parameter(50.0, "control steps per second", low=1.0, high=500.0)
    joint_states_timeout_s: float = parameter(
        0.1, "joint states older than this command zero [s]", low=0.02, high=1.0
    )
    head_timeout_s: float = parameter(
        0.1, "head pose older than this commands zero [s]", low=0.02, high=1.0
    )
    reference_timeout_s: float = parameter(
        0.2, "reference older than this commands zero [s]", low=0.02, high=10.0
    )
    max_position_error_m: float = parameter(
        0.3,
        "a head further than this from its reference gets zero velocity: the robot was stopped, "
        "or a pose is wrong; it must not lunge after the reference [m]",
        low=1e-3,
        high=1000.0,
    )
    max_rotation_error_rad: float = parameter(
        2.5, "the same for roll, pitch and yaw, each [rad]", low=0.01, high=4.0
    )
    posture_speed_rad_s: float = parameter(
        0.3,
        "go_to_posture and reshape: speed of the fastest joint, if none is given [rad/s]",
        low=1e-3,
        high=10.0,
    )
    posture_acceleration_rad_s2: float = parameter(
        1.0,
        "go_to_posture and reshape: largest acceleration of a joint [rad/s^2]",
        low=0.01,
        high=100.0,
    )
    posture_gain_per_s: float = parameter(
        2.0,
        "go_to_posture and reshape: speed for each radian that a joint is away from where it "
        "should be [1/s]",
        low=0.1,
        high=20.0,
    )
    posture_tolerance_rad: float = parameter(
        0.02,
        "go_to_posture and reshape: every joint has arrived within this, four counts of an AX-12 "
        "[rad]",
        low=1e-3,
        high=0.5,
    )
    posture_patience_s: float = parameter(
        5.0,
        "go_to_posture and reshape: how long nothing may come nearer before they give up [s]",
        low=0.5,
        high=60.0,
    )
    enabled: bool = parameter(True, "follow references from the start (see ~/enable)")
    frame_id: str = parameter("world", "frame in which head pose and reference are given")


@dataclasses.dataclass(frozen=True)
class TrajectoryGeneratorConfig:
    """Parameters of the node ``trajectory_generator``; defaults are Table 1's trajectory."""

    rate_hz: float = parameter(50.0, "references per second", low=1.0, high=500.0)
    frame_id: str = parameter("world", "frame of the references")
    trajectory: str = parameter(
        "line",
        "what ~/start follows: line, hold (stay where the head is), or file (trajectory_file)",
        choices=("line", "hold", "file"),
    )
    trajectory_file: str = parameter(
        "",
        "a .yaml or .csv file that ~/start follows, whatever trajectory says (docs/drive.md); "
        "empty for none",
        run_time=True,
    )
    start_from: str = parameter(
        "given",
        "given: the line starts at start_pose; head: it starts where the head is",
        choices=("given", "head"),
    )
    start_pose: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.2, 0.39269908169872414, 0.39269908169872414, 0.0),
        "w_d(0) = [x, y, z, R, P, Y] of the line [m, rad]",
    )
    velocity: tuple[float, ...] = parameter(
        (0.01, 0.0, 0.0, 0.0, 0.0, 0.0), "w_d's velocity along the line [m/s, rad/s]"
    )
    duration_s: float = parameter(
        0.0, "length of the line, 0 for endless; its end is held [s]", low=0.0
    )
    autostart: bool = parameter(False, "start as soon as the head pose is known")
    cmd_vel_stamped: bool = parameter(
        True, "cmd_vel is a TwistStamped; false: a Twist, as older teleoperation nodes send it"
    )
    cmd_vel_frame: str = parameter(
        "link_1",
        "frame in which a cmd_vel without a stamp is meant: world, or link_1 for the level frame "
        "that looks where the head looks",
        choices=("world", "link_1"),
    )
    head_timeout_s: float = parameter(
        0.1,
        "a motion that starts where the head is needs a head pose this fresh [s]",
        low=0.02,
        high=1.0,
    )
    cmd_vel_timeout_s: float = parameter(
        0.5,
        "without cmd_vel this fresh the teleoperated head is brought to rest [s]",
        low=0.05,
        high=10.0,
    )
    max_linear_speed_m_s: float = parameter(
        0.05,
        "cmd_vel is limited to this speed, faster trajectories are refused [m/s]",
        low=1e-4,
        high=10.0,
    )
    max_angular_speed_rad_s: float = parameter(
        0.3,
        "cmd_vel is limited to this angular speed; trajectories, by each of R, P, Y [rad/s]",
        low=1e-4,
        high=10.0,
    )
    max_linear_acceleration_m_s2: float = parameter(
        0.1,
        "how fast the teleoperated head speeds up and slows down, and trajectories may [m/s^2]",
        low=1e-3,
        high=100.0,
    )
    max_angular_acceleration_rad_s2: float = parameter(
        1.0,
        "how fast the rates of R, P, Y of a teleoperated head change [rad/s^2]",
        low=1e-3,
        high=100.0,
    )

    speed_m_s: float = parameter(
        0.01,
        "files, goals and paths: speed of the tip, if none is given [m/s]",
        low=1e-4,
        high=1.0,
    )
    turning_speed_rad_s: float = parameter(
        0.1,
        "files, goals and paths: speed of each of roll, pitch and yaw, if none is given [rad/s]",
        low=1e-4,
        high=10.0,
    )
    acceleration_m_s2: float = parameter(
        0.02,
        "files, goals and paths: acceleration along the path, if none is given [m/s^2]",
        low=1e-3,
        high=100.0,
    )
    min_turn_radius_m: float = parameter(
        0.1,
        "files, goals and paths: a curve that turns on more tightly is refused at once; 0 for none "
        "(the rehearsal refuses what the robot cannot do, too) [m]",
        low=0.0,
        high=100.0,
    )
    stamp_tolerance_s: float = parameter(
        0.5,
        "head/path and head/trajectory: how far in the past a stamp may be that says when to start "
        "[s]",
        low=0.0,
        high=60.0,
    )
    arrival_position_m: float = parameter(
        0.01, "follow_head_trajectory: the head has arrived within this [m]", low=1e-4, high=1.0
    )
    arrival_rotation_rad: float = parameter(
        0.05, "follow_head_trajectory: the head has arrived within this [rad]", low=1e-3, high=3.0
    )
    arrival_timeout_s: float = parameter(
        20.0,
        "follow_head_trajectory: how long the head may be away from the end after the reference "
        "has come there [s]",
        low=0.1,
        high=600.0,
    )

    def __post_init__(self) -> None:
        for name in ("start_pose", "velocity"):
            values = getattr(self, name)
            if len(values) != 6:
                raise ConfigError(name, list(values), "give 6 numbers: x, y, z, R, P, Y")
        if self.trajectory == "file" and not self.trajectory_file:
            raise ConfigError("trajectory_file", "", "name the file that ~/start shall follow")

    @property
    def follows_file(self) -> bool:
        """Whether ``~/start`` follows a file."""
        return bool(self.trajectory_file)


@dataclasses.dataclass(frozen=True)
class KeyboardTeleopConfig:
    """Parameters of the node ``keyboard_teleop``."""

    rate_hz: float = parameter(20.0, "cmd_vel messages per second", low=5.0, high=100.0)
    speed_m_s: float = parameter(0.02, "speed of the head at scale 1 [m/s]", low=1e-4, high=1.0)
    turning_speed_rad_s: float = parameter(
        0.15, "speed of its rotation at scale 1 [rad/s]", low=1e-3, high=10.0
    )
    hold_s: float = parameter(
        0.6,
        "how long a key counts: a keyboard repeats a key that is held only after a pause [s]",
        low=0.05,
        high=2.0,
    )


@dataclasses.dataclass(frozen=True)
class DescriptionConfig:
    """Parameters of the node ``description``."""

    frame_id: str = parameter("world", "frame in which head/odometry gives the head's pose")
    frame_prefix: str = parameter(
        "", "put before link_1 .. link_n, so that several robots have frames of their own"
    )
    transforms: str = parameter(
        "all",
        "what goes to /tf: all; head (world to link_1 alone, beside robot_state_publisher); none",
        choices=("all", "head", "none"),
    )


@dataclasses.dataclass(frozen=True)
class RecordConfig:
    """Parameters of the node ``record``."""

    file: str = parameter(
        "", "MCAP file to make; empty: snake_DATE_TIME.mcap in the current directory"
    )
    strip_namespace: bool = parameter(
        False, "write the robot's topics without its namespace, as the layouts name them"
    )
    flush_period_s: float = parameter(
        1.0, "how much the file lacks at most when this process is killed [s]", low=0.05, high=60.0
    )
    queue: int = parameter(
        1000, "messages of each topic that may wait until they are written", low=1, high=100000
    )


@dataclasses.dataclass(frozen=True)
class MockBusConfig:
    """Parameters of the node ``mock_bus``: simulated servos, floor and motion capture."""

    port: str = parameter(
        "/tmp/snake_control_mock_bus", "symbolic link to the serial port that the mock opens"
    )
    seed: int = parameter(0, "seed of all random numbers", low=0, high=2**31 - 1)
    baud_rate: int = parameter(
        1000000, "rate that every servo listens at [bit/s]", choices=SDK_BAUD_RATES
    )
    step_hz: float = parameter(200.0, "steps of the servos per second", low=50.0, high=10000.0)
    steps_per_body_step: int = parameter(
        2, "steps of the servos for each step of the body, which costs more", low=1, high=100
    )
    held_until_torque_on: bool = parameter(
        True,
        "keep the body as it starts, as a hand or a stand would, until the first servo gets "
        "torque; without, a raised head sinks until the driver is there",
    )
    frame_id: str = parameter("world", "frame of the motion capture")
    mocap_rate_hz: float = parameter(100.0, "motion capture poses per second", low=1.0, high=1000.0)
    mocap_position_noise_m: float = parameter(
        0.0005, "standard deviation of the measured position, per axis [m]", low=0.0, high=1.0
    )
    mocap_rotation_noise_rad: float = parameter(
        0.002, "standard deviation of the measured rotation, per axis [rad]", low=0.0, high=1.0
    )
    mocap_delay_s: float = parameter(
        0.02, "from capture (the stamp) to publication [s]", low=0.0, high=1.0
    )
    return_delay_raw: int = parameter(
        250, "Return Delay Time of every servo at power-on [2 us]", low=0, high=254
    )
    supply_voltage_v: float = parameter(11.1, "supply voltage [V]", low=0.0, high=25.5)
    stall_torque_nm: float = parameter(1.5, "stall torque at 12 V [N m]", low=0.01, high=100.0)
    no_load_speed_rad_s: float = parameter(
        6.18, "no-load speed at 12 V [rad/s]", low=0.1, high=100.0
    )
    acceleration_rad_s2: float = parameter(
        60.0, "largest acceleration of a servo [rad/s^2]", low=0.1, high=1e5
    )
    friction_torque_nm: float = parameter(
        0.1, "friction of the gear, less than the stall torque [N m]", low=0.0, high=10.0
    )
    wire_time: bool = parameter(True, "let bytes take the time that the baud rate says")
    scenario: str = parameter(
        "", "file of faults with their times (docs/faults.md), empty for none"
    )

    def __post_init__(self) -> None:
        body_hz = self.step_hz / self.steps_per_body_step
        if self.mocap_rate_hz > body_hz:
            raise ConfigError(
                "mocap_rate_hz",
                self.mocap_rate_hz,
                f"at most step_hz / steps_per_body_step = {body_hz:g}",
            )
        if self.friction_torque_nm >= self.stall_torque_nm:
            raise ConfigError(
                "friction_torque_nm",
                self.friction_torque_nm,
                f"less than stall_torque_nm = {self.stall_torque_nm:g}",
            )
