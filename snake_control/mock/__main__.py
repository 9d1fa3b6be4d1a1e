"""AX-12 servos without a robot behind a port: ``python -m snake_control.mock --port-link PATH``."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time

from snake_control.errors import BusError
from snake_control.mock.bus import Bus
from snake_control.mock.port import PtyPort
from snake_control.mock.server import Server
from snake_control.mock.servo import Servo
from snake_control.mock.simulation import Simulation


def ids(text: str) -> list[int]:
    """Read ids such as ``1-11`` or ``1,2,5-7``.

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


def baud_register(rate: int) -> int:
    """Return the Baud Rate register for a rate: 2000000 / (register + 1)."""
    return max(0, round(2_000_000 / rate) - 1)


def main(arguments: list[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m snake_control.mock", description=__doc__)
    parser.add_argument("--port-link", required=True, help="symbolic link to make to the port")
    parser.add_argument("--ids", type=ids, default="1-11", help="such as 1-11 or 1,2,5")
    parser.add_argument(
        "--baud", type=int, default=1_000_000, choices=range(7844, 1_000_001), metavar="RATE"
    )
    parser.add_argument("--step-hz", type=float, default=500.0)
    given = parser.parse_args(arguments)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    servos = [Servo(i, eeprom={"baud_rate": baud_register(given.baud)}) for i in given.ids]
    try:
        with PtyPort(given.port_link) as port:
            simulation = Simulation(servos, 1 / given.step_hz, time.monotonic())
            server = Server(port, Bus(servos), simulation, time.monotonic)
            server.start()
            print(f"{len(servos)} servos at {port.link} ({port.device})", flush=True)
            while not stop.wait(0.2):
                server.check()
            server.stop()
    except BusError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
