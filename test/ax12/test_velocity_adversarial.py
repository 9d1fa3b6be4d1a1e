"""Whatever is asked of a joint, is read of it and pushes it: what must always hold.

Nothing here knows how the velocity is made; only what is sent, what was read and the servo's way.
"""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given, note, settings
from hypothesis import strategies as st

from snake_control.ax12.modulation import GoalAndSpeed, Present, VelocityLimits
from snake_control.ax12.units import (
    MAX_TICKS,
    RAD_PER_TICK,
    RAD_S_PER_SPEED_UNIT,
    rad_to_ticks,
    ticks_to_rad,
)
from snake_control.ax12.velocity import JointModeVelocity, WheelModeVelocity
from support.servo_model import ServoModel

PERIOD = 0.02
UNIT = RAD_S_PER_SPEED_UNIT
REST = Present(0.0, 0.0, 0.01)

velocities = (
    st.floats(-8.0, 8.0)
    | st.floats(-3 * UNIT, 3 * UNIT)
    | st.sampled_from([0.0, -0.0, 5e-324, -1e-9, 0.4999 * UNIT, 0.5 * UNIT, UNIT, 1e6, -1e6])
)
seen = st.booleans() | st.just(True)
times = st.floats(0.7 * PERIOD, 1.3 * PERIOD) | st.sampled_from([0.0, 1e-6, PERIOD, 0.09, 0.3, 5.0])


@st.composite
def bounds(draw: st.DrawFn) -> VelocityLimits:
    first = draw(st.integers(0, 400))
    last = draw(st.integers(600, MAX_TICKS))
    return VelocityLimits(
        lower_ticks=draw(st.integers(first, 450)),
        upper_ticks=draw(st.integers(550, last)),
        speed=draw(st.floats(0.05, 6.0)),
        acceleration=draw(st.just(0.0) | st.floats(0.5, 50.0)),
        period=PERIOD,
        look_ahead=draw(st.floats(0.05, 0.4)),
        compliance_ticks=draw(st.integers(2, 140)),
        goal_ticks=(first, last),
    )


class Joint:
    """A joint that is asked, read, missed, pushed and held anew; looks at all that is sent."""

    def __init__(self, limits: VelocityLimits, load: float, share: float) -> None:
        first, last = limits.goal_ticks
        start = round(first + share * (last - first))
        self.limits = limits
        self.servo = ServoModel(ticks_to_rad(start), load, max(1, limits.compliance_ticks - 1))
        self.control = JointModeVelocity(limits)
        self.known = self.servo.measured(0.01)
        self.outermost: tuple[float, float] = (start, start)
        self.resting = 0
        self.before: GoalAndSpeed | None = None
        self.sent = self.control.latch(ticks_to_rad(start))

    def go(self, velocity: float, dt: float, seen: bool) -> None:
        self._pass(dt, seen)
        self._take(self.control.step(velocity, dt, self.known))
        self.resting = self.resting + 1 if velocity == 0.0 and not self.limits.acceleration else 0
        self._check()

    def cruise(self, velocity: float, cycles: int) -> None:
        for _ in range(cycles):
            self.go(velocity, PERIOD, True)

    def stop(self, dt: float, seen: bool) -> None:
        self._pass(dt, seen)
        self._take(self.control.stop(dt, self.known))
        self.resting += 1
        self._check()

    def push(self, by: float) -> None:
        edge = ticks_to_rad(MAX_TICKS)
        self.servo.angle = min(max(self.servo.angle + by, ticks_to_rad(0)), edge)

    def hold_anew(self) -> None:
        here = round(rad_to_ticks(self.servo.angle))
        first, last = self.limits.goal_ticks
        if not first <= here <= last:
            return  # Nobody can hold it there.
        self.known = self.servo.measured(0.01)
        self.outermost = (here, here)
        self.resting = 0
        self._take(self.control.latch(ticks_to_rad(here)))
        assert self.sent.goal_ticks == here
        self._check()

    def _pass(self, dt: float, seen: bool) -> None:
        self.servo.run(self.sent, min(dt, 1.0))
        if seen:
            self.known = self.servo.measured(age=0.01)
        else:
            self.known = self.known._replace(age=self.known.age + dt)
        ticks = rad_to_ticks(self.known.angle)
        self.outermost = min(self.outermost[0], ticks), max(self.outermost[1], ticks)

    def _take(self, sent: GoalAndSpeed) -> None:
        self.before, self.sent = self.sent, sent
        note(f"{self.known} -> {sent}")

    def _check(self) -> None:
        goal, speed = self.sent
        limits = self.limits
        assert goal is not None
        assert 1 <= speed <= max(round(limits.speed / UNIT) + 2, 20)
        assert limits.goal_ticks[0] <= goal <= limits.goal_ticks[1]
        assert goal >= min(limits.lower_ticks, math.floor(self.outermost[0]))
        assert goal <= max(limits.upper_ticks, math.ceil(self.outermost[1]))
        # At its end a joint is held there, also one that was pushed away from it.
        at_end = not limits.lower_ticks < goal < limits.upper_ticks and self.control.velocity == 0.0
        if self.before is not None and goal != self.before.goal_ticks and not at_end:
            # A joint that was pushed out of its servo's limits has its goal at the limit.
            first, last = limits.goal_ticks
            ahead = abs(goal - min(max(rad_to_ticks(self.known.angle), first), last))
            fastest = max(limits.speed, speed * UNIT)
            way = fastest * (limits.look_ahead + min(self.known.age, 0.1)) + UNIT * 0.1
            assert ahead <= limits.compliance_ticks + 3.5 + way / RAD_PER_TICK
        if self.resting > 1:
            assert self.before is not None
            assert goal == self.before.goal_ticks
            assert speed <= self.before.speed_raw


events = st.one_of(
    st.tuples(st.just("go"), velocities, times, seen),
    st.tuples(st.just("cruise"), velocities, st.integers(1, 30)),
    st.tuples(st.just("stop"), times, seen),
    st.tuples(st.just("push"), st.floats(-1.0, 1.0)),
    st.tuples(st.just("hold_anew")),
)


@settings(max_examples=300, deadline=None)
@given(bounds(), st.floats(-0.4, 0.4), st.floats(0.0, 1.0), st.lists(events, max_size=60))
def test_a_joint_is_never_sent_what_can_hurt(
    limits: VelocityLimits, load: float, share: float, happenings: list[tuple[Any, ...]]
) -> None:
    joint = Joint(limits, load, share)
    for what, *arguments in happenings:
        getattr(joint, what)(*arguments)


@settings(max_examples=200, deadline=None)
@given(bounds(), st.lists(st.tuples(velocities, times, st.booleans()), max_size=40))
def test_a_wheel_without_a_command_stands(
    limits: VelocityLimits, commands: list[tuple[float, float, bool]]
) -> None:
    control = WheelModeVelocity(limits, 6.18)
    assert control.latch(0.3) == GoalAndSpeed(None, 0)
    most = limits.speed / 6.18 * 1023 + 2
    for velocity, dt, stop in commands:
        sent = control.stop(dt, REST) if stop else control.step(velocity, dt, REST)
        assert sent.goal_ticks is None
        output = sent.speed_raw & 0x3FF
        assert output <= most
        if stop or (velocity == 0.0 and not limits.acceleration):
            assert sent.speed_raw == 0
        elif not limits.acceleration and output:
            assert (sent.speed_raw & 0x400 != 0) == (velocity < 0.0)
    assert control.stop(PERIOD, REST).speed_raw == 0
