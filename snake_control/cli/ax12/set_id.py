"""``ax12 set-id``: give the one servo on the line another id."""

from __future__ import annotations

import argparse
import sys

from snake_control.ax12 import control_table as ct
from snake_control.ax12.bus import Bus
from snake_control.ax12.port import SerialPort
from snake_control.ax12.scan import ALL_IDS, Found, look_at, scan
from snake_control.ax12.settings import write
from snake_control.cli.ax12.common import (
    add_json,
    add_port,
    add_yes,
    config_of,
    confirm,
    print_json,
    servo_id,
)
from snake_control.cli.common import EXIT_FAILED, EXIT_OK

HELP = "give the only servo on the line a new id; refuses when several answer"

_REPLY_TIMEOUT_S = 0.02


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_port(parser)
    add_json(parser)
    add_yes(parser)
    parser.add_argument("new_id", type=servo_id, help="the id that it gets, 0 to 252")


def run(given: argparse.Namespace) -> int:
    """Look who is there, ask, write, check; return the exit code: 1 if it cannot be done."""
    config = config_of(given)
    path = given.port or config.bus_driver.port
    rate = given.baud or config.bus_driver.baud_rate
    found = scan(path, [rate], list(ALL_IDS), retries=1)
    obstacle = _obstacle(found, rate)
    if obstacle:
        print(obstacle, file=sys.stderr)
        return EXIT_FAILED
    (servo,) = found
    if servo.servo_id == given.new_id:
        _report(given, servo.servo_id, f"The servo has id {given.new_id} already.")
        return EXIT_OK
    confirm(f"Change the id of {servo.model_name} {servo.servo_id} to {given.new_id}?", given)
    bus = Bus(SerialPort(path, rate, _REPLY_TIMEOUT_S), retries=2)
    try:
        write(bus, servo.servo_id, [])
        # One that the scan missed would share its id from now on.
        with bus.patient():
            taken = look_at(bus, given.new_id, rate) is not None
        if taken:
            print(f"something answers as {given.new_id} already; nothing changed", file=sys.stderr)
            return EXIT_FAILED
        # Read back at the old id it would be silent; the question at the new one is the check.
        bus.write(servo.servo_id, ct.ID.address, ct.ID.encode(given.new_id))
        now = look_at(bus, given.new_id, rate)
        before = look_at(bus, servo.servo_id, rate)
    finally:
        bus.close()
    if now is None or not now.legible or before is not None:
        print(f"the servo does not answer legibly as {given.new_id} alone", file=sys.stderr)
        return EXIT_FAILED
    _report(given, servo.servo_id, f"Servo {servo.servo_id} is now servo {given.new_id}.")
    return EXIT_OK


def _obstacle(found: list[Found], rate: int) -> str:
    if not found:
        return f"no servo answers at {rate} bit/s: `ax12 scan` tries all rates"
    garbled = [one.servo_id for one in found if not one.legible]
    if garbled:
        return f"servo id {garbled[0]} is not legible: connect one servo alone"
    if len(found) > 1:
        ids = ", ".join(str(one.servo_id) for one in found)
        return f"{len(found)} servos answer (ids {ids}): connect one servo alone"
    return ""


def _report(given: argparse.Namespace, old: int, text: str) -> None:
    if given.json:
        print_json({"old_id": old, "id": given.new_id})
    else:
        print(text)
