"""What the sub-commands of ``ax12`` share: options, exit codes, questions, joints."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from snake_control.ax12.bus import Bus
from snake_control.ax12.joint import JointSetup, joint_setups
from snake_control.ax12.port import SerialPort
from snake_control.cli.common import add_params_file
from snake_control.config import Config, load
from snake_control.config.nodes import SDK_BAUD_RATES
from snake_control.errors import SnakeError

EXIT_ABORTED = 3
EXIT_INTERRUPTED = 130

_WHOLE_SERVO_RAD = 2.61


class AbortedError(SnakeError, RuntimeError):
    """The user said no, or nobody was there to say yes."""


def servo_ids(text: str) -> list[int]:
    """Read ids such as ``1-11`` or ``1,2,5``.

    Raises:
        ArgumentTypeError: anything else.
    """
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        try:
            found.extend(range(int(first), int(last if dash else first) + 1))
        except ValueError:
            raise argparse.ArgumentTypeError(f"{part!r}: give ids such as 1-11 or 1,2,5") from None
    if not found or not all(0 <= i <= 252 for i in found):
        raise argparse.ArgumentTypeError(f"{text!r}: ids are 0 to 252")
    return found


def servo_id(text: str) -> int:
    """Read one id.

    Raises:
        ArgumentTypeError: not 0 to 252.
    """
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: give an id, 0 to 252") from None
    if not 0 <= value <= 252:
        raise argparse.ArgumentTypeError(f"{text}: ids are 0 to 252")
    return value


def add_port(parser: argparse.ArgumentParser, files: bool = True) -> None:
    """Add ``--port``, ``--baud`` and, if wanted, ``--params-file``."""
    if files:
        add_params_file(parser)
    parser.add_argument("--port", help="serial port; default: bus_driver.port of the parameters")
    parser.add_argument(
        "--baud",
        type=int,
        choices=SDK_BAUD_RATES,
        help="bit/s; default: bus_driver.baud_rate of the parameters",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add ``--json``."""
    parser.add_argument("--json", action="store_true", help="JSON on standard output, nothing else")


def add_yes(parser: argparse.ArgumentParser) -> None:
    """Add ``--yes``."""
    parser.add_argument("--yes", action="store_true", help="do not ask")


def config_of(given: argparse.Namespace) -> Config:
    """Read the parameter files.

    Raises:
        ConfigError, ConfigFileError: what is wrong with them.
    """
    return load(*given.params_file)


def open_bus(given: argparse.Namespace, config: Config, retries: int = 2) -> Bus:
    """Open the port that options or parameters name.

    Raises:
        BusError: it cannot be opened; says what to do.
    """
    driver = config.bus_driver
    path = given.port or driver.port
    port = SerialPort(path, given.baud or driver.baud_rate, driver.reply_timeout_s)
    for text in port.warnings:
        print(f"warning: {text}", file=sys.stderr)
    return Bus(port, retries)


def joints_of(config: Config) -> tuple[JointSetup, ...]:
    """Return the joints of the parameters."""
    return joint_setups(config.robot, config.servos)


def joint_of(config: Config, servo_id: int) -> JointSetup:
    """Return the joint that a servo drives, or a plain one if none of the parameters' does."""
    for joint in joints_of(config):
        if joint.servo_id == servo_id:
            return joint
    return JointSetup(
        name="no joint",
        servo_id=servo_id,
        direction=1,
        zero_offset=0.0,
        mode="joint",
        lower=-_WHOLE_SERVO_RAD,
        upper=_WHOLE_SERVO_RAD,
        speed_limit=5.5,
        margin_ticks=1,
        slope_raw=32,
        punch_raw=32,
        torque_limit=1.0,
    )


def confirm(question: str, given: argparse.Namespace) -> None:
    """Ask; return if the answer is yes, or ``--yes`` was given.

    Raises:
        AbortedError: any other answer, or no terminal to ask at.
    """
    if given.yes:
        return
    if not sys.stdin.isatty():
        raise AbortedError(f"{question} Not asked, because standard input is no terminal; --yes?")
    print(f"{question} [y/N] ", end="", flush=True, file=sys.stderr)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise AbortedError("nothing was changed")


def print_json(document: Any) -> None:
    """Print one document."""
    print(json.dumps(document, indent=2, allow_nan=False))


def table(rows: list[list[str]]) -> str:
    """Return rows as text with aligned columns; the first row is the heading."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) for row in rows]
    return "\n".join(line.rstrip() for line in lines)
