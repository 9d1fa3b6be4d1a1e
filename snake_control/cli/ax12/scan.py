"""``ax12 scan``: what is on the port, at which rate."""

from __future__ import annotations

import argparse
import dataclasses
import sys

from snake_control.ax12.scan import ALL_IDS, RATES, Found, scan
from snake_control.cli.ax12.common import (
    add_json,
    add_port,
    config_of,
    print_json,
    servo_ids,
    table,
)
from snake_control.cli.common import EXIT_FAILED, EXIT_OK

HELP = "look for servos at all rates; only asks"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_port(parser)
    add_json(parser)
    parser.add_argument("--ids", type=servo_ids, help="such as 1-20; default: all")
    parser.add_argument("--quick", action="store_true", help="only the ids of the parameters")


def run(given: argparse.Namespace) -> int:
    """Scan; return the exit code: 1 if nothing was found or something is not legible."""
    config = config_of(given)
    ids = given.ids or (list(config.servos.ids) if given.quick else list(ALL_IDS))
    rates = (given.baud,) if given.baud else RATES
    shown = sys.stderr.isatty()

    def progress(rate: int, number: int) -> None:
        if shown:
            print(f"\r{rate} bit/s: {number} of {len(ids)} ids ", end="", file=sys.stderr)

    found = scan(given.port or config.bus_driver.port, rates, ids, progress)
    if shown:
        print(file=sys.stderr)
    if given.json:
        print_json([dataclasses.asdict(one) for one in found])
    elif found:
        print(table([["id", "bit/s", "model", "firmware", "mode", "return delay"]] + _rows(found)))
        if len({one.baud_rate for one in found}) > 1:
            print("The servos have different rates: a bus works with one.")
    else:
        print("Nothing answers: check the servos' power and the cable.")
    return EXIT_OK if found and all(one.legible for one in found) else EXIT_FAILED


def _rows(found: list[Found]) -> list[list[str]]:
    rows = []
    for one in found:
        what = (
            [one.model_name, str(one.firmware), one.mode, f"{one.return_delay_us} us"]
            if one.legible
            else ["not legible: do two servos share this id?", "", "", ""]
        )
        rows.append([str(one.servo_id), str(one.baud_rate), *what])
    return rows
