"""``ax12 configure``: bring the servos' EEPROM to what the parameters need."""

from __future__ import annotations

import argparse
import sys

from snake_control.ax12 import control_table as ct
from snake_control.ax12.arming import disarm_confirmed, read_torque, require_off
from snake_control.ax12.bus import Bus
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.settings import (
    Change,
    changes,
    rate_change,
    read_block,
    write,
    write_rate,
)
from snake_control.cli.ax12.common import (
    add_json,
    add_port,
    add_yes,
    config_of,
    confirm,
    joints_of,
    open_bus,
    print_json,
    servo_ids,
    table,
)
from snake_control.cli.common import EXIT_FAILED, EXIT_OK, EXIT_USAGE
from snake_control.config import Config
from snake_control.config.nodes import SDK_BAUD_RATES
from snake_control.errors import ServoError

HELP = "write what the parameters need into the servos' EEPROM; shows it and asks first"

_LARGEST_DELAY = 254


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_port(parser)
    add_json(parser)
    add_yes(parser)
    parser.add_argument("--ids", type=servo_ids, help="only these of the parameters' servos")
    parser.add_argument(
        "--return-delay",
        type=int,
        choices=range(_LARGEST_DELAY + 1),
        metavar="RAW",
        help="also set Return Delay Time, in units of 2 us (factory: 250; 0 makes cycles short)",
    )
    parser.add_argument(
        "--limit-range",
        action="store_true",
        help="also narrow the servos' angle limits to robot.joint_limits_rad",
    )
    parser.add_argument(
        "--from-baud",
        type=int,
        choices=SDK_BAUD_RATES,
        help="rate at which the servos listen now; sets them to that of --baud or the parameters",
    )
    parser.add_argument("--dry-run", action="store_true", help="show what would be written")


def run(given: argparse.Namespace) -> int:
    """Compare, show, ask, write and read back; return the exit code: 1 if a servo refused."""
    config = config_of(given)
    joints = [j for j in joints_of(config) if given.ids is None or j.servo_id in given.ids]
    if not joints:
        print(f"none of the ids {given.ids} is one of the parameters' servos", file=sys.stderr)
        return EXIT_USAGE
    rate = given.baud or config.bus_driver.baud_rate
    if given.from_baud is not None:
        given.baud = given.from_baud
    bus = open_bus(given, config)
    try:
        plans = [(joint, _plan(bus, joint, rate, given)) for joint in joints]
        plans = [(joint, plan) for joint, plan in plans if plan]
        if given.json:
            print_json([_document(joint, change) for joint, plan in plans for change in plan])
        elif plans:
            print(_table(plans))
        if not plans:
            if not given.json:
                print("All servos are set up as the parameters need them.")
            return EXIT_OK
        if given.dry_run:
            return EXIT_OK
        held = [joint for joint, _ in plans if read_torque(bus, joint)]
        confirm(f"Write this into the EEPROM of {len(plans)} servos?", given)
        if held:
            names = ", ".join(map(str, held))
            confirm(f"Torque has to go off at {names}: a raised head falls. Hold it. Go on?", given)
            require_off(held, disarm_confirmed(bus, held))
        failed = _write(bus, plans, quiet=given.json)
    finally:
        bus.close()
    moved = [joint for joint, plan in plans if plan[-1].register is ct.BAUD_RATE]
    if moved:
        given.baud = rate
        failed = _look_for(moved, given, config, quiet=given.json) or failed
    return EXIT_FAILED if failed else EXIT_OK


def _plan(bus: Bus, joint: JointSetup, rate: int, given: argparse.Namespace) -> list[Change]:
    block = read_block(bus, joint.servo_id)
    plan = changes(joint, block, return_delay=given.return_delay, range_too=given.limit_range)
    return plan if given.from_baud is None else plan + rate_change(block, rate)


def _look_for(
    joints: list[JointSetup], given: argparse.Namespace, config: Config, quiet: bool
) -> bool:
    """Ask the servos at their new rate; return whether one is not there."""
    failed = False
    bus = open_bus(given, config)
    try:
        for joint in joints:
            try:
                read_block(bus, joint.servo_id)
            except ServoError as error:
                failed = True
                print(f"{joint}: at {given.baud} bit/s: {error}", file=sys.stderr)
            else:
                if not quiet:
                    print(f"{joint}: answers at {given.baud} bit/s")
    finally:
        bus.close()
    return failed


def _write(bus: Bus, plans: list[tuple[JointSetup, list[Change]]], quiet: bool) -> bool:
    """Write all plans; return whether a servo refused."""
    failed = False
    for joint, plan in plans:
        try:
            checked = [c for c in plan if c.register is not ct.BAUD_RATE]
            write(bus, joint.servo_id, checked)
            if plan[-1].register is ct.BAUD_RATE:
                write_rate(bus, joint.servo_id, plan[-1])
        except ServoError as error:
            failed = True
            print(f"{joint}: {error}", file=sys.stderr)
        else:
            if not quiet:
                print(f"{joint}: {len(checked)} registers written and read back")
    return failed


def _table(plans: list[tuple[JointSetup, list[Change]]]) -> str:
    rows = [["servo", "register", "now", "wanted", "why"]]
    for joint, plan in plans:
        for change in plan:
            register = f"{change.register.name} ({change.register.address})"
            rows.append([str(joint), register, str(change.now), str(change.wanted), change.why])
    return table(rows)


def _document(joint: JointSetup, change: Change) -> dict[str, object]:
    return {
        "id": joint.servo_id,
        "joint": joint.name,
        "register": change.register.name,
        "address": change.register.address,
        "now": change.now,
        "wanted": change.wanted,
        "why": change.why,
    }
