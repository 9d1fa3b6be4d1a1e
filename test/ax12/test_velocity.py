"""Velocity control of one servo: averages, look-ahead, stops, limits."""

from __future__ import annotations

import itertools
import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from snake_control.ax12.modulation import GoalAndSpeed, Present, VelocityLimits
from snake_control.ax12.units import (
    RAD_PER_TICK,
    RAD_S_PER_SPEED_UNIT,
    decode_signed,
    rad_to_ticks,
    ticks_to_rad,
)
from snake_control.ax12.velocity import SEED_SPEED_RAW, JointModeVelocity, WheelModeVelocity
from support.servo_model import ServoModel

PERIOD = 0.02
COMPLIANCE_TICKS = 33
LIMITS = VelocityLimits(
    lower_ticks=5,
    upper_ticks=1019,
    speed=5.5,
    acceleration=0.0,
    period=PERIOD,
    look_ahead=0.15,
    compliance_ticks=COMPLIANCE_TICKS,
)
UNIT = RAD_S_PER_SPEED_UNIT


def limits(**changes: float) -> VelocityLimits:
    return VelocityLimits(**(vars(LIMITS) | changes))  # type: ignore[arg-type]


class Drive:
    """A control and a servo, cycle by cycle."""

    def __init__(self, servo: ServoModel | None = None, limits: VelocityLimits = LIMITS) -> None:
        self.servo = servo or ServoModel()
        self.control = JointModeVelocity(limits)
        self.sent = self.control.latch(ticks_to_rad(round(rad_to_ticks(self.servo.angle))))
        self.history: list[GoalAndSpeed] = []

    def run(self, velocity: float, seconds: float) -> list[float]:
        """Angles after each cycle."""
        angles = []
        for _ in range(round(seconds / PERIOD)):
            self.cycle(velocity)
            angles.append(self.servo.angle)
        return angles

    def cycle(self, velocity: float, dt: float = PERIOD) -> None:
        self.servo.run(self.sent, dt)
        self.sent = self.control.step(velocity, dt, self.servo.measured(age=0.01))
        self.history.append(self.sent)


@settings(max_examples=60, deadline=None)
@given(st.floats(-30.0, 30.0), st.integers(0, 2**32 - 1))
def test_the_average_speed_over_a_second_is_right(units: float, seed: int) -> None:
    """Of what is sent, weighted with the time it is in force, with cycles that jitter."""
    jitter = random.Random(seed)
    control = JointModeVelocity(LIMITS)
    control.latch(0.0)
    way = elapsed = dt = 0.0
    sent_units = 0
    while elapsed < 1.0:
        place = way * UNIT
        sent = control.step(units * UNIT, dt, Present(place, sent_units * UNIT, 0.01))
        way += sent_units * dt
        elapsed += dt
        assert sent.speed_raw >= 1
        assert sent.goal_ticks is not None
        goal_ahead = sent.goal_ticks - rad_to_ticks(place)
        moving = abs(goal_ahead) > COMPLIANCE_TICKS - 1
        sent_units = int(math.copysign(sent.speed_raw, goal_ahead)) if moving else 0
        dt = PERIOD * jitter.uniform(0.7, 1.3)
    assert abs(way / elapsed - units) < 0.05


@pytest.mark.parametrize("units", [0.05, 0.3, -0.3, 0.5, 1.0, 1.7, -2.5, 20.0, 100.3])
@pytest.mark.parametrize("load", [0.0, 0.3, -0.3])
def test_the_joint_follows_on_average_also_against_gravity(units: float, load: float) -> None:
    drive = Drive(ServoModel(load=load))
    drive.run(0.0, 1.0)
    drive.run(units * UNIT, 0.5)  # lets the droop of slow motion settle
    begin = drive.servo.angle
    end = drive.run(units * UNIT, 1.0)[-1]
    # Hanging on its compliance, a joint that creeps goes from tick to tick of the goal.
    tolerance = RAD_PER_TICK if load and abs(units) < 1.0 else 0.1 * UNIT
    assert end - begin == pytest.approx(units * UNIT, abs=tolerance)


@pytest.mark.parametrize("load", [0.3, -0.3])
def test_creeping_against_gravity_loses_nothing_in_the_long_run(load: float) -> None:
    drive = Drive(ServoModel(load=load))
    drive.run(0.3 * UNIT, 2.0)
    begin = drive.servo.angle
    end = drive.run(0.3 * UNIT, 20.0)[-1]
    assert end - begin == pytest.approx(20.0 * 0.3 * UNIT, abs=20.0 * 0.05 * UNIT)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-8.0, 8.0) | st.just(0.0) | st.floats(-0.02, 0.02), max_size=60))
def test_neither_a_speed_of_0_nor_a_goal_outside_the_range_is_ever_sent(
    velocities: list[float],
) -> None:
    drive = Drive()
    for velocity in velocities:
        drive.cycle(velocity)
        drive.cycle(velocity)
    for sent in drive.history:
        assert 1 <= sent.speed_raw <= 1023
        assert sent.goal_ticks is not None
        assert 5 <= sent.goal_ticks <= 1019


@pytest.mark.parametrize("velocity", [1.0 * UNIT, 0.5, -0.5, 2.0])
def test_the_goal_stays_outside_the_slope_and_within_the_look_ahead(velocity: float) -> None:
    drive = Drive(ServoModel(angle=-1.0 if velocity > 0 else 1.0))
    for _ in range(40):
        drive.cycle(velocity)
        assert drive.sent.goal_ticks is not None
        ahead = (ticks_to_rad(drive.sent.goal_ticks) - drive.servo.angle) * math.copysign(
            1.0, velocity
        )
        # One more cycle passes before the next goal, and the reading was rounded.
        before_next = ahead - abs(velocity) * PERIOD + RAD_PER_TICK
        assert before_next >= COMPLIANCE_TICKS * RAD_PER_TICK
        speed = drive.sent.speed_raw * UNIT
        assert ahead <= (COMPLIANCE_TICKS + 2.5) * RAD_PER_TICK + speed * LIMITS.look_ahead


def test_without_the_host_the_joint_runs_no_farther_than_the_look_ahead() -> None:
    drive = Drive()
    drive.run(0.5, 0.5)
    begin = drive.servo.angle
    for _ in range(500):
        drive.servo.run(drive.sent, PERIOD)
    way = drive.servo.angle - begin
    assert way <= (COMPLIANCE_TICKS + 2) * RAD_PER_TICK + 0.5 * (LIMITS.look_ahead + 2 * PERIOD)


@pytest.mark.parametrize("load", [0.0, 0.3, -0.3])
@pytest.mark.parametrize("velocity", [0.05, 0.5, -0.5, 3.0])
def test_a_stop_is_short_and_does_not_come_back(velocity: float, load: float) -> None:
    drive = Drive(ServoModel(angle=-0.5, load=load))
    drive.run(0.0, 1.0)
    drive.run(velocity, 0.6)
    begin = drive.servo.angle
    stop = drive.run(0.0, 1.0)
    direction = math.copysign(1.0, velocity)
    ways = [direction * (angle - begin) for angle in stop]
    longest = 2 * abs(velocity) * PERIOD + 4 * RAD_PER_TICK
    assert max(ways) <= longest
    assert ways[-1] >= -4 * RAD_PER_TICK
    assert max(ways) - ways[-1] <= 3 * RAD_PER_TICK


def test_stopping_again_and_again_does_not_let_gravity_win() -> None:
    drive = Drive(ServoModel(load=0.4))
    drive.run(0.0, 1.0)
    begin = drive.servo.angle
    for _ in range(40):
        drive.run(0.5 * UNIT, 0.1)
        drive.run(0.0, 0.1)
    expected = begin + 40 * 0.1 * 0.5 * UNIT
    assert drive.servo.angle == pytest.approx(expected, abs=2 * RAD_PER_TICK)


@pytest.mark.parametrize("units", [0.4, 2.0, 6.0])
def test_a_velocity_that_dithers_about_zero_does_not_let_gravity_win(units: float) -> None:
    drive = Drive(ServoModel(load=0.4))
    drive.run(0.0, 1.0)
    begin = drive.servo.angle
    for _ in range(200):
        drive.cycle(units * UNIT)
        drive.cycle(-units * UNIT)
    assert drive.servo.angle == pytest.approx(begin, abs=3 * RAD_PER_TICK)


def test_holding_does_not_creep_under_load() -> None:
    drive = Drive(ServoModel(load=0.4))
    droop = drive.run(0.0, 1.0)[-1]
    assert droop == pytest.approx(-(1 + 0.4 * 32) * RAD_PER_TICK, abs=RAD_PER_TICK)
    assert drive.run(0.0, 10.0)[-1] == pytest.approx(droop, abs=0.1 * RAD_PER_TICK)
    assert len({sent.goal_ticks for sent in drive.history}) == 1


@pytest.mark.parametrize("velocity", [0.5 * UNIT, 0.5])
def test_a_blocked_joint_does_not_wind_the_setpoint_up(velocity: float) -> None:
    control = JointModeVelocity(LIMITS)
    control.latch(0.0)
    for _ in range(5000):
        control.step(velocity, PERIOD, Present(0.0, 0.0, 0.01))
    assert control.setpoint <= (COMPLIANCE_TICKS + 2.001) * RAD_PER_TICK
    if velocity > 4 * UNIT:
        assert control.setpoint <= 2.001 * RAD_PER_TICK + velocity * PERIOD


def test_at_the_end_of_the_range_only_the_way_back_is_open() -> None:
    drive = Drive(limits=limits(upper_ticks=600))
    end = drive.run(0.5, 3.0)[-1]
    assert ticks_to_rad(596) <= end <= ticks_to_rad(600) + 1e-9
    assert drive.sent.goal_ticks == 600
    back = drive.run(-0.5, 0.5)[-1]
    assert back == pytest.approx(end - 0.25, abs=0.03)


def test_a_joint_outside_its_range_is_held_there_and_let_in() -> None:
    outside = ticks_to_rad(700)
    drive = Drive(ServoModel(angle=outside), limits=limits(upper_ticks=600))
    assert drive.run(0.0, 0.5)[-1] == pytest.approx(outside, abs=RAD_PER_TICK)
    assert drive.run(0.5, 0.5)[-1] == pytest.approx(outside, abs=RAD_PER_TICK)
    assert drive.run(-0.5, 2.0)[-1] == pytest.approx(outside - 1.0, abs=0.05)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("load", [0.1, 0.3, 0.6])
def test_a_load_carries_a_joint_at_its_end_no_farther_than_compliance_gives(
    way: int, load: float
) -> None:
    """A joint goes out with its load, and its velocity dithers about zero there."""
    drive = Drive(ServoModel(load=-way * load), limits=limits(lower_ticks=400, upper_ticks=600))
    drive.run(way * 0.8, 2.0)
    for _ in range(150):
        drive.cycle(way * 0.1 * UNIT)
        drive.cycle(-way * 0.1 * UNIT)
        drive.cycle(0.0)
    assert all(400 <= sent.goal_ticks <= 600 for sent in drive.history)
    end = ticks_to_rad(600 if way > 0 else 400) + way * (2 + 32 * load) * RAD_PER_TICK
    assert way * drive.servo.angle <= way * end


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("load", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("known", [True, False])
def test_a_joint_that_comes_with_its_load_sinks_once_at_most(
    way: int, load: float, known: bool
) -> None:
    """Not at all, but for what a cycle and friction take, if Present Load tells how it brakes."""
    drive = Drive(ServoModel(load=-way * load, load_known=known))
    drive.run(way * 0.2, 2.0)
    before = drive.servo.angle
    for _ in range(150):
        drive.cycle(way * 0.1 * UNIT)
        drive.cycle(-way * 0.1 * UNIT)
        drive.cycle(0.0)
    sunk = way * (drive.servo.angle - before)
    travel = 2 * 0.2 * PERIOD
    assert sunk <= (5 + (0 if known else 32 * load)) * RAD_PER_TICK + travel
    assert sunk >= -3 * RAD_PER_TICK


@pytest.mark.parametrize("velocity", [1.5 * UNIT, 6 * UNIT])
@pytest.mark.parametrize("load", [-0.5, 0.5])
def test_edges_to_rest_again_and_again_neither_sink_nor_climb(velocity: float, load: float) -> None:
    drive = Drive(ServoModel(load=load))
    drive.run(0.0, 1.0)
    begin = drive.servo.angle
    for _ in range(40):
        drive.run(velocity, 0.1)
        drive.run(0.0, 0.1)
        drive.run(-velocity, 0.1)
        drive.run(0.0, 0.1)
    assert drive.servo.angle == pytest.approx(begin, abs=6 * RAD_PER_TICK)


def test_one_load_that_is_misread_moves_no_joint_far() -> None:
    control = JointModeVelocity(LIMITS)
    control.latch(0.0)
    angle = 0.0
    for _ in range(50):
        angle += 0.1 * PERIOD
        control.step(0.1, PERIOD, Present(angle, 0.1, 0.01, 0.05))
    for load in (-1.0, 0.05, 0.05, 0.05):
        control.step(0.0, PERIOD, Present(angle, 0.0, 0.01, load))
    assert abs(control.setpoint - angle) <= 0.2 * COMPLIANCE_TICKS * RAD_PER_TICK


def test_speed_is_limited() -> None:
    drive = Drive(limits=limits(speed=0.3))
    begin = drive.run(2.0, 0.2)[-1]
    assert drive.run(2.0, 1.0)[-1] - begin == pytest.approx(0.3, abs=0.01)


def test_acceleration_is_limited_but_not_at_a_stop() -> None:
    drive = Drive(limits=limits(acceleration=1.0))
    speeds = []
    for _ in range(25):
        drive.cycle(2.0)
        speeds.append(drive.sent.speed_raw * UNIT)
    assert speeds[-1] == pytest.approx(0.5, abs=UNIT)
    assert max(b - a for a, b in itertools.pairwise(speeds)) <= 0.02 + 2 * UNIT
    sent = drive.control.stop(PERIOD, drive.servo.measured(0.01))
    assert sent.goal_ticks is not None
    assert abs(ticks_to_rad(sent.goal_ticks) - drive.servo.angle) < 0.03


def test_activation_holds_where_the_joint_is_at_a_low_speed() -> None:
    sent = JointModeVelocity(LIMITS).latch(ticks_to_rad(300))
    assert sent.goal_ticks == 300
    assert 1 <= sent.speed_raw <= 30


def test_a_pause_of_the_host_does_not_make_the_setpoint_run_away() -> None:
    drive = Drive()
    drive.run(0.5, 0.5)
    drive.cycle(0.5, dt=3.0)
    assert abs(drive.control.setpoint - drive.servo.angle) < 0.1


def test_before_the_first_reading_the_joint_holds() -> None:
    control = JointModeVelocity(LIMITS)
    held = control.latch(0.1)
    for _ in range(5):
        assert control.step(0.5, PERIOD, Present(math.nan, math.nan, math.inf)) == held


@pytest.mark.parametrize("velocity", [0.5 * UNIT, 0.5, -0.5, 3.0])
def test_without_readings_the_joint_holds_where_it_was_seen_last(velocity: float) -> None:
    drive = Drive(ServoModel(angle=-math.copysign(1.0, velocity)))
    drive.run(velocity, 0.6)
    last = drive.servo.measured(age=0.0)
    age = 0.01
    for _ in range(100):
        drive.servo.run(drive.sent, PERIOD)
        age += PERIOD
        drive.sent = drive.control.step(velocity, PERIOD, last._replace(age=age))
    assert abs(drive.servo.angle - last.angle) <= abs(velocity) * 0.15 + 6 * RAD_PER_TICK
    assert abs(drive.control.setpoint - drive.servo.angle) <= 6 * RAD_PER_TICK


def test_at_a_low_rate_of_the_bus_a_reading_of_the_last_cycle_is_fresh() -> None:
    control = JointModeVelocity(limits(period=0.2, look_ahead=0.4))
    control.latch(0.0)
    sent = control.step(0.5, 0.2, Present(0.0, 0.0, 0.2))
    assert sent.goal_ticks is not None
    assert sent.goal_ticks > 512 + COMPLIANCE_TICKS


def test_a_misread_speed_does_not_put_the_hold_ahead() -> None:
    drive = Drive()
    drive.run(0.3, 0.5)
    misread = drive.servo.measured(age=0.03)._replace(rate=1023 * UNIT)
    sent = drive.control.step(0.0, PERIOD, misread)
    assert sent.goal_ticks is not None
    assert ticks_to_rad(sent.goal_ticks) - drive.servo.angle <= 0.3 * 0.06 + 4 * RAD_PER_TICK


def test_a_goal_is_never_outside_the_servos_own_limits() -> None:
    """The servo would refuse it and go on to the goal it had."""
    drive = Drive(
        ServoModel(angle=ticks_to_rad(690)), limits=limits(upper_ticks=600, goal_ticks=(300, 700))
    )
    pushed = Present(ticks_to_rad(720), 0.0, 0.01)
    drive.control.step(-0.5, PERIOD, pushed)
    for velocity in (-0.5, 0.0, 0.5, 0.0):
        sent = drive.control.step(velocity, PERIOD, pushed)
        assert sent.goal_ticks is not None
        assert 300 <= sent.goal_ticks <= 700
    held = drive.control.latch(ticks_to_rad(720))
    assert held.goal_ticks == 700


def test_after_some_rest_the_hold_is_as_slow_as_at_activation() -> None:
    drive = Drive()
    drive.run(2.0, 0.3)
    drive.run(0.0, 0.2)
    assert drive.sent.speed_raw > 100
    drive.run(0.0, 0.2)
    assert drive.sent.speed_raw == SEED_SPEED_RAW
    drive.cycle(2.0)
    assert drive.sent.speed_raw > 100


@pytest.mark.parametrize("share", [0.0003, -0.01, 0.2, -1.0])
def test_wheel_mode_sends_signed_output_and_no_goal(share: float) -> None:
    no_load = 6.18
    control = WheelModeVelocity(limits(speed=100.0), no_load)
    control.latch(0.0)
    total = 0
    for _ in range(500):
        sent = control.step(share * no_load, PERIOD, Present(0.0, 0.0, 0.01))
        assert sent.goal_ticks is None
        total += decode_signed(sent.speed_raw)
    assert total / 500 == pytest.approx(share * 1023, abs=0.1)
    assert control.step(0.0, PERIOD, Present(0.0, 0.0, 0.01)) == GoalAndSpeed(None, 0)
    control.step(1.0, PERIOD, Present(0.0, 0.0, 0.01))
    assert control.stop(PERIOD, Present(0.0, 0.0, 0.01)) == GoalAndSpeed(None, 0)
