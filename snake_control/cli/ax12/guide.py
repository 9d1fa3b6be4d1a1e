"""``ax12 guide``: direction, zero offset and range of each joint, turned by hand."""

from __future__ import annotations

import argparse
import math
import sys

from snake_control.ax12 import control_table as ct
from snake_control.ax12.arming import disarm_confirmed, read_torque, require_off
from snake_control.ax12.bus import Bus
from snake_control.ax12.guide import POSITIVE, Measured, direction_of, measure
from snake_control.ax12.joint import JointSetup
from snake_control.cli.ax12.common import (
    AbortedError,
    add_json,
    add_port,
    add_yes,
    config_of,
    confirm,
    joints_of,
    open_bus,
    print_json,
    servo_ids,
)
from snake_control.cli.common import EXIT_FAILED, EXIT_OK
from snake_control.config import Config
from snake_control.errors import ServoError

HELP = "find each joint's direction, zero offset and range by turning it by hand"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_port(parser)
    add_json(parser)
    add_yes(parser)
    parser.add_argument("--ids", type=servo_ids, help="only these; default: all of the parameters")


def run(given: argparse.Namespace) -> int:
    """Ask through all joints; return the exit code: 1 if something is not as configured."""
    config = config_of(given)
    joints = joints_of(config)
    chosen = [j for j in joints if given.ids is None or j.servo_id in given.ids]
    bus = open_bus(given, config)
    try:
        _free(bus, chosen, given)
        found = {joint.name: _measure(bus, joint, config) for joint in chosen}
    finally:
        bus.close()
    if given.json:
        print_json(
            {
                name: {
                    "direction": m.direction,
                    "zero_offset_rad": m.zero_offset,
                    "range_rad": [m.lower, m.upper],
                    "remarks": list(m.remarks),
                }
                for name, m in found.items()
            }
        )
    else:
        _report(joints, found)
    return EXIT_FAILED if any(m.remarks for m in found.values()) else EXIT_OK


def _free(bus: Bus, joints: list[JointSetup], given: argparse.Namespace) -> None:
    held = [joint for joint in joints if read_torque(bus, joint)]
    if held:
        names = ", ".join(map(str, held))
        confirm(f"Torque has to go off at {names}: a raised head falls. Hold it. Go on?", given)
        require_off(held, disarm_confirmed(bus, held))


def _measure(bus: Bus, joint: JointSetup, config: Config) -> Measured:
    axis = config.robot.joint_axes[int(joint.name.rpartition("_")[2]) - 1]
    _say(f"\n{joint}, a {axis} joint")
    straight = _position(bus, joint, "Turn it straight (angle 0), then press Enter.")
    while True:
        turned = _position(bus, joint, f"Turn it {POSITIVE[axis]}, then press Enter.")
        direction = direction_of(straight, turned)
        if direction is not None:
            break
        _say("That was too little to tell, or beyond the sensor: turn it 10 degrees or more.")
    ends = (
        _position(bus, joint, "Turn it to one end of its way, then press Enter."),
        _position(bus, joint, "Turn it to the other end, then press Enter."),
    )
    return measure(joint, direction, straight, ends)


def _position(bus: Bus, joint: JointSetup, words: str) -> int:
    _say(f"  {words}")
    if not sys.stdin.readline():
        raise AbortedError("standard input ended")
    with bus.patient():
        reply = bus.read(joint.servo_id, *ct.FEEDBACK_BLOCK)
    if reply is None:
        raise ServoError([f"{joint} does not answer"])
    position = ct.PRESENT_POSITION.decode(reply.data, ct.PRESENT_POSITION.address)
    _say(f"  position {position}")
    return position


def _say(text: str) -> None:
    # Standard output is for the result.
    print(text, file=sys.stderr, flush=True)


def _inwards(bound: float) -> float:
    # Whole hundredths, and room for the offset that is rounded, too.
    return math.floor(100.0 * bound - 0.1) / 100.0


def _report(joints: tuple[JointSetup, ...], found: dict[str, Measured]) -> None:
    for name, m in found.items():
        for remark in m.remarks:
            print(f"{name}: {remark}")
    print("For the parameter file, where they differ:")
    directions, offsets, limits = [], [], []
    for joint in joints:
        m = found.get(joint.name)
        directions.append(str(m.direction if m else joint.direction))
        offsets.append(f"{m.zero_offset if m else joint.zero_offset:.3f}")
        if m is None:
            limits += [f"{joint.lower:g}", f"{joint.upper:g}"]
        else:
            limits += [f"{-_inwards(-m.lower):.2f}", f"{_inwards(m.upper):.2f}"]
    print("    servos:")
    print(f"      directions: [{', '.join(directions)}]")
    print(f"      zero_offsets_rad: [{', '.join(offsets)}]")
    print("    robot:")
    print(f"      joint_limits_rad: [{', '.join(limits)}]")
