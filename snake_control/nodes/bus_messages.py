"""Messages of the bus driver: what goes out, and the check of what comes in."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from snake_interfaces.msg import BusState, JointVelocityCommand, ServoState

from snake_control.ax12.driven_joint import JointReading
from snake_control.ax12.health import Level, Verdict
from snake_control.ax12.units import error_names
from snake_control.nodes.bus_snapshot import Snapshot, State
from snake_control.nodes.conversions import diagnostic_status

_NS = 1_000_000_000
_UNKNOWN = "no reading yet"
_NEVER = Time()

_STATE_LEVELS = {
    State.STOPPED: Level.ERROR,
    State.EMERGENCY_STOP: Level.WARN,
    State.TORQUE_OFF: Level.WARN,
    State.LOWERING: Level.WARN,
    State.DRY_RUN: Level.WARN,
}


@dataclasses.dataclass(frozen=True)
class Health:
    """Judgement of all servos, made now and then.

    Attributes:
        verdicts: by joint; none before the first look.
        expected_torques: what gravity asks of each joint [N m].
    """

    verdicts: tuple[Verdict, ...] = ()
    expected_torques: tuple[float, ...] = ()


class StateMessages:
    """joint_states and bus_state, filled anew in each cycle (made once: that costs less)."""

    def __init__(self, joint_names: Sequence[str], servo_ids: Sequence[int]) -> None:
        self._joint_state = JointState(name=list(joint_names))
        # The servos infer their load from their own output: no effort, so none is claimed.
        self._joint_state.effort = [math.nan] * len(joint_names)
        self._bus_state = BusState(
            servos=[
                ServoState(
                    joint=name,
                    id=servo_id,
                    age=math.inf,
                    goal_position=math.nan,
                    goal_speed=math.nan,
                    expected_torque=math.nan,
                    level=int(Level.STALE),
                    text=_UNKNOWN,
                )
                for name, servo_id in zip(joint_names, servo_ids, strict=True)
            ]
        )

    def joint_state(self, snapshot: Snapshot, stamp: Time) -> JointState:
        """Return angles and velocities of all joints."""
        message = self._joint_state
        message.header.stamp = stamp
        message.position = [reading.angle for reading in snapshot.readings]
        message.velocity = [reading.rate for reading in snapshot.readings]
        return message

    def bus_state(
        self, snapshot: Snapshot, health: Health, stamp: Time, goals_sent: Time | None = None
    ) -> BusState:
        """Return the whole state; without a port the servos keep what was last known of them."""
        message = self._bus_state
        message.header.stamp = stamp
        message.state = int(snapshot.state)
        message.text = snapshot.text
        message.cycle_time = snapshot.cycle_time
        message.cycle_rate = snapshot.cycle_rate
        message.command_age = snapshot.command_age
        followed = snapshot.followed
        message.command_stamp = time_message(0 if followed is None else followed.stamp_ns)
        message.command_waited = math.nan if followed is None else followed.waited
        message.goals_sent = _NEVER if goals_sent is None else goals_sent
        message.cycles = snapshot.cycles
        message.late_cycles = snapshot.late_cycles
        message.communication_error_rate = snapshot.error_rate
        message.reconnections = snapshot.reconnections
        message.emergency_stop = snapshot.emergency
        for servo, reading in zip(message.servos, snapshot.readings, strict=False):
            _fill(servo, reading)
        for servo, verdict, torque in zip(
            message.servos, health.verdicts, health.expected_torques, strict=False
        ):
            servo.level, servo.text = int(verdict.level), verdict.text
            servo.expected_torque = torque
        if not snapshot.readings:
            for servo in message.servos:
                servo.online = False
                servo.age = math.inf
                servo.level, servo.text = int(Level.STALE), _UNKNOWN
        return message


def _fill(servo: ServoState, reading: JointReading) -> None:
    servo.online = reading.online
    servo.torque_enabled = reading.torque_on
    servo.error_bits = reading.error_bits
    servo.position = reading.angle
    servo.velocity = reading.rate
    servo.load = reading.load
    servo.voltage = reading.voltage
    servo.temperature = reading.temperature
    servo.age = reading.age
    servo.replies = reading.counters.replies
    servo.retries = reading.counters.retries
    servo.misses = reading.counters.misses
    servo.corrupt_replies = reading.counters.corrupt_replies
    servo.invalid_values = reading.invalid_values
    servo.communication_error_rate = reading.error_rate
    servo.shut_down = reading.shut_down
    servo.goal_position = reading.goal
    servo.goal_speed = reading.goal_speed


def time_message(ns: int) -> Time:
    """Return a stamp from nanoseconds; before the epoch there is none, so not before 0."""
    sec, nanosec = divmod(max(0, ns), _NS)
    return Time(sec=sec, nanosec=nanosec)


def no_diagnostics(port: str, stamp: Time) -> DiagnosticArray:
    """Return the one status of a driver that is not configured."""
    array = DiagnosticArray()
    array.header.stamp = stamp
    array.status = [diagnostic_status("bus_driver: bus", port, Level.STALE, "not configured", {})]
    return array


def diagnostics(snapshot: Snapshot, health: Health, port: str, stamp: Time) -> DiagnosticArray:
    """Return one status of the bus and one of each servo."""
    array = DiagnosticArray()
    array.header.stamp = stamp
    level = _STATE_LEVELS.get(snapshot.state, Level.OK)
    array.status = [
        diagnostic_status(
            "bus_driver: bus",
            port,
            level,
            snapshot.text,
            {
                "state": snapshot.state.name,
                "cycle rate [Hz]": f"{snapshot.cycle_rate:.1f}",
                "cycle time [ms]": f"{1e3 * snapshot.cycle_time:.2f}",
                "cycles": str(snapshot.cycles),
                "late cycles": str(snapshot.late_cycles),
                "communication error rate [%]": f"{100 * snapshot.error_rate:.2f}",
                "reconnections": str(snapshot.reconnections),
                "emergency stop": "latched" if snapshot.emergency else "no",
            },
        )
    ]
    for reading, verdict, torque in zip(
        snapshot.readings, health.verdicts, health.expected_torques, strict=False
    ):
        counters = reading.counters
        array.status.append(
            diagnostic_status(
                f"bus_driver: {reading.joint.name}",
                f"AX-12 id {reading.joint.servo_id}",
                verdict.level,
                verdict.text,
                {
                    "angle [rad]": f"{reading.angle:.3f}",
                    "load": f"{reading.load:.2f}",
                    "expected static torque [N m]": f"{torque:.2f}",
                    "voltage [V]": f"{reading.voltage:.1f}",
                    "temperature [degC]": f"{reading.temperature:.0f}",
                    "age [s]": f"{reading.age:.3f}",
                    "torque": _torque(reading),
                    "errors": ", ".join(error_names(reading.error_bits)) or "none",
                    "communication error rate [%]": f"{100 * reading.error_rate:.2f}",
                    "replies": str(counters.replies),
                    "retries": str(counters.retries),
                    "misses": str(counters.misses),
                    "corrupt replies": str(counters.corrupt_replies),
                    "invalid values": str(reading.invalid_values),
                },
            )
        )
    return array


def _torque(reading: JointReading) -> str:
    if reading.shut_down:
        return "held back after an alarm"
    return "on" if reading.torque_on else "off"


class InvalidCommandError(ValueError):
    """A velocity command that must not be executed; says why."""


def checked_velocities(
    message: JointVelocityCommand, joint_names: Sequence[str], now_ns: int, timeout: float
) -> tuple[tuple[float, ...], float]:
    """Return the velocities in joint order [rad/s] and the command's age [s] at ``now_ns``.

    Raises:
        InvalidCommandError: names are not exactly the joints, lengths differ, a value is not
            finite, or the stamp is older than ``timeout``, or as far in the future.
    """
    names = message.name
    if len(names) != len(message.velocity):
        raise InvalidCommandError(f"{len(names)} names but {len(message.velocity)} velocities")
    values = dict(zip(names, message.velocity, strict=True))
    if len(values) != len(names):
        raise InvalidCommandError("a joint is named twice")
    unknown = sorted(values.keys() - set(joint_names))
    if unknown:
        raise InvalidCommandError(f"no such joint: {', '.join(unknown)}")
    missing = [name for name in joint_names if name not in values]
    if missing:
        raise InvalidCommandError(f"missing: {', '.join(missing)}")
    for name, value in values.items():
        if not math.isfinite(value):
            raise InvalidCommandError(f"velocity of {name} is {value}")
    # In plain numbers: rclpy's Time raises on stamps before the epoch.
    stamp = message.header.stamp
    age = (now_ns - (stamp.sec * _NS + stamp.nanosec)) / _NS
    if age > timeout:
        raise InvalidCommandError(f"its stamp is {age:.2f} s old, more than {timeout:.2f} s")
    if age < -timeout:
        raise InvalidCommandError(f"its stamp is {-age:.2f} s ahead: are the clocks in step?")
    return tuple(values[name] for name in joint_names), max(0.0, age)
