"""All servos of the robot as one thing: velocities in, readings out, one bus cycle at a time.

A cycle is: write (one SYNC_WRITE for goals and speeds, one more if there are wheel-mode servos),
then read the servos in the order of ``telemetry``. Reading ends when the cycle's time is up, so
that servos that do not answer cannot keep the others from their commands.
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
from snake_control.ax12.eeprom import ServoInfo, effective_range
from snake_control.ax12.feedback import Feedback
from snake_control.ax12.following import FollowWatch
from snake_control.ax12.joint import WHEEL_MODE, JointSetup
from snake_control.ax12.modulation import GoalAndSpeed, Present, VelocityLimits
from snake_control.ax12.telemetry import Request, TelemetrySchedule
from snake_control.ax12.units import (
    JOINT_NO_LOAD_RAD_S,
    MAX_RAW,
    RAD_S_PER_SPEED_UNIT,
    WHEEL_NO_LOAD_RAD_S,
    decode_signed,
    error_names,
    ticks_to_rad,
)
from snake_control.ax12.velocity import JointModeVelocity, WheelModeVelocity
from snake_control.errors import ServoError

_ALARMS_IN_ROW = 2

FEEDBACK_LOST_S = 0.5
"""Without a believable reading of a driven joint for so long the robot must stop."""

_ASKED_IN_VAIN = 2
_RETRY_SHARE = 0.25

SLOW_STALE_S = 3.0
"""Voltage and temperature that were not read for so long are not known any more."""


@dataclasses.dataclass(frozen=True)
class Motion:
    """How all joints move.

    Attributes:
        period: nominal time between two cycles [s].
        look_ahead: see ``VelocityLimits``.
        acceleration: see ``VelocityLimits``.
        lost_after_misses: missed reads in a row after which a servo counts as lost.
        follow_time: how long a joint may not do what it is told [s] (see ``FollowWatch``).
        slow_period: within which voltage and temperature of each servo are read [s]; with
            ``period`` or less all of it is read in each cycle.
    """

    period: float
    look_ahead: float
    acceleration: float
    lost_after_misses: int
    follow_time: float = 1.0
    slow_period: float = 0.5


@dataclasses.dataclass(frozen=True)
class JointReading:
    """One joint as last seen, in the joint frame (SI units).

    Attributes:
        angle, rate, load: NaN before the first reply; load is a fraction of the maximum output.
        voltage, temperature: [V], [degC]; NaN when not read for ``SLOW_STALE_S``.
        age: of the reading [s], infinite before the first.
        error_bits: of the last reply.
        online: False once the servo counts as lost.
        torque_on: Torque Enable as last read or acknowledged.
        counters: what became of the reads so far.
        invalid_values: replies that were not believed.
        shut_down: whether it holds its torque back after an alarm (Torque Limit 0), as last read.
        error_rate: share of the last requests without a good reply at the first try, 0 to 1.
        goal: Goal Position last sent or rehearsed [rad]; NaN before, and in wheel mode.
        goal_speed: Moving Speed with it [rad/s]; in wheel mode with the sign of the output.
        doubt: why it may not go where it is told; empty if it does.
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
    shut_down: bool
    error_rate: float
    goal: float
    goal_speed: float
    doubt: str


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
        self.feedback = Feedback(no_load, self.wheel, motion.period)
        self.following = FollowWatch(motion.follow_time)
        self.speed_unit = no_load / MAX_RAW if self.wheel else RAD_S_PER_SPEED_UNIT
        self.torque_on = False
        self.shut_down = False
        self.heard_at = -math.inf  # last reply to go by
        self.asked_in_vain = 0
        self.alarms_in_row = 0
        self.sent: GoalAndSpeed | None = None

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
        self._period, self._look_ahead = motion.period, motion.look_ahead
        self._telemetry = TelemetrySchedule(len(self._servos), motion.period, motion.slow_period)
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

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Range of each joint [rad]: the configured one within its servo's own angle limits."""
        return tuple(effective_range(servo.joint, servo.info) for servo in self._servos)

    @property
    def error_rate(self) -> float:
        """Share of the last requests to all servos without a good reply at the first try."""
        rates = [self._counters(servo).error_rate for servo in self._servos]
        return sum(rates) / len(rates)

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
            servo.torque_on, servo.shut_down = True, False
            servo.following.reset()
            servo.heard_at = self._written_at
            servo.asked_in_vain = servo.alarms_in_row = 0
            servo.feedback.start(None if servo.wheel else seed.measured, self._written_at)

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
            if not servo.wheel:
                # During a pause of this process a joint goes no farther than the look-ahead.
                led = min(dt, self._look_ahead)
                velocity, load = servo.control.velocity, servo.feedback.load
                servo.following.step(velocity, led, present.angle, load)
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

    def rehearse(self, velocities: Sequence[float] | None) -> None:
        """Work out one cycle's goals and speeds as ``write`` does, and send nothing.

        ``readings`` shows them. A joint that nobody holds rests wherever it is moved to.
        """
        now = self._clock()
        dt = now - self._written_at
        self._written_at = now
        for i, servo in enumerate(self._servos):
            present = servo.present(now)
            if math.isnan(present.angle):
                continue
            velocity = 0.0 if velocities is None else servo.joint.direction * velocities[i]
            if velocity == 0.0 or servo.sent is None:
                servo.sent = servo.control.latch(present.angle)
            else:
                servo.sent = servo.control.step(velocity, dt, present)

    def read(self, until: float) -> None:
        """Read the servos, all of them if they answer in time.

        Args:
            until: time at which to leave the rest to the next cycle.
        """
        begin = self._clock()
        lost = frozenset(i for i, servo in enumerate(self._servos) if self._is_lost(servo))
        asked = self._check(self._telemetry.check(lost, begin, spare=False))
        for request in self._telemetry.cycle(lost, begin):
            if asked and self._clock() >= until:
                return
            answered = self._read_one(self._servos[request.servo], request, until)
            self._telemetry.asked(request, begin, answered)
            asked = True
        now = self._clock()
        if now < until:
            self._check(self._telemetry.check(lost, now, spare=True))

    def _check(self, index: int | None) -> bool:
        """Look at the settings of a servo; return whether any was asked."""
        if index is None:
            return False
        servo = self._servos[index]
        found = check_armed(self._bus, servo.joint)
        if found is not None:
            servo.torque_on, servo.shut_down = found.torque_on, found.shut_down
            if found.wrong and self._armed:
                self._finding = f"{servo.joint}: {found.wrong}"
        return True

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
        stuck = [
            f"{servo.joint} ({servo.following.doubt})"
            for servo in self._servos
            if servo.following.failed
        ]
        if stuck:
            return "told to move and not seen moving: " + ", ".join(stuck)
        return self._finding

    def _read_one(self, servo: _Servo, request: Request, until: float) -> bool:
        """Read a servo; return whether it answered."""
        begin = self._clock()
        # A servo that missed before gets one try: time for retries belongs to the others. So does
        # one at the end of the time: a retry would delay the next cycle's goals.
        missed = self._counters(servo).misses_in_row > 0
        retries = 0 if missed or begin >= until - _RETRY_SHARE * self._period else None
        reply = self._bus.read(
            servo.joint.servo_id, ct.PRESENT_POSITION.address, request.length, retries
        )
        servo.asked_in_vain += 1
        if reply is None:
            return False
        now = 0.5 * (begin + self._clock())
        believed = servo.feedback.take(reply.data, reply.error_bits, now)
        # A wheel does not move by its readings, and has none in the dead zone of its sensor.
        if believed or servo.wheel:
            servo.heard_at = now
            servo.asked_in_vain = 0
        alarmed = reply.error_bits & servo.info.shutdown_bits
        servo.alarms_in_row = servo.alarms_in_row + 1 if alarmed else 0
        return True

    def _counters(self, servo: _Servo) -> Counters:
        return self._bus.counters.get(servo.joint.servo_id) or Counters()

    def _is_lost(self, servo: _Servo) -> bool:
        return self._counters(servo).misses_in_row >= self._lost_after

    def _reading(self, servo: _Servo, now: float) -> JointReading:
        joint, feedback, sent = servo.joint, servo.feedback, servo.sent
        counters = self._counters(servo)
        goal = goal_speed = math.nan
        if sent is not None:
            goal_speed = (
                decode_signed(sent.speed_raw)
                * servo.speed_unit
                * (joint.direction if servo.wheel else 1)
            )
            if sent.goal_ticks is not None:
                goal = joint.to_joint(ticks_to_rad(sent.goal_ticks))
        slow_known = now - feedback.slow_read_at <= SLOW_STALE_S
        return JointReading(
            joint=joint,
            angle=joint.to_joint(feedback.angle),
            rate=joint.direction * feedback.rate,
            load=joint.direction * feedback.load,
            voltage=feedback.voltage if slow_known else math.nan,
            temperature=feedback.temperature if slow_known else math.nan,
            age=now - feedback.read_at,
            error_bits=feedback.error_bits,
            online=not self._is_lost(servo),
            torque_on=servo.torque_on,
            counters=dataclasses.replace(counters),
            invalid_values=feedback.invalid_values,
            shut_down=servo.shut_down,
            error_rate=counters.error_rate,
            goal=goal,
            goal_speed=goal_speed,
            doubt=servo.following.doubt,
        )
