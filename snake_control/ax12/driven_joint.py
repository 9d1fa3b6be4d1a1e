"""One joint and its servo, as the driver leads it and last saw it; without the bus."""

from __future__ import annotations

import dataclasses
import math

from snake_control.ax12.arming import Seed
from snake_control.ax12.bus import Counters, Reply
from snake_control.ax12.eeprom import ServoInfo
from snake_control.ax12.feedback import Feedback
from snake_control.ax12.following import FollowWatch
from snake_control.ax12.joint import WHEEL_MODE, JointSetup
from snake_control.ax12.modulation import GoalAndSpeed, Present, VelocityLimits
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

SLOW_STALE_S = 3.0
"""Voltage and temperature that were not read for so long are not known any more."""

_ALARMS_IN_ROW = 2
_ASKED_IN_VAIN = 5
"""So often, too: on a computer that pauses, replies are late and joints are asked seldom. A joint
without fresh readings holds meanwhile."""


@dataclasses.dataclass(frozen=True)
class Motion:
    """How all joints move.

    Attributes:
        period: nominal time between two cycles [s].
        look_ahead: see ``VelocityLimits``.
        acceleration: see ``VelocityLimits``.
        lost_after_misses: missed reads in a row after which a servo counts as lost.
        follow_time: how long a joint may not do what it is told [s] (see ``FollowWatch``).
        unheard_time: without a believable reading of a driven joint for so long the robot must
            stop [s].
        slow_period: within which voltage and temperature of each servo are read [s]; with
            ``period`` or less all of it is read in each cycle.
    """

    period: float
    look_ahead: float
    acceleration: float
    lost_after_misses: int
    follow_time: float = 1.0
    slow_period: float = 0.5
    unheard_time: float = 0.5


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


class DrivenJoint:
    """One joint: its velocity control, its feedback, and what may be wrong with it.

    Attributes:
        joint, info: what configuration and servo say.
        wheel: whether it is in wheel mode.
        torque_on, shut_down: as in ``JointReading``.
        unset: whether its settings are no longer those that it was armed with.
        asked_in_vain: questions since the last reply to go by.
    """

    def __init__(self, joint: JointSetup, info: ServoInfo, motion: Motion) -> None:
        """Know nothing yet."""
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
        self._control: JointModeVelocity | WheelModeVelocity
        if self.wheel:
            self._control = WheelModeVelocity(limits, no_load)
        else:
            self._control = JointModeVelocity(limits)
        self._feedback = Feedback(no_load, self.wheel, motion.period)
        self._following = FollowWatch(motion.follow_time)
        self._look_ahead = motion.look_ahead
        self._unheard_time = motion.unheard_time
        self._speed_unit = no_load / MAX_RAW if self.wheel else RAD_S_PER_SPEED_UNIT
        self.torque_on = False
        self.shut_down = False
        self.unset = False
        self.asked_in_vain = 0
        self._heard_at = -math.inf  # last reply to go by
        self._alarms_in_row = 0
        self._sent: GoalAndSpeed | None = None

    def armed(self, seed: Seed, now: float) -> None:
        """Take note that it is held from now on."""
        self._sent = self._control.latch(seed.angle)
        self.torque_on, self.shut_down, self.unset = True, False, False
        self._following.reset()
        self._heard_at = now
        self.asked_in_vain = self._alarms_in_row = 0
        self._feedback.start(None if self.wheel else seed.measured, now)

    def step(self, velocity: float | None, dt: float, now: float) -> GoalAndSpeed:
        """Return what to send in this cycle.

        Args:
            velocity: of the joint [rad/s]; ``None`` to come to rest at once and hold.
            dt: since the previous cycle [s].
            now: the time [s].
        """
        present = self._present(now)
        if isinstance(self._control, JointModeVelocity):
            # During a pause of this process a joint goes no farther than the look-ahead.
            led = min(dt, self._look_ahead)
            self._following.step(self._control.expected, led, present.angle, self._feedback.load)
        if velocity is None:
            self._sent = self._control.stop(dt, present)
        else:
            self._sent = self._control.step(self.joint.direction * velocity, dt, present)
        return self._sent

    def rehearse(self, velocity: float | None, dt: float, now: float) -> None:
        """Work out a cycle that is not sent; a joint that rests does so wherever it is moved to."""
        present = self._present(now)
        if math.isnan(present.angle):
            return
        if not velocity or self._sent is None:
            self._sent = self._control.latch(present.angle)
        else:
            self._sent = self._control.step(self.joint.direction * velocity, dt, present)

    def take(self, reply: Reply, now: float) -> None:
        """Take position, speed and load, and more, as the servo replied them at ``now``."""
        believed = self._feedback.take(reply.data, reply.error_bits, now)
        # A wheel does not move by its readings, and has none in the dead zone of its sensor.
        if believed or self.wheel:
            self._heard_at = now
            self.asked_in_vain = 0
        alarmed = reply.error_bits & self.info.shutdown_bits
        self._alarms_in_row = self._alarms_in_row + 1 if alarmed else 0

    @property
    def alarms(self) -> tuple[str, ...]:
        """Names of the alarms for which it shut itself down; empty if it did not."""
        if self._alarms_in_row < _ALARMS_IN_ROW:
            return ()
        return error_names(self._feedback.error_bits & self.info.shutdown_bits)

    @property
    def limp(self) -> bool:
        """Whether it is known to have no torque, or settings that it was not armed with."""
        return not self.torque_on or self.shut_down or self.unset or bool(self.alarms)

    def unheard(self, now: float) -> bool:
        """Whether there is nothing to go by for too long, though it was asked.

        While this process did not run, nobody could answer.
        """
        return now - self._heard_at > self._unheard_time and self.asked_in_vain >= _ASKED_IN_VAIN

    @property
    def not_following(self) -> str:
        """Why the robot must not go on leading it; empty if it may."""
        return self._following.doubt if self._following.failed else ""

    def reading(self, now: float, counters: Counters, online: bool) -> JointReading:
        """Return it as last seen."""
        joint, feedback, sent = self.joint, self._feedback, self._sent
        goal = goal_speed = math.nan
        if sent is not None:
            goal_speed = decode_signed(sent.speed_raw) * self._speed_unit
            if self.wheel:
                goal_speed *= joint.direction
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
            online=online,
            torque_on=self.torque_on,
            counters=dataclasses.replace(counters),
            invalid_values=feedback.invalid_values,
            shut_down=self.shut_down,
            error_rate=counters.error_rate,
            goal=goal,
            goal_speed=goal_speed,
            doubt=self._following.doubt,
        )

    def _present(self, now: float) -> Present:
        feedback = self._feedback
        return Present(feedback.angle, feedback.rate, now - feedback.read_at, feedback.load)
