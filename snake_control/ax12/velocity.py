"""Velocity of one servo, made from what an AX-12 offers (manual p. 16-18; e-manual AX-12A).

Joint mode. The servo moves at Moving Speed (0.111 rpm a unit, 0 means full speed) to Goal Position
and holds it. Per servo there is a setpoint x_s, an angle:

* The speed is quantised by sigma-delta: each cycle sends a whole number of units, and the
  remainder, weighted with the time it was in force, is carried on. So any velocity is realised
  on average, also below one unit. A cycle in which the number is 0 is a hold cycle.
* x_s is the integral of what was sent: where the joint should be by now.
* Moving cycle: the goal is kept one look-ahead in front of the measured joint: margin + slope, in
  which the servo would reduce its output, and the way of ``look_ahead_s`` at this speed. If the
  host dies, the joint runs this far and no farther.
* Hold cycle: the goal is x_s and the speed the last one that moved, never 0. The joint rests a
  droop away from x_s, where compliance balances gravity; because x_s is not latched anew from the
  joint, a chain of hold cycles does not creep down.
* x_s stays within margin + slope of the joint: no long catching up after a joint was blocked.
* A joint whose reading is older than 0.1 s (and 2.5 cycles) holds: goals that run ahead of x_s
  alone would let it run without bound.
* After 0.3 s of rest the speed of the hold falls to that of activation, so that a joint pushed away
  by hand does not snap back.
* A stop must be short, but must not give the droop away. While the joint rests or creeps (below
  one unit), the droop x_s - joint is remembered (low pass). At fast motion (from four units) and
  at the edge from one unit and more to rest, x_s is limited to the joint's extrapolated place + [0
  .. droop], widened by one cycle of travel and two ticks. Below four units, and at the edge from
  creeping to rest, only the wide limit applies, so that velocities that dither about one unit or
  about zero do not lose the droop time and again: a joint that came with its load, whose droop is
  not known yet, would sink a bit at each edge.
* A joint that has moved with its load sinks when it holds, for its goal has to go to the other side
  of it first. At the edge from one unit and more to creep or rest, x_s is put there at once, by
  what Present Load says of a servo that brakes: its output, of which friction carries a part, so
  that this is never too much.

Limit: goals are whole ticks. A joint that creeps below one unit while it hangs on its compliance
goes from tick to tick; its average is right over some seconds, not within each.

Wheel mode. Moving Speed is output with direction (bit 10), 0 stops, the goal is not used. The same
sigma-delta applies. Output is no speed: expect less under load, and nothing at very low values.

All angles are servo angles (counter-clockwise from the centre).
"""

from __future__ import annotations

import math

from snake_control.ax12.modulation import GoalAndSpeed, Present, Ramp, SigmaDelta, VelocityLimits
from snake_control.ax12.units import (
    MAX_RAW,
    RAD_PER_TICK,
    RAD_S_PER_SPEED_UNIT,
    encode_signed,
    rad_to_ticks,
    ticks_to_rad,
)

SEED_SPEED_RAW = 20
"""Moving Speed at activation: 0.23 rad/s, so that nothing can jump."""

_FAST_UNITS = 4.0
_DROOP_TIME_S = 0.3
_LOAD_TIME_S = 0.1
_REST_TIME_S = 0.3
_STALE_S, _STALE_PERIODS = 0.1, 2.5
_BAND_TICKS = 2.0


class JointModeVelocity:
    """Velocity of one servo in joint mode.

    Attributes:
        setpoint: x_s [rad].
        velocity: what the joint is led with, after all limits [rad/s].
        expected: with what it must be seen moving [rad/s]: 0 where the end of its range is so near
            that a load can hold it before.
    """

    def __init__(self, limits: VelocityLimits) -> None:
        self.setpoint = 0.0
        self._limits = limits
        self._ramp = Ramp(limits)
        self._units = SigmaDelta(RAD_S_PER_SPEED_UNIT, limits.period)
        self._compliance = limits.compliance_ticks * RAD_PER_TICK
        self._lower = ticks_to_rad(limits.lower_ticks)
        self._upper = ticks_to_rad(limits.upper_ticks)
        self.velocity = self.expected = 0.0
        self._speed_raw = SEED_SPEED_RAW
        self._droop = self._load = 0.0
        self._at_rest = 0.0  # [s]
        # At a low rate of the bus the newest reading is a period old.
        self._oldest = max(_STALE_S, _STALE_PERIODS * limits.period)

    def latch(self, angle: float) -> GoalAndSpeed:
        """Start holding ``angle`` [rad] at the low speed of activation."""
        self.setpoint = angle
        self._ramp.velocity = self.velocity = self.expected = 0.0
        self._units.reset()
        self._speed_raw = SEED_SPEED_RAW
        self._droop = self._load = 0.0
        return self._hold()

    def stop(self, dt: float, present: Present) -> GoalAndSpeed:
        """Come to rest at once and hold, without the ramp."""
        self._ramp.velocity = 0.0
        return self.step(0.0, dt, present)

    def step(self, velocity: float, dt: float, present: Present) -> GoalAndSpeed:
        """Return what to send for one cycle.

        Args:
            velocity: wanted from now on [rad/s].
            dt: time since the previous cycle [s].
            present: the joint as last measured.
        """
        limits = self._limits
        dt = min(max(dt, 0.0), limits.look_ahead)
        self._advance(self._units.elapse(dt))
        velocity = self._ramp.step(velocity, dt)
        stale = not present.age <= self._oldest
        if stale:
            velocity = self._ramp.velocity = 0.0
        # x_s stays at the end: pulled back to the joint, it would set off again at once.
        stays = self._is_outwards(velocity, self.setpoint)
        if stays or self._is_outwards(velocity, present.angle):
            velocity = self._ramp.velocity = 0.0
        if not stays:
            self._limit_lead(velocity, dt, present, stale)
        if not stale:
            self._keep_from_sinking(velocity, dt, present)
        self.velocity = velocity
        room = self._upper - present.angle if velocity > 0 else present.angle - self._lower
        self.expected = velocity if room > self._compliance + RAD_PER_TICK else 0.0
        self._at_rest = self._at_rest + dt if velocity == 0.0 else 0.0
        units = self._units.next(velocity)
        if units == 0:
            if self._at_rest > _REST_TIME_S:
                self._speed_raw = min(self._speed_raw, SEED_SPEED_RAW)
            return self._hold()
        self._speed_raw = abs(units)
        ahead = (
            self._compliance
            + RAD_PER_TICK
            + max(abs(velocity), self._speed_raw * RAD_S_PER_SPEED_UNIT) * limits.look_ahead
        )
        return self._send(present.angle + math.copysign(ahead, velocity))

    def _advance(self, way: float) -> None:
        # A joint that was turned out of its range by hand is held there, and only let inwards.
        if way > 0:
            self.setpoint = min(self.setpoint + way, max(self._upper, self.setpoint))
        elif way < 0:
            self.setpoint = max(self.setpoint + way, min(self._lower, self.setpoint))

    def _is_outwards(self, velocity: float, angle: float) -> bool:
        return (velocity > 0 and angle >= self._upper) or (velocity < 0 and angle <= self._lower)

    def _limit_lead(self, velocity: float, dt: float, present: Present, stale: bool) -> None:
        here = present.after(self._oldest, abs(self.velocity) + RAD_S_PER_SPEED_UNIT)
        lead = self.setpoint - here
        speed = abs(velocity)
        slow = max(speed, abs(self.velocity)) < RAD_S_PER_SPEED_UNIT
        if slow and not stale:
            self._droop += (lead - self._droop) * min(1.0, dt / _DROOP_TIME_S)
            self._droop = min(max(self._droop, -self._compliance), self._compliance)
        stopping = velocity == 0.0 and abs(self.velocity) >= RAD_S_PER_SPEED_UNIT
        if stopping or speed >= _FAST_UNITS * RAD_S_PER_SPEED_UNIT:
            band = _BAND_TICKS * RAD_PER_TICK + abs(self.velocity) * self._limits.period
            low, high = min(0.0, self._droop) - band, max(0.0, self._droop) + band
        elif velocity != 0.0 or self.velocity != 0.0:
            high = self._compliance + _BAND_TICKS * RAD_PER_TICK
            low = -high
        else:
            return
        setpoint = here + min(max(lead, low), high)
        # Neither extrapolation nor a load that has pushed the joint out of its range may carry it
        # out, too; only where the joint was found when torque came may be outside.
        setpoint = max(setpoint, min(self._lower, self.setpoint))
        self.setpoint = min(setpoint, max(self._upper, self.setpoint))

    def _keep_from_sinking(self, velocity: float, dt: float, present: Present) -> None:
        if math.isnan(present.load):
            return
        self._load += (present.load - self._load) * min(1.0, dt / _LOAD_TIME_S)
        slows_down = abs(self.velocity) >= RAD_S_PER_SPEED_UNIT > abs(velocity)
        brakes = present.load * self.velocity < 0.0 and self._load * self.velocity < 0.0
        if not (slows_down and brakes):
            return
        # One reading that is wrong must not move the joint.
        share = min(abs(present.load), abs(self._load))
        droop = math.copysign(max(0.0, share * self._compliance - RAD_PER_TICK), present.load)
        setpoint = present.after(self._oldest, abs(self.velocity) + RAD_S_PER_SPEED_UNIT) + droop
        if droop * (setpoint - self.setpoint) > 0.0:
            self.setpoint = min(
                max(setpoint, min(self._lower, self.setpoint)), max(self._upper, self.setpoint)
            )
            self._droop = droop

    def _hold(self) -> GoalAndSpeed:
        return self._send(self.setpoint)

    def _send(self, goal: float) -> GoalAndSpeed:
        low = min(self._limits.lower_ticks, math.floor(rad_to_ticks(self.setpoint)))
        high = max(self._limits.upper_ticks, math.ceil(rad_to_ticks(self.setpoint)))
        first, last = self._limits.goal_ticks
        ticks = min(max(round(rad_to_ticks(goal)), low, first), high, last)
        return GoalAndSpeed(ticks, self._speed_raw)


class WheelModeVelocity:
    """Velocity of one servo in wheel mode, as a share of its speed without load.

    Attributes:
        velocity: what is commanded, after all limits [rad/s].
    """

    def __init__(self, limits: VelocityLimits, no_load_speed: float) -> None:
        self.velocity = 0.0
        self._ramp = Ramp(limits)
        self._longest = limits.look_ahead
        self._units = SigmaDelta(no_load_speed / MAX_RAW, limits.period)

    def latch(self, angle: float) -> GoalAndSpeed:
        """Start at rest; there is no position to hold."""
        del angle
        return self._rest()

    def stop(self, dt: float, present: Present) -> GoalAndSpeed:
        """Come to rest at once."""
        del dt, present
        return self._rest()

    def step(self, velocity: float, dt: float, present: Present) -> GoalAndSpeed:
        """Return what to send for one cycle; arguments as in joint mode."""
        del present
        dt = min(max(dt, 0.0), self._longest)
        self._units.elapse(dt)
        self.velocity = self._ramp.step(velocity, dt)
        return GoalAndSpeed(None, encode_signed(self._units.next(self.velocity)))

    def _rest(self) -> GoalAndSpeed:
        self._ramp.velocity = self.velocity = 0.0
        self._units.reset()
        return GoalAndSpeed(None, 0)
