"""The parts of the driver node that need no graph: its deadlines and the check of commands."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("snake_interfaces")

from snake_interfaces.msg import JointVelocityCommand

from snake_control.config import BusDriverConfig, RobotConfig
from snake_control.errors import ConfigError
from snake_control.nodes.bus_command import CommandBuffer
from snake_control.nodes.bus_load import StaticLoad
from snake_control.nodes.bus_messages import InvalidCommandError, checked_velocities, time_message
from snake_control.nodes.bus_schedule import Schedule

PERIOD = 0.02


def test_cycles_keep_to_absolute_deadlines() -> None:
    schedule = Schedule(PERIOD)
    now = 100.0
    schedule.start(now)
    begins = []
    for i in range(100):
        schedule.begin(now)
        begins.append(now)
        now += 0.003 + 0.0001 * (i % 7)  # the cycle's own work
        now += schedule.end(now) + 0.0005 * (i % 3)  # sleeps oversleep
    assert begins[-1] == pytest.approx(100.0 + 99 * PERIOD, abs=0.002)
    assert (schedule.cycles, schedule.late_cycles) == (100, 0)
    assert schedule.rate == pytest.approx(50.0, rel=0.05)


def test_a_long_pause_is_counted_once_and_not_caught_up() -> None:
    schedule = Schedule(PERIOD)
    schedule.start(0.0)
    schedule.begin(0.0)
    assert schedule.end(0.095) == 0.0  # four periods were missed
    schedule.begin(0.095)
    assert schedule.late_cycles == 1
    assert schedule.end(0.098) == pytest.approx(0.002)
    schedule.begin(0.1)
    assert schedule.late_cycles == 1


def test_a_look_ahead_shorter_than_two_cycles_is_refused() -> None:
    BusDriverConfig(rate_hz=20.0, look_ahead_s=0.1)
    with pytest.raises(ConfigError, match=r"look_ahead_s = 0.1: at least two bus cycles, 0.2 s"):
        BusDriverConfig(rate_hz=10.0, look_ahead_s=0.1)


def test_joints_that_carry_more_than_they_should_are_named() -> None:
    robot = RobotConfig()
    load = StaticLoad(robot, 0.3)
    # Straight and horizontal, the head hangs on joint 5: 5 links of 0.1 kg, 0.034 m half a length.
    straight = load.expected((0.0,) * 11)
    assert abs(straight[4]) == pytest.approx(5 * 0.1 * 9.81 * 5 * 0.034, rel=0.01)
    assert straight[5:] == pytest.approx((0.0,) * 6)
    text = load.too_much((0.0,) * 11)
    assert "joint_5 0.83" in text
    assert "joint_1 " not in text
    assert StaticLoad(robot, 2.0).too_much((0.0,) * 11) == ""


def test_nothing_is_expected_at_angles_that_are_not_known() -> None:
    load = StaticLoad(RobotConfig(), 0.3)
    assert all(map(math.isnan, load.expected((math.nan,) + (0.0,) * 10)))
    assert load.too_much((math.nan,) + (0.0,) * 10) == ""
    assert load.expected(()) == ()


def test_velocities_come_in_joint_order_with_their_age() -> None:
    message = JointVelocityCommand(name=["b", "a"], velocity=[2.0, 1.0])
    message.header.stamp.sec = 10
    velocities, age = checked_velocities(message, ["a", "b"], 10_050_000_000, 0.1)
    assert velocities == (1.0, 2.0)
    assert age == pytest.approx(0.05)


def test_a_stamp_before_the_epoch_is_an_old_one() -> None:
    message = JointVelocityCommand(name=["a"], velocity=[1.0])
    message.header.stamp.sec = -1
    with pytest.raises(InvalidCommandError, match=r"its stamp is 11.00 s old"):
        checked_velocities(message, ["a"], 10_000_000_000, 0.1)


def test_a_clock_that_stands_at_zero_gives_a_stamp() -> None:
    assert (time_message(-20).sec, time_message(-20).nanosec) == (0, 0)
    assert (time_message(3_000_000_005).sec, time_message(3_000_000_005).nanosec) == (3, 5)


def test_after_a_stop_a_zero_command_lets_the_next_ones_through() -> None:
    commands = CommandBuffer(0.1)
    commands.take([0.5], 0.0, 10.0)
    assert commands.newest(10.01) == ((0.5,), "moving")
    commands.wait_for_zero(10.015, 10.02)
    commands.take([0.5], 0.0, 10.03)
    assert commands.newest(10.04) == (None, "holding: waiting for a zero command")
    commands.take([0.0], 0.0, 10.2)  # of a controller that saw no joint states during the stop
    commands.take([0.5], 0.0, 10.5)
    assert commands.newest(10.51) == (None, "holding: waiting for a zero command")
    commands.take([0.0], 0.0, 10.6)
    commands.take([0.5], 0.0, 10.7)
    assert commands.newest(10.71) == ((0.5,), "moving")


def test_silence_while_nobody_listened_is_no_pause() -> None:
    commands = CommandBuffer(0.1)
    for i in range(10):
        commands.alive(10.0 + 0.2 * i)
        commands.take([0.5], 0.0, 10.0 + 0.2 * i)
    commands.wait_for_zero(11.81, 11.82)
    # The process stood still for two seconds, then takes what came meanwhile.
    commands.take([0.5], 0.0, 13.9)
    commands.alive(13.91)
    commands.take([0.5], 0.0, 14.0)
    assert commands.newest(14.01) == (None, "holding: waiting for a zero command")
    # The same with the sign of life first.
    commands.alive(16.0)
    commands.take([0.5], 0.0, 16.01)
    assert commands.newest(16.02)[0] is None
    commands.alive(16.2)
    commands.alive(16.4)
    commands.alive(16.6)
    commands.take([0.5], 0.0, 16.61)
    assert commands.newest(16.62) == ((0.5,), "moving")


def test_a_command_that_nobody_gave_before_the_stop_ended_is_a_new_start() -> None:
    commands = CommandBuffer(0.1)
    commands.take([0.5], 0.0, 9.0)
    commands.wait_for_zero(9.6, 10.0)
    commands.take([0.5], 0.0, 10.1)
    assert commands.newest(10.1) == ((0.5,), "moving")


def test_after_a_stop_a_pause_lets_the_next_command_through() -> None:
    commands = CommandBuffer(0.1)
    commands.take([0.5], 0.0, 9.0)
    # Carrying it out took longer than a pause: nobody read commands meanwhile.
    commands.wait_for_zero(9.1, 10.0)
    assert commands.newest(10.3) == (None, "holding: no command yet")
    commands.take([0.5], 0.0, 10.4)
    assert commands.newest(10.4)[0] is None
    commands.take([0.5], 0.0, 11.0)
    assert commands.newest(11.0) == ((0.5,), "moving")
