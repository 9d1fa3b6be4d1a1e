"""All servos of the robot as one thing: velocities in, readings out, one bus cycle at a time.

A cycle is: write (one SYNC_WRITE for goals and speeds, one more if there are wheel-mode servos),
then read every servo. Reading ends when the cycle's time is up and goes on there in the next cycle,
so that servos that do not answer cannot keep the others from their commands.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

from snake_control.ax12 import control_table as ct
from snake_control.ax12.arming import (
    arm,
    check_armed,
    disarm_confirmed,
    read_torque,
    require_off,
)
from snake_control.ax12.bus import Bus, Counters
from snake_control.ax12.feedback import Feedback
from snake_control.ax12.joint import WHEEL_MODE, JointSetup
from snake_control.ax12.startup import ServoInfo
from snake_control.ax12.units import JOINT_NO_LOAD_RAD_S, WHEEL_NO_LOAD_RAD_S, error_names
from snake_control.ax12.velocity import (
    GoalAndSpeed,
    JointModeVelocity,
    Present,
    VelocityLimits,
    WheelModeVelocity,
)
from snake_control.errors import ServoError

_CHECK_EVERY_CYCLES = 5
_ALARMS_IN_ROW = 2

FEEDBACK_LOST_S = 0.5
"""Without a believable reading of a driven joint for so long the robot must stop."""

_ASKED_IN_VAIN = 2


@dataclasses.dataclass(frozen=True)
class Motion:
    """How all joints move.

    Attributes:
        period: nominal time between two cycles [s].
        look_ahead: see ``VelocityLimits``.
        acceleration: see ``VelocityLimits``.
        lost_after_misses: missed reads in a row after which a servo counts as lost.
    """

    period: float
    look_ahead: float
    acceleration: float
    lost_after_misses: int


@dataclasses.dataclass(frozen=True)
class JointReading:
    """One joint as last seen, in the joint frame (SI units).

    Attributes:
        angle, rate, load: NaN before the first reply; load is a fraction of the maximum output.
        voltage, temperature: [V], [degC].
        age: of the reading [s], infinite before the first.
        error_bits: of the last reply.
        online: False once the servo counts as lost.
        torque_on: Torque Enable as last read or acknowledged.
        counters: what became of the reads so far.
        invalid_values: replies that were not believed.
    """

    joint: JointSetup
    angle: float
    rate: float
    load: float
    voltage: float
    temperature: float
    age: float
    error_bits: int
    online: bool
    torque_on: bool
    counters: Counters
    invalid_values: int


class _Servo:
    def __init__(self, joint: JointSetup, info: ServoInfo, motion: Motion) -> None:
        self.joint = joint
        self.info = info
        limits = VelocityLimits(
            lower_ticks=info.lower_ticks,
            upper_ticks=info.upper_ticks,
            speed=joint.speed_limit,
            acceleration=motion.acceleration,
            period=motion.period,
            look_ahead=motion.look_ahead,
            compliance_ticks=joint.compliance_ticks,
            goal_ticks=info.angle_limits_ticks,
        )
        self.wheel = joint.mode == WHEEL_MODE
        fastest = WHEEL_NO_LOAD_RAD_S if self.wheel else JOINT_NO_LOAD_RAD_S
        no_load = fastest.get(info.model, fastest[12])
        self.control: JointModeVelocity | WheelModeVelocity
        if self.wheel:
            self.control = WheelModeVelocity(limits, no_load)
        else:
            self.control = JointModeVelocity(limits)
        self.feedback = Feedback(no_load, self.wheel)
        self.torque_on = False
        self.heard_at = -math.inf  # last reply to go by
        self.asked_in_vain = 0
        self.alarms_in_row = 0
        self.sent = GoalAndSpeed(None, 0)

    def present(self, now: float) -> Present:
        feedback = self.feedback
        return Present(feedback.angle, feedback.rate, now - feedback.read_at)


class ServoChain:
    """All servos in joint order. For the one thread that owns the bus."""

    def __init__(
        self,
        bus: Bus,
        joints: Sequence[JointSetup],
        servos: Sequence[ServoInfo],
        motion: Motion,
        clock: Callable[[], float],
    ) -> None:
        """Join what the configuration and the servos themselves say.

        Args:
            clock: monotonic time [s]; readings are stamped with it.
        """
        self._bus = bus
        self._servos = [_Servo(j, i, motion) for j, i in zip(joints, servos, strict=True)]
        self._clock = clock
        self._lost_after = motion.lost_after_misses
        self._armed = False
        self._written_at = -math.inf
        self._read_first = 0
        self._cycles = 0
        self._check_next = 0
        self._finding = ""

    @property
    def armed(self) -> bool:
        """Whether the last ``arm`` succeeded and torque was not taken since: goals may be sent.

        It says nothing about servos that nobody armed here; ``torque_on`` does.
        """
        return self._armed

    @property
    def torque_on(self) -> tuple[JointSetup, ...]:
        """Joints with torque, as last read from the servos."""
        return tuple(servo.joint for servo in self._servos if servo.torque_on)

    @property
    def joints(self) -> tuple[JointSetup, ...]:
        """The setup of every joint."""
        return tuple(servo.joint for servo in self._servos)

    def arm(self) -> None:
        """Switch torque on where the joints are.

        Raises:
            ServoError: a servo refused; no torque was switched on, but servos that had it hold, now
                by themselves.
            BusError: the port failed (so do all methods).
        """
        # Until all are seeded anew, what was sent before is no place to return to.
        self._armed = False
        try:
            seeds = arm(self._bus, self.joints, [servo.info for servo in self._servos])
        except ServoError:
            self.look_for_torque()
            raise
        self._armed = True
        self._finding = ""
        self._written_at = self._clock()
        for servo, seed in zip(self._servos, seeds, strict=True):
            servo.sent = servo.control.latch(seed.angle)
            servo.torque_on = True
            servo.heard_at = self._written_at
            servo.asked_in_vain = servo.alarms_in_row = 0
            servo.feedback.forget()

    def disarm(self) -> None:
        """Switch torque off: the joints are free.

        Raises:
            ServoError: it was sent to all, but some servos did not confirm it.
        """
        found = disarm_confirmed(self._bus, self.joints)
        self._armed = False
        self._note_torque(found)
        require_off(self.joints, found)

    def look_for_torque(self) -> None:
        """Read from all servos whether torque is on; one that does not answer keeps its state."""
        self._note_torque([read_torque(self._bus, servo.joint) for servo in self._servos])

    def _note_torque(self, found: Sequence[bool | None]) -> None:
        for servo, on in zip(self._servos, found, strict=True):
            if on is not None:
                servo.torque_on = on

    def write(self, velocities: Sequence[float] | None) -> None:
        """Send one cycle's goals and speeds.

        Args:
            velocities: joint velocities [rad/s]; ``None`` to come to rest at once and hold.
        """
        now = self._clock()
        dt = now - self._written_at
        self._written_at = now
        goals: dict[int, bytes] = {}
        wheels: dict[int, bytes] = {}
        for i, servo in enumerate(self._servos):
            present = servo.present(now)
            if velocities is None:
                sent = servo.control.stop(dt, present)
            else:
                sent = servo.control.step(servo.joint.direction * velocities[i], dt, present)
            servo.sent = sent
            speed = ct.MOVING_SPEED.encode(sent.speed_raw)
            if sent.goal_ticks is None:
                wheels[servo.joint.servo_id] = speed
            else:
                goals[servo.joint.servo_id] = ct.GOAL_POSITION.encode(sent.goal_ticks) + speed
        if goals:
            self._bus.sync_write(ct.GOAL_POSITION.address, goals)
        if wheels:
            self._bus.sync_write(ct.MOVING_SPEED.address, wheels)

    def read(self, until: float) -> None:
        """Read the servos, all of them if they answer in time.

        Args:
            until: time at which to leave the rest to the next cycle.
        """
        count = len(self._servos)
        first = self._read_first
        self._read_first = 0
        missed = 0
        for step in range(count):
            index = (first + step) % count
            if step and self._clock() >= until:
                # Every other time begin with the servo that took the time: always the last one
                # in its cycle, it would have the least chance to be heard.
                self._read_first = (index - 1) % count if missed % 2 else index
                break
            missed = self._read_one(self._servos[index], until)
        self._cycles += 1
        if self._cycles % _CHECK_EVERY_CYCLES == 0 and self._clock() < until:
            self._check_next = (self._check_next + 1) % count
            servo = self._servos[self._check_next]
            if not self._is_lost(servo):
                torque, wrong = check_armed(self._bus, servo.joint)
                if torque is not None:
                    servo.torque_on = torque
                if wrong and self._armed:
                    self._finding = f"{servo.joint}: {wrong}"

    def readings(self) -> list[JointReading]:
        """Return every joint as last seen."""
        now = self._clock()
        return [self._reading(servo, now) for servo in self._servos]

    def fault(self) -> str:
        """Return why the robot must not go on moving; empty if it may."""
        lost = [servo.joint for servo in self._servos if self._is_lost(servo)]
        if lost:
            return f"no reply {self._lost_after} times in a row from " + ", ".join(map(str, lost))
        if not self._armed:
            return ""
        alarmed = [s for s in self._servos if s.alarms_in_row >= _ALARMS_IN_ROW]
        if alarmed:
            return "; ".join(
                f"{s.joint} shut down: "
                + ", ".join(error_names(s.feedback.error_bits & s.info.shutdown_bits))
                for s in alarmed
            )
        now = self._clock()
        # Asked in vain: while this process did not run, nobody could answer.
        unheard = [
            servo.joint
            for servo in self._servos
            if now - servo.heard_at > FEEDBACK_LOST_S and servo.asked_in_vain >= _ASKED_IN_VAIN
        ]
        if unheard:
            return f"no believable reading for {FEEDBACK_LOST_S:g} s from " + ", ".join(
                map(str, unheard)
            )
        return self._finding

    def _read_one(self, servo: _Servo, until: float) -> int:
        """Read a servo that is not lost; return how often in a row it did not answer."""
        if self._is_lost(servo):
            return 0
        servo_id = servo.joint.servo_id
        counters = self._bus.counters.get(servo_id)
        begin = self._clock()
        # A servo that missed before gets one try: time for retries belongs to the others.
        retries = None if (counters is None or not counters.misses_in_row) and begin < until else 0
        reply = self._bus.read(servo_id, *ct.FEEDBACK_BLOCK, retries)
        servo.asked_in_vain += 1
        if reply is None:
            return self._bus.counters[servo_id].misses_in_row
        now = 0.5 * (begin + self._clock())
        believed = servo.feedback.take(reply.data, reply.error_bits, now)
        # A wheel does not move by its readings, and has none in the dead zone of its sensor.
        if believed or servo.wheel:
            servo.heard_at = now
            servo.asked_in_vain = 0
        alarmed = reply.error_bits & servo.info.shutdown_bits
        servo.alarms_in_row = servo.alarms_in_row + 1 if alarmed else 0
        return 0

    def _is_lost(self, servo: _Servo) -> bool:
        counters = self._bus.counters.get(servo.joint.servo_id)
        return counters is not None and counters.misses_in_row >= self._lost_after

    def _reading(self, servo: _Servo, now: float) -> JointReading:
        joint, feedback = servo.joint, servo.feedback
        counters = self._bus.counters.get(joint.servo_id, Counters())
        return JointReading(
            joint=joint,
            angle=joint.to_joint(feedback.angle),
            rate=joint.direction * feedback.rate,
            load=joint.direction * feedback.load,
            voltage=feedback.voltage,
            temperature=feedback.temperature,
            age=now - feedback.read_at,
            error_bits=feedback.error_bits,
            online=not self._is_lost(servo),
            torque_on=servo.torque_on,
            counters=dataclasses.replace(counters),
            invalid_values=feedback.invalid_values,
        )
