"""Every broken configuration gives one error that names the field."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from snake_control.config import load
from snake_control.errors import ConfigError
from support.robots import CONFIG

PAPER_YAML = CONFIG / "paper_robot.yaml"
YAW = "yaw"
PITCH = "pitch"
PAPER_AXES = [PITCH, YAW, PITCH, YAW, PITCH] + [YAW] * 6
PLANAR = {
    "links": 10,
    "head_links": 0,
    "wheelless_links": [1, 4, 7],
    "head_scp_joints": [0],
    "joint_axes": [YAW] * 9,
}


def broken(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    return path


def with_shared(tmp_path: Path, group: str, **values: object) -> Path:
    tree = {"/**": {"ros__parameters": {group: values}}}
    return broken(tmp_path, yaml.safe_dump(tree, default_flow_style=None))


CASES = {
    # Conditions and Assumptions of the paper.
    "condition 1": ("robot", {"wheelless_links": [7, 9, 12]}, "wheelless_links", "Condition 1"),
    "condition 2": (
        "robot",
        {"joint_axes": [PITCH] * 5 + [YAW] * 6},
        "joint_axes",
        "Condition 2",
    ),
    "condition 3": (
        "robot",
        {"joint_axes": [PITCH, PITCH, YAW, PITCH, PITCH] + [YAW] * 6},
        "head_scp_joints",
        "Condition 3",
    ),
    "condition 4, too many": (
        "robot",
        {"links": 10, "joint_axes": PAPER_AXES[:9], "wheelless_links": [7, 9]},
        "wheelless_links",
        "Condition 4",
    ),
    "condition 5": ("robot", {"head_links": 3}, "head_links", "Condition 5"),
    "assumption 1": (
        "robot",
        {"joint_axes": ["roll", *PAPER_AXES[1:]]},
        "joint_axes",
        "Assumption 1",
    ),
    "assumption 2, base": (
        "robot",
        {"joint_axes": [*PAPER_AXES[:-1], PITCH]},
        "joint_axes",
        "Assumption 2",
    ),
    "assumption 2, neck": (
        "robot",
        {"joint_axes": PAPER_AXES[:4] + [YAW] * 7},
        "joint_axes",
        "Assumption 2",
    ),
    "assumption 5": ("robot", {"wheelless_links": [6, 9]}, "wheelless_links", "Assumption 5"),
    "pitch joints only next to the base": (
        "robot",
        {"joint_axes": [YAW] + [PITCH] * 4 + [YAW] * 6},
        "head_scp_joints",
        "all but two",
    ),
    "too short for its head": (
        "robot",
        {
            "links": 10,
            "head_links": 8,
            "joint_axes": [YAW, PITCH] * 4 + [YAW],
            "head_scp_joints": [1, 2, 3, 4],
            "wheelless_links": [0],
        },
        "links",
        "or more",
    ),
    # Planar snakes.
    "planar, condition 1": (
        "robot",
        PLANAR | {"wheelless_links": [1, 4, 10]},
        "wheelless_links",
        "Condition 1",
    ),
    "planar, steered by nothing": (
        "robot",
        PLANAR | {"wheelless_links": [4, 7]},
        "wheelless_links",
        "link 1 of a planar snake must have no wheels",
    ),
    "planar, condition 4, too few": (
        "robot",
        PLANAR | {"wheelless_links": [1]},
        "wheelless_links",
        "Condition 4 of a planar snake",
    ),
    "planar, condition 4, too many": (
        "robot",
        PLANAR | {"wheelless_links": [1, 2, 3, 4, 5, 6, 7]},
        "wheelless_links",
        "must be 2 to 6",
    ),
    "planar, condition 5": ("robot", PLANAR | {"head_links": 1}, "head_links", "Condition 5"),
    "planar, assumption 2": (
        "robot",
        PLANAR | {"joint_axes": [PITCH] + [YAW] * 8},
        "joint_axes",
        "Assumption 2",
    ),
    "planar, H-SCP": ("robot", PLANAR | {"head_scp_joints": [3]}, "head_scp_joints", "give [0]"),
    "planar, same link twice": (
        "robot",
        PLANAR | {"wheelless_links": [1, 4, 4]},
        "wheelless_links",
        "once",
    ),
    "planar, no such link": (
        "robot",
        PLANAR | {"wheelless_links": [1, 4, 11]},
        "wheelless_links",
        "1 to 9",
    ),
    # Postures.
    "angles of some joints": ("postures", {"up": [0.1, 0.2]}, "up", "give 11 entries"),
    "posture beyond a range": ("postures", {"up": [0.1] * 10 + [-2.7]}, "up[10]", "joint 11, -2.4"),
    "posture of texts": ("postures", {"up": ["high"]}, "up[0]", "give a number"),
    "posture that is built in": ("postures", {"flat": [0.1]}, "flat", "built in: all joints at 0"),
    "posture without a name": ("postures", {"": [0.1]}, "", "a letter first"),
    "posture in a posture": ("postures", {"up": {"up": [0.1]}}, "up.up", "a letter first"),
    # Values.
    "range beyond the servo": (
        "robot",
        {"joint_limits_rad": [90.0]},
        "joint_limits_rad",
        "joint 1",
    ),
    "range without room for what loads do": (
        "robot",
        {"joint_limits_rad": [2.45]},
        "joint_limits_rad",
        "+-2.449, since beyond +-2.618 an AX-12 is blind, and loads move it by up to 33 ticks",
    ),
    "offset turns the range away": (
        "servos",
        {"zero_offsets_rad": [0.0] * 3 + [1.0] + [0.0] * 7},
        "joint_limits_rad",
        "joint 4",
    ),
    "head link without wheels": ("robot", {"wheelless_links": [3]}, "wheelless_links", "link 3"),
    "same link twice": ("robot", {"wheelless_links": [7, 7]}, "wheelless_links", "once"),
    "too few axes": ("robot", {"joint_axes": [PITCH, YAW]}, "joint_axes", "11"),
    "too many H-SCPs": ("robot", {"head_scp_joints": [1, 3]}, "head_scp_joints", "1 joints"),
    "H-SCP in the base": ("robot", {"head_scp_joints": [7]}, "head_scp_joints", "1 to 5"),
    "negative length": ("robot", {"half_length_m": -0.034}, "half_length_m", "0.001"),
    "length as text": ("robot", {"half_length_m": "34 mm"}, "half_length_m", "number"),
    "links as decimal": ("robot", {"links": 12.0}, "links", "integer"),
    "masses of some links": ("robot", {"link_mass_kg": [0.1, 0.1]}, "link_mass_kg", "12"),
    "limits of some joints": ("robot", {"joint_limits_rad": [2.4] * 5}, "joint_limits_rad", "11"),
    "limit of zero": ("robot", {"joint_limits_rad": [0.0]}, "joint_limits_rad", "more than 0"),
    "start outside the range": (
        "robot",
        {"joint_limits_rad": [0.5]},
        "start_joint_angles_rad[4]",
        "joint 5",
    ),
    "bounds the wrong way round": (
        "robot",
        {"joint_limits_rad": [1.0, -1.0] + [-2.0, 2.0] * 10},
        "joint_limits_rad",
        "below",
    ),
    "not a number": ("robot", {"wheel_offset_m": float("nan")}, "wheel_offset_m", "finite"),
    "unknown key": ("robot", {"wheel_less_links": [7]}, "wheel_less_links", "wheelless_links"),
    "id twice": ("servos", {"ids": [1, 2, 3, 4, 5, 5, 7, 8, 9, 10, 11]}, "ids", "5"),
    "id out of range": ("servos", {"ids": [*range(1, 11), 254]}, "ids[10]", "252"),
    "too few ids": ("servos", {"ids": [1, 2, 3]}, "ids", "11"),
    "direction of 2": ("servos", {"directions": [2]}, "directions[0]", "1, -1"),
    "unknown mode": ("servos", {"velocity_modes": ["pwm"]}, "velocity_modes[0]", "wheel"),
    "slope between steps": ("servos", {"compliance_slope": [30]}, "compliance_slope[0]", "32"),
    "case 4": ("controller", {"case": 4}, "case", "1, 2, 3"),
    "K too short": ("controller", {"K": [0.4, 0.25, 0.5]}, "K", "6"),
    "gain on an SCP": ("controller", {"K": [0.4] * 6 + [0.1, 0.0, 0.0, 0.0]}, "K", "SCP"),
    "K_v of w alone": ("controller", {"K_v": [4.0] * 6}, "K_v", "6 + m = 10"),
    "K_p on an SCP": ("controller", {"K_p": [4.0] * 10}, "K_p", "SCP"),
    "one size of links": ("robot", {"link_size_m": [0.05]}, "link_size_m", "width and height"),
    "negative friction": ("robot", {"joint_friction": [-0.1]}, "joint_friction", "0 to 1000"),
    "torque limits for some": (
        "robot",
        {"joint_torque_limits_n_m": [1.5, 1.5]},
        "joint_torque_limits_n_m",
        "one for each joint",
    ),
    "negative gain": ("controller", {"a_h": -1.0}, "a_h", "0"),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_field_is_named(tmp_path, case):
    group, values, field, message = case
    with pytest.raises(ConfigError) as caught:
        load(PAPER_YAML, with_shared(tmp_path, group, **values))
    assert caught.value.field.partition(".")[2].partition("[")[0] == field.partition("[")[0]
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{caught.value.field} = ")


NODE_CASES = {
    "unknown baud rate": ("bus_driver", "baud_rate: 123", "baud_rate", "1000000"),
    "rate as text": ("bus_driver", "rate_hz: fast", "rate_hz", "number"),
    "no time-out": ("bus_driver", "command_timeout_s: 0.0", "command_timeout_s", "0.02"),
    "key of another node": ("bus_driver", "mocap_rate_hz: 100.0", "mocap_rate_hz", "unknown"),
    "lowering of some joints": (
        "bus_driver",
        "lowering_angles_rad: [0.0, 0.0]",
        "lowering_angles_rad",
        "one for each joint",
    ),
    "lowering out of a joint's range": (
        "bus_driver",
        "{lower_before_torque_off: true, lowering_angles_rad: [2.7]}",
        "lowering_angles_rad[0]",
        "range of joint 1",
    ),
    "lowering to nowhere": (
        "bus_driver",
        "lowering_posture: lieing",
        "lowering_posture",
        "no such posture; there are: flat, start, lying, look_ahead",
    ),
    "postures of another node": ("pose_input", "postures.up: [0.1]", "postures.up", "known"),
    "lowering at a crawl": (
        "bus_driver",
        "lowering_speed_rad_s: 0.001",
        "lowering_speed_rad_s",
        "0.02",
    ),
    "back-off that shrinks": (
        "bus_driver",
        "{reconnect_first_s: 2.0, reconnect_longest_s: 1.0}",
        "reconnect_longest_s",
        "reconnect_first_s = 2",
    ),
    "no pause before a port is opened again": (
        "bus_driver",
        "reconnect_first_s: 0.0",
        "reconnect_first_s",
        "0.05",
    ),
    "dry run as a number": ("bus_driver", "dry_run: 1", "dry_run", "true or false"),
    "more errors than requests": (
        "bus_driver",
        "communication_error_warn: 1.5",
        "communication_error_warn",
        "0 to 1",
    ),
    "load in percent": ("bus_driver", "load_warn: 80.0", "load_warn", "0 to 1"),
    "negative torque": ("bus_driver", "torque_warn_n_m: -0.3", "torque_warn_n_m", "0 to 1000"),
    "no voltage is right": (
        "bus_driver",
        "{voltage_low_warn_v: 13.0}",
        "voltage_high_warn_v",
        "voltage_low_warn_v = 13",
    ),
    "negative noise": ("mock_bus", "mocap_position_noise_m: -1.0", "mocap_position_noise_m", "0"),
    "no bandwidth": ("pose_input", "cutoff_hz: 0.0", "cutoff_hz", "0.1"),
    "unknown trajectory": ("trajectory_generator", "trajectory: loop", "trajectory", "line"),
    "commands too rare": ("scp_controller", "rate_hz: 5.0", "scp_controller: rate_hz", "20"),
    "bus too slow": (
        "bus_driver",
        "{rate_hz: 15.0, look_ahead_s: 0.5}",
        "bus_driver: rate_hz",
        "20",
    ),
    "references too rare": (
        "trajectory_generator",
        "rate_hz: 5.0",
        "trajectory_generator: rate_hz",
        "10",
    ),
    "mocap too late": ("mock_bus", "mocap_delay_s: 0.1", "mock_bus: mocap_delay_s", "0.08"),
    "seed beyond an integer": ("mock_bus", "seed: 3000000000", "seed", "2.14748e+09"),
    "empty": ("scp_controller", "rate_hz:", "rate_hz", "value"),
}


def test_odometry_has_to_come_as_often_as_the_controller_waits(tmp_path):
    text = """
    /**/pose_input: {ros__parameters: {max_rate_hz: 30.0}}
    /**/scp_controller: {ros__parameters: {head_timeout_s: 0.05}}
    """
    with pytest.raises(ConfigError) as caught:
        load(PAPER_YAML, broken(tmp_path, text))
    assert caught.value.field == "pose_input: max_rate_hz"
    assert "at least 40: the receiver waits 0.05 s" in str(caught.value)


@pytest.mark.parametrize("case", NODE_CASES.values(), ids=NODE_CASES)
def test_field_of_a_node_is_named(tmp_path, case):
    node, line, field, message = case
    values = line if line.startswith("{") else "{" + line + "}"
    text = f"/**/{node}: {{ros__parameters: {values}}}\n"
    with pytest.raises(ConfigError) as caught:
        load(PAPER_YAML, broken(tmp_path, text))
    assert caught.value.field == field
    assert message in str(caught.value)
