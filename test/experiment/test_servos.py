"""What limited servos do to numbers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.experiment.servos import (
    SPEED_UNIT_RAD_S,
    TICK_RAD,
    LimitedServos,
    PerfectServos,
)

ROBOT = RobotConfig()
ZERO = np.zeros(ROBOT.joints)
PERIOD = 0.02


def test_perfect_servos_change_nothing():
    servos = PerfectServos()
    u = np.linspace(-9.0, 9.0, ROBOT.joints)
    np.testing.assert_array_equal(servos.command(u, 5.0 + ZERO, PERIOD), u)
    np.testing.assert_array_equal(servos.measure(u), u)


def test_angles_are_read_in_whole_ticks():
    servos = LimitedServos(ROBOT)
    phi = np.linspace(-2.5, 2.5, ROBOT.joints)
    read = servos.measure(phi)
    np.testing.assert_allclose(read / TICK_RAD, np.round(read / TICK_RAD), atol=1e-9)
    assert 0 < np.abs(read - phi).max() <= TICK_RAD / 2
    assert np.rad2deg(TICK_RAD) == pytest.approx(0.29, abs=0.005)


def test_a_command_is_in_force_one_cycle_later():
    servos = LimitedServos(ROBOT)
    u = 100 * SPEED_UNIT_RAD_S + ZERO
    np.testing.assert_array_equal(servos.command(u, ZERO, PERIOD), ZERO)
    np.testing.assert_allclose(servos.command(ZERO, ZERO, PERIOD), u)
    np.testing.assert_array_equal(servos.command(ZERO, ZERO, PERIOD), ZERO)
    servos.command(u, ZERO, PERIOD)
    servos.reset(ZERO)
    np.testing.assert_array_equal(servos.command(ZERO, ZERO, PERIOD), ZERO)


@pytest.mark.parametrize(("carry", "average"), [(True, 2.3), (False, 2.0)])
def test_speeds_are_whole_units_and_right_on_average_where_the_rest_is_carried(carry, average):
    servos = LimitedServos(ROBOT, carry_remainder=carry)
    u = 2.3 * SPEED_UNIT_RAD_S + ZERO
    sent = np.array([servos.command(u, ZERO, PERIOD) for _ in range(101)])[1:] / SPEED_UNIT_RAD_S
    np.testing.assert_allclose(sent, np.round(sent), atol=1e-9)
    np.testing.assert_allclose(sent.mean(axis=0), average, atol=0.011)


def test_a_joint_stops_at_the_end_of_its_range():
    servos = LimitedServos(ROBOT)
    upper = np.array(ROBOT.joint_limits_rad[1::2])
    phi = upper - 0.01
    for _ in range(3):
        phi = phi + PERIOD * servos.command(2.0 + ZERO, phi, PERIOD)
    np.testing.assert_allclose(phi, upper, atol=1e-12)
    servos.command(-1.0 + ZERO, phi, PERIOD)
    assert (servos.command(ZERO, phi, PERIOD) < -0.9).all()


def test_no_joint_exceeds_its_speed_and_nothing_piles_up_meanwhile():
    robot = dataclasses.replace(ROBOT, joint_speed_limits_rad_s=(1.0,))
    servos = LimitedServos(robot)
    for _ in range(50):
        fast = servos.command(3.0 + ZERO, ZERO, PERIOD)
    assert 1.0 - SPEED_UNIT_RAD_S < fast[0] <= 1.0
    servos.command(ZERO, ZERO, PERIOD)
    assert np.abs(servos.command(ZERO, ZERO, PERIOD)).max() <= SPEED_UNIT_RAD_S * (1 + 1e-9)
