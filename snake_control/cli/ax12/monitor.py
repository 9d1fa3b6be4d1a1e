"""``ax12 monitor``: what the servos report, live; only reads."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time

from snake_control.ax12 import control_table as ct
from snake_control.ax12.bus import Bus
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.units import (
    MAX_TICKS,
    RAD_S_PER_SPEED_UNIT,
    decode_signed,
    error_names,
    load_to_fraction,
    raw_to_volt,
    ticks_to_rad,
)
from snake_control.cli.ax12.common import (
    add_port,
    config_of,
    joint_of,
    joints_of,
    open_bus,
    servo_ids,
    table,
)
from snake_control.cli.checked import counting, positive
from snake_control.cli.common import EXIT_FAILED, EXIT_OK

HELP = "live table of what the servos report; only reads"

_RAM = ct.TORQUE_ENABLE.address
_HEADINGS = [
    "id",
    "joint",
    "deg",
    "rad",
    "rad/s",
    "load %",
    "V",
    "degC",
    "torque",
    "fails %",
    "errors",
]
_HOME = "\x1b[H\x1b[J"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_port(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object a line, nothing else")
    parser.add_argument("--ids", type=servo_ids, help="default: those of the parameters")
    parser.add_argument("--rate", type=positive, default=5.0, help="tables per second; default 5")
    parser.add_argument("--count", type=counting, help="end after so many tables")


def run(given: argparse.Namespace) -> int:
    """Show tables until Ctrl-C or ``--count``; return the exit code: 1 if a servo is silent."""
    config = config_of(given)
    joints = [joint_of(config, i) for i in given.ids] if given.ids else list(joints_of(config))
    bus = open_bus(given, config, retries=1)
    number = 0
    silent = False
    try:
        while given.count is None or number < given.count:
            begin = time.monotonic()
            rows = [look(bus, joint) for joint in joints]
            silent = any(row["angle_rad"] is None for row in rows)
            _show(rows, given.json, first=number == 0)
            number += 1
            time.sleep(max(0.0, begin + 1.0 / given.rate - time.monotonic()))
    finally:
        bus.close()
    return EXIT_FAILED if silent else EXIT_OK


def look(bus: Bus, joint: JointSetup) -> dict[str, object]:
    """Return what one servo reports, ``None`` for what is not known."""
    reply = bus.read(joint.servo_id, *ct.FEEDBACK_BLOCK)
    ram = bus.read(joint.servo_id, _RAM, ct.TORQUE_LIMIT.end - _RAM)
    row: dict[str, object] = {
        "id": joint.servo_id,
        "joint": joint.name,
        "angle_rad": None,
        "velocity_rad_s": None,
        "load": None,
        "voltage_v": None,
        "temperature_c": None,
        "torque": None,
        "failed_requests": bus.counters[joint.servo_id].error_rate,
        "errors": [],
    }
    if reply is None or ram is None:
        return row
    at = ct.PRESENT_POSITION.address
    position = ct.PRESENT_POSITION.decode(reply.data, at)
    speed = ct.PRESENT_SPEED.decode(reply.data, at)
    held_back = ct.TORQUE_LIMIT.decode(ram.data, _RAM) == 0
    on = ct.TORQUE_ENABLE.decode(ram.data, _RAM) != 0
    row |= {
        "velocity_rad_s": joint.direction * decode_signed(speed) * RAD_S_PER_SPEED_UNIT,
        "load": joint.direction * load_to_fraction(ct.PRESENT_LOAD.decode(reply.data, at)),
        "voltage_v": raw_to_volt(ct.PRESENT_VOLTAGE.decode(reply.data, at)),
        "temperature_c": ct.PRESENT_TEMPERATURE.decode(reply.data, at),
        "torque": "held back" if held_back else "on" if on else "off",
        "errors": list(error_names(reply.error_bits)),
    }
    if position <= MAX_TICKS:
        row["angle_rad"] = joint.to_joint(ticks_to_rad(position))
    return row


def _show(rows: list[dict[str, object]], as_json: bool, first: bool) -> None:
    if as_json:
        print(json.dumps({"servos": rows}), flush=True)
        return
    text = table([_HEADINGS, *(_cells(row) for row in rows)])
    if sys.stdout.isatty():
        print(_HOME + text, flush=True)
    else:
        print(text if first else f"\n{text}", flush=True)


def _cells(row: dict[str, object]) -> list[str]:
    def number(name: str, digits: int, scale: float = 1.0) -> str:
        value = row[name]
        return "-" if value is None else f"{scale * float(value):.{digits}f}"  # type: ignore[arg-type]

    return [
        str(row["id"]),
        str(row["joint"]),
        number("angle_rad", 1, 180.0 / math.pi),
        number("angle_rad", 3),
        number("velocity_rad_s", 2),
        number("load", 0, 100.0),
        number("voltage_v", 1),
        number("temperature_c", 0),
        str(row["torque"] or "silent"),
        number("failed_requests", 0, 100.0),
        ", ".join(row["errors"]),  # type: ignore[arg-type]
    ]
