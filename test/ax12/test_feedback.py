"""What a servo's replies must be like to be believed."""

from __future__ import annotations

import math
import random

import pytest

from snake_control.ax12.feedback import Feedback
from snake_control.ax12.gate import CONVINCING_S
from snake_control.ax12.units import (
    RAD_PER_TICK,
    RAD_S_PER_SPEED_UNIT,
    WHEEL_NO_LOAD_RAD_S,
    ticks_to_rad,
)

DT = 0.02


def reply(position: int, speed: int = 0) -> bytes:
    return bytes((*position.to_bytes(2, "little"), *speed.to_bytes(2, "little"), 0, 0, 111, 40))


def at_512() -> Feedback:
    feedback = Feedback()
    assert feedback.take(reply(512), 0, 1.0)
    return feedback


@pytest.mark.parametrize(
    ("position", "speed"),
    [(1024, 0), (600, 3154), (512, 1023), (512, 2047), (700, 0)],
    ids=["range", "speed", "fast", "fast back", "jump"],
)
def test_an_unbelievable_reply_is_not_taken(position: int, speed: int) -> None:
    feedback = at_512()
    assert not feedback.take(reply(position, speed), 4, 1.02)
    assert feedback.angle == 0.0
    assert feedback.read_at == 1.0
    assert feedback.invalid_values == 1
    assert feedback.error_bits == 4


def test_a_joint_that_was_turned_while_unread_is_believed_at_the_second_reading() -> None:
    feedback = at_512()
    assert not feedback.take(reply(900), 0, 1.5)
    assert not feedback.take(reply(200), 0, 1.52), "the two contradict each other"
    feedback = at_512()
    assert not feedback.take(reply(900), 0, 1.5)
    assert feedback.take(reply(902), 0, 1.52)
    assert feedback.angle == ticks_to_rad(902)


def test_a_joint_that_was_unread_and_stayed_is_believed_at_once() -> None:
    assert at_512().take(reply(530), 0, 60.0)


@pytest.mark.parametrize("position", [0, 700, 1023])
def test_nonsense_does_not_become_true_by_being_repeated(position: int) -> None:
    feedback = at_512()
    now = 1.0
    while now - 1.0 < CONVINCING_S:
        now += DT
        assert not feedback.take(reply(position), 0, now)
        assert feedback.angle == 0.0
    # But it may be the truth, after a joint without torque was turned through the gap.
    assert any(feedback.take(reply(position), 0, now + k * DT) for k in (1, 2))


def test_nonsense_that_changes_is_never_believed() -> None:
    feedback = at_512()
    noise = random.Random(1)
    for k in range(1, 500):
        assert not feedback.take(reply(noise.choice((800, 900, 1000))), 0, 1.0 + k * DT)
    assert feedback.invalid_values == 499
    assert feedback.take(reply(515), 0, 11.0)


@pytest.mark.parametrize("rate", [0.5, -5.5])
def test_a_joint_at_any_speed_of_its_own_is_believed(rate: float) -> None:
    feedback = Feedback()
    for k in range(20):
        now = k * DT
        position = round(512 + rate * now / RAD_PER_TICK)
        speed = round(abs(rate) / RAD_S_PER_SPEED_UNIT) + (0x400 if rate < 0 else 0)
        assert feedback.take(reply(position, speed), 0, now)
    assert feedback.rate == pytest.approx(rate, abs=RAD_S_PER_SPEED_UNIT)


def test_a_slow_bus_is_not_mistaken_for_jumps() -> None:
    feedback = Feedback(period=0.2)
    assert all(feedback.take(reply(100 + 50 * k), 0, 0.2 * k) for k in range(15))


def test_an_angle_known_otherwise_is_what_replies_are_judged_by() -> None:
    feedback = at_512()
    feedback.start(ticks_to_rad(900), 5.0)
    assert not feedback.take(reply(300), 0, 5.02)
    assert feedback.take(reply(903), 0, 5.04)
    feedback.start(None, 6.0)
    assert feedback.take(reply(100), 0, 6.02)


@pytest.mark.parametrize("rate", [1.0, 6.0])
def test_a_wheel_is_read_again_right_behind_the_gap_of_its_sensor(rate: float) -> None:
    feedback = Feedback(WHEEL_NO_LOAD_RAD_S[12], wheel=True)
    noise = random.Random(2)
    believed_outside = refused_outside = 0
    for k in range(1500):
        now = k * DT
        turned = math.degrees(rate * now) % 360.0
        if turned < 300.0:
            good = feedback.take(reply(int(turned / 300.0 * 1023)), 0, now)
            believed_outside += good
            refused_outside += not good
        else:
            feedback.take(reply(noise.randint(400, 600)), 0, now)
    assert believed_outside > 20 * refused_outside


def test_six_bytes_leave_voltage_and_temperature_as_they_were() -> None:
    feedback = Feedback()
    assert feedback.take(reply(512), 0, 1.0)
    assert feedback.take(reply(520)[:6], 0, 2.0)
    assert (feedback.voltage, feedback.temperature) == (11.1, 40.0)
    assert (feedback.slow_read_at, feedback.read_at) == (1.0, 2.0)
