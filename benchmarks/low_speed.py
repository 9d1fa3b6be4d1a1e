"""What becomes of slow velocities: what the driver sends, on a mock servo, in simulated time.

``python -m benchmarks.low_speed`` prints the tables of docs/velocity.md. No clock is read and
nothing is random, so the figures are the same on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from snake_control.ax12 import control_table as ct
from snake_control.ax12.feedback import Feedback
from snake_control.ax12.modulation import GoalAndSpeed, Present, VelocityLimits
from snake_control.ax12.units import (
    RAD_PER_TICK,
    RAD_S_PER_SPEED_UNIT,
    WHEEL_NO_LOAD_RAD_S,
    ticks_to_rad,
)
from snake_control.ax12.velocity import JointModeVelocity, WheelModeVelocity
from snake_control.mock.servo import Servo

UNITS = (0.1, 0.3, 0.7, 1.0, 1.5, 3.0, 10.0, 43.0, 100.0)
WHEEL_RAD_S = (0.003, 0.05, 0.2, 0.5, 1.0, 3.0, 6.0)
LOAD_N_M = 0.44
"""What the neck of the paper's robot carries."""

PERIOD_MS, READ_AFTER_MS = 20, 2
_DT = 1e-3
_MARGIN, _SLOPE, _PUNCH = 1, 32, 32
_LIMITS = VelocityLimits(
    lower_ticks=5,
    upper_ticks=1019,
    speed=7.0,
    acceleration=0.0,
    period=PERIOD_MS * _DT,
    look_ahead=0.15,
    compliance_ticks=_MARGIN + _SLOPE,
)
_SETTLE_S, _LONGEST_S, _LONGEST_RAD, _STOP_S = 1.0, 20.0, 2.0, 1.0


class Run(NamedTuple):
    """A joint that rests, moves at a constant velocity, and is stopped.

    Attributes:
        units: average speed [units of Moving Speed].
        unevenness: largest distance from a motion at that average [rad].
        overrun: farthest way beyond where it was when the stop was sent [rad].
        stays: where it is a second later, from there [rad].
        alone: how far it runs if instead nothing is sent any more [rad].
    """

    units: float
    unevenness: float
    overrun: float
    stays: float
    alone: float


class _Joint:
    """A mock servo with its driver; positive load pulls it clockwise."""

    def __init__(self, angle: float, load_n_m: float) -> None:
        self._load = load_n_m
        self._servo = Servo(1, angle_rad=angle)
        self._control = JointModeVelocity(_LIMITS)
        self._feedback = Feedback()
        self._milliseconds = 0
        self._read()
        margins_and_slopes = bytes((_MARGIN, _MARGIN, _SLOPE, _SLOPE))
        self._servo.store_bytes(ct.CW_COMPLIANCE_MARGIN.address, margins_and_slopes)
        self._servo.store_bytes(ct.PUNCH.address, ct.PUNCH.encode(_PUNCH))
        self._send(self._control.latch(self._feedback.angle))
        self._servo.store_bytes(ct.TORQUE_ENABLE.address, b"\x01")

    @property
    def angle(self) -> float:
        """Where the shaft really is [rad]."""
        return self._servo.motion.angle_rad

    def run(self, velocity: float, seconds: float) -> Iterator[float]:
        """Let cycles pass; yield the angle at the end of each."""
        for _ in range(round(seconds / _LIMITS.period)):
            age = self._milliseconds * _DT - self._feedback.read_at
            present = Present(self._feedback.angle, self._feedback.rate, age)
            self._send(self._control.step(velocity, _LIMITS.period, present))
            self._pass()
            yield self.angle

    def run_alone(self, seconds: float) -> None:
        """Let time pass in which the host sends nothing."""
        for _ in range(round(seconds / _LIMITS.period)):
            self._pass()

    def _pass(self) -> None:
        for passed in range(1, PERIOD_MS + 1):
            self._servo.step(_DT, self._load)
            self._milliseconds += 1
            if passed == READ_AFTER_MS:
                self._read()

    def _send(self, sent: GoalAndSpeed) -> None:
        assert sent.goal_ticks is not None
        data = ct.GOAL_POSITION.encode(sent.goal_ticks) + ct.MOVING_SPEED.encode(sent.speed_raw)
        self._servo.store_bytes(ct.GOAL_POSITION.address, data)

    def _read(self) -> None:
        self._servo.measure()
        block = self._servo.registers.read(*ct.FEEDBACK_BLOCK)
        self._feedback.take(block, 0, self._milliseconds * _DT)


def run(units: float, load_n_m: float, direction: int) -> Run:
    """Measure one velocity.

    Args:
        units: wanted speed [units of Moving Speed].
        load_n_m: torque that the joint carries [N m]; positive is against the motion.
        direction: +1 counter-clockwise, -1 clockwise.
    """
    velocity = direction * units * RAD_S_PER_SPEED_UNIT
    joint = _moving(velocity, direction * load_n_m)
    begin = joint.angle
    duration = min(_LONGEST_S, _LONGEST_RAD / abs(velocity))
    ways = [direction * (angle - begin) for angle in joint.run(velocity, duration)]
    average = ways[-1] / (len(ways) * _LIMITS.period)
    uneven = max(abs(way - average * _LIMITS.period * (i + 1)) for i, way in enumerate(ways))
    begin = joint.angle
    stop = [direction * (angle - begin) for angle in joint.run(0.0, _STOP_S)]
    joint = _moving(velocity, direction * load_n_m)
    begin = joint.angle
    joint.run_alone(_LONGEST_S)
    alone = direction * (joint.angle - begin)
    return Run(average / RAD_S_PER_SPEED_UNIT, uneven, max(0.0, *stop), stop[-1], alone)


def _moving(velocity: float, load_n_m: float) -> _Joint:
    """Return a joint that rested, and has moved for a while."""
    joint = _Joint(ticks_to_rad(512 - math.copysign(220, velocity)), load_n_m)
    for wanted in (0.0, velocity):
        for _ in joint.run(wanted, _SETTLE_S):
            pass
    return joint


def wheel_run(velocity: float, load_n_m: float) -> float:
    """Return the average speed of a wheel-mode servo [rad/s] that carries a load against it."""
    control = WheelModeVelocity(_LIMITS, WHEEL_NO_LOAD_RAD_S[12])
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    nothing = Present(math.nan, math.nan, math.inf)
    control.latch(0.0)
    servo.store_bytes(ct.TORQUE_ENABLE.address, b"\x01")
    angles = []
    for _ in range(round(2 * _SETTLE_S / _LIMITS.period)):
        speed_raw = control.step(velocity, _LIMITS.period, nothing).speed_raw
        servo.store_bytes(ct.MOVING_SPEED.address, ct.MOVING_SPEED.encode(speed_raw))
        for _ in range(PERIOD_MS):
            servo.step(_DT, load_n_m)
        angles.append(servo.motion.angle_rad)
    settled = angles[len(angles) // 2 :]
    return (settled[-1] - settled[0]) / ((len(settled) - 1) * _LIMITS.period)


def wheel_table() -> list[str]:
    """Return what becomes of velocities in wheel mode, in Markdown."""
    lines = [
        f"| wanted [rad/s] | without load | lifting {LOAD_N_M} N m | lowering it |",
        "|---|---|---|---|",
    ]
    for wanted in WHEEL_RAD_S:
        found = [wheel_run(wanted, load) for load in (0.0, LOAD_N_M, -LOAD_N_M)]
        lines.append(f"| {wanted:g} | " + " | ".join(f"{speed:.3f}" for speed in found) + " |")
    return lines


def table(load_n_m: float) -> list[str]:
    """Return one table in Markdown, both directions; the load is against the motion."""
    lines = [
        "| wanted [units] | [rad/s] | ccw [units] | cw [units] | uneven by [deg] | stop: overrun "
        "[deg] | and stays at [deg] | PC dies: runs on [deg] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for units in UNITS:
        both = [run(units, load_n_m, direction) for direction in (1, -1)]
        degrees = [math.degrees(max((r[field] for r in both), key=abs)) for field in (1, 2, 3, 4)]
        lines.append(
            f"| {units:g} | {units * RAD_S_PER_SPEED_UNIT:.4f} | {both[0].units:.2f} | "
            f"{both[1].units:.2f} | " + " | ".join(f"{d:.2f}" for d in degrees) + " |"
        )
    return lines


def main() -> int:
    """Print the tables."""
    print(f"position count: {math.degrees(RAD_PER_TICK):.3f} deg")
    for load, title in (
        (0.0, "without load"),
        (LOAD_N_M, f"lifting {LOAD_N_M} N m"),
        (-LOAD_N_M, f"lowering {LOAD_N_M} N m"),
    ):
        print(f"\n{title}\n", *table(load), sep="\n")
    print("\nwheel mode\n", *wheel_table(), sep="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
