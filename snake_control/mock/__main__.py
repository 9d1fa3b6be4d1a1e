"""AX-12 servos without a robot behind a port: ``python -m snake_control.mock --port-link PATH``."""

from __future__ import annotations

import argparse
import dataclasses
import math
import signal
import sys
import threading
import time
from collections.abc import Sequence

import numpy as np

from snake_control.errors import SnakeError
from snake_control.mock.bus import Bus
from snake_control.mock.fault_kinds import KINDS
from snake_control.mock.models import MODELS
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.port import PtyPort
from snake_control.mock.scenario import load_scenario
from snake_control.mock.server import Server
from snake_control.mock.servo import Servo
from snake_control.mock.simulation import Simulation
from snake_control.mock.units import in_sensor_range

_SPIN_S = 3e-4


def ids(text: str) -> list[int]:
    """Read ids such as ``1-11`` or ``1,2,5-7``; an id that is named twice is on the line twice.

    Raises:
        argparse.ArgumentTypeError: anything else, or an id beyond 253.
    """
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        try:
            found.extend(range(int(first), int(last if dash else first) + 1))
        except ValueError:
            raise argparse.ArgumentTypeError(f"{part!r}: give ids such as 1-11 or 1,2,5") from None
    if not found or not all(0 <= i <= 253 for i in found):
        raise argparse.ArgumentTypeError(f"{text!r}: ids are 0 to 253")
    return found


def angles(text: str) -> list[float]:
    """Read angles in degrees, such as ``0`` or ``-30,0,45``, as radians.

    Raises:
        argparse.ArgumentTypeError: no numbers, or beyond the sensor.
    """
    try:
        found = [math.radians(float(part)) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: give degrees such as -30,0,45") from None
    if not all(math.isfinite(a) and abs(a) <= math.pi and in_sensor_range(a) for a in found):
        raise argparse.ArgumentTypeError(f"{text!r}: the sensor sees -150 to 150 degrees")
    return found


def baud_register(rate: int) -> int:
    """Return the Baud Rate register for a rate: 2000000 / (register + 1)."""
    return max(0, round(2_000_000 / rate) - 1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m snake_control.mock",
        description="AX-12 servos behind a pseudo terminal, for any program that speaks Protocol "
        "1.0. Ends on Ctrl-C.",
        epilog=f"Kinds of faults for --scenario: {', '.join(KINDS)}.",
    )
    add = parser.add_argument
    add("--port-link", required=True, help="symbolic link to make to the port")
    add("--ids", type=ids, default="1-11", help="such as 1-11 or 1,2,5; default 1-11")
    add("--baud", type=int, default=1_000_000, choices=range(7844, 1_000_001), metavar="RATE")
    add("--model", choices=MODELS, default="AX-12A")
    add(
        "--return-delay",
        type=int,
        default=250,
        choices=range(255),
        metavar="RAW",
        help="Return Delay Time register, units of 2 us; default 250",
    )
    add("--wheel", action="store_true", help="wheel mode: both angle limits 0")
    add(
        "--degrees",
        type=angles,
        default=[0.0],
        help="angles of the shafts from the centre, one for all or one for each id; default 0",
    )
    add("--volt", type=float, default=11.1, help="supply voltage; default 11.1")
    add(
        "--permissive",
        action="store_true",
        help="take EEPROM writes also while torque is on, as the manual of 2006 has it",
    )
    add(
        "--punctual",
        action="store_true",
        help="stay awake for replies that are due: less late; takes processor time",
    )
    add("--no-wire-time", action="store_true", help="let bytes take no time")
    add("--scenario", help="file of faults with their times (docs/faults.md)")
    add("--seed", type=int, default=0, help="of faults and of readings in the dead zone")
    add("--step-hz", type=float, default=500.0, help="steps of the servos per second")
    return parser


def _servos(given: argparse.Namespace, parser: argparse.ArgumentParser) -> list[Servo]:
    shafts = given.degrees if len(given.degrees) > 1 else given.degrees * len(given.ids)
    if len(shafts) != len(given.ids):
        parser.error(f"--degrees: give one angle, or {len(given.ids)} of them")
    model = MODELS[given.model]
    eeprom = {"baud_rate": baud_register(given.baud), "return_delay_time": given.return_delay}
    if given.wheel:
        eeprom |= {"cw_angle_limit": 0, "ccw_angle_limit": 0}
    try:
        parameters = ServoParameters(motor=model.motor, supply_voltage_v=given.volt)
    except ValueError as error:
        parser.error(f"--volt: {error}")
    parameters = dataclasses.replace(parameters, eeprom_needs_torque_off=not given.permissive)
    rngs = np.random.default_rng(given.seed).spawn(len(given.ids))
    return [
        Servo(servo_id, parameters, model=model, angle_rad=angle, eeprom=eeprom, rng=rng)
        for servo_id, angle, rng in zip(given.ids, shafts, rngs, strict=True)
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; return the exit code (1: port or scenario cannot be used)."""
    parser = _parser()
    given = parser.parse_args(arguments)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    servos = _servos(given, parser)
    try:
        faults = load_scenario(given.scenario) if given.scenario else []
        with PtyPort(given.port_link) as port:
            server = Server(
                port,
                Bus(servos, wire_time=not given.no_wire_time),
                Simulation(servos, 1 / given.step_hz, time.monotonic()),
                time.monotonic,
                spin_s=_SPIN_S if given.punctual else 0.0,
                seed=given.seed,
                log=lambda line: print(line, flush=True),
            )
            server.schedule(faults)
            server.start()
            print(f"{len(servos)} servos at {port.link} ({port.device})", flush=True)
            while not stop.wait(0.2):
                server.check()
            server.stop()
    except SnakeError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
