"""``ax12 jog``: move one joint a little, as the driver would."""

from __future__ import annotations

import argparse
import dataclasses
import math
import signal
import sys
import time
from types import FrameType

from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import Motion, ServoChain
from snake_control.ax12.joint import WHEEL_MODE
from snake_control.ax12.startup import handshake
from snake_control.cli.ax12.common import (
    EXIT_INTERRUPTED,
    add_json,
    add_port,
    add_yes,
    config_of,
    confirm,
    joint_of,
    open_bus,
    print_json,
    servo_id,
)
from snake_control.cli.checked import positive
from snake_control.cli.common import EXIT_FAILED, EXIT_OK, EXIT_USAGE, ending_signals

HELP = "move one joint by a small angle; asks first"

LONGEST_RAD = 0.5
FASTEST_RAD_S = 1.0
_PERIOD_S = 0.02
_SETTLE_CYCLES = 15
_ARRIVED_RAD = 0.01


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_port(parser)
    add_json(parser)
    add_yes(parser)
    parser.add_argument("servo_id", type=servo_id, metavar="ID", help="id of the servo")
    parser.add_argument(
        "degrees", type=float, help="how far, positive in the joint's positive direction"
    )
    parser.add_argument("--speed", type=slow, default=0.2, help="rad/s, at most 1; default 0.2")


def slow(text: str) -> float:
    """Read a speed.

    Raises:
        ArgumentTypeError: no number, or not above 0 and at most 1 rad/s.
    """
    speed = positive(text)
    if speed > FASTEST_RAD_S:
        raise argparse.ArgumentTypeError(f"{text}: at most {FASTEST_RAD_S:g} rad/s")
    return speed


def run(given: argparse.Namespace) -> int:
    """Move, hold, and leave torque as it was; return the exit code: 1 if it did not get there."""
    config = config_of(given)
    way = math.radians(given.degrees)
    if not 0.0 < abs(way) <= LONGEST_RAD:
        print(
            f"degrees = {given.degrees:g}: give up to {math.degrees(LONGEST_RAD):.0f} to one side",
            file=sys.stderr,
        )
        return EXIT_USAGE
    joint = joint_of(config, given.servo_id)
    if joint.mode == WHEEL_MODE:
        print(f"{joint} is in wheel mode, which has no positions to go to", file=sys.stderr)
        return EXIT_USAGE
    # The torque and the compliance of the parameters, but never fast.
    joint = dataclasses.replace(joint, speed_limit=given.speed)
    bus = open_bus(given, config)
    try:
        found = handshake(bus, [joint], config.servos.accepted_models)
        driver = config.bus_driver
        motion = Motion(_PERIOD_S, driver.look_ahead_s, 0.0, driver.lost_after_misses)
        chain = ServoChain(bus, [joint], found.servos, motion, time.monotonic)
        chain.look_for_torque()
        had_torque = bool(chain.torque_on)
        confirm(
            f"Move {joint} by {given.degrees:g} degrees at {joint.speed_limit:g} rad/s, torque "
            f"{'stays on' if had_torque else 'on meanwhile'}?",
            given,
        )
        return _move(bus, chain, way, had_torque, given)
    finally:
        bus.close()


def _move(
    bus: Bus, chain: ServoChain, way: float, had_torque: bool, given: argparse.Namespace
) -> int:
    stop: list[int] = []

    def on_signal(number: int, _: FrameType | None) -> None:
        stop.append(number)

    with ending_signals(on_signal):
        chain.arm()
        _cycle(chain, None)
        begin = chain.readings()[0].angle
        speed = math.copysign(chain.joints[0].speed_limit, way)
        deadline = time.monotonic() + abs(way / speed) + 2.0
        fault = ""
        while not stop and not fault and time.monotonic() < deadline:
            left = begin + way - chain.readings()[0].angle
            if left * way <= abs(way) * _ARRIVED_RAD:
                break
            _cycle(chain, (speed,))
            fault = chain.fault()
        for _ in range(_SETTLE_CYCLES):
            _cycle(chain, None)
        end = chain.readings()[0].angle
        if not had_torque:
            chain.disarm()
    moved = end - begin
    arrived = abs(moved - way) < 3 * math.radians(300 / 1023) + 0.1 * abs(way)
    if given.json:
        print_json({"id": given.servo_id, "from_rad": begin, "to_rad": end, "arrived": arrived})
    else:
        print(f"moved from {begin:.3f} to {end:.3f} rad ({math.degrees(moved):+.1f} degrees)")
    if fault:
        print(f"stopped: {fault}", file=sys.stderr)
    if stop:
        return EXIT_INTERRUPTED if stop[0] == signal.SIGINT else 128 + stop[0]
    return EXIT_OK if arrived and not fault else EXIT_FAILED


def _cycle(chain: ServoChain, velocities: tuple[float, ...] | None) -> None:
    begin = time.monotonic()
    chain.write(velocities)
    chain.read(begin + 0.85 * _PERIOD_S)
    time.sleep(max(0.0, begin + _PERIOD_S - time.monotonic()))
