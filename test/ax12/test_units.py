import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snake_control.ax12 import units


def test_angles_of_the_manual() -> None:
    assert units.ticks_to_rad(512) == 0.0
    assert math.degrees(units.ticks_to_rad(1023) - units.ticks_to_rad(0)) == pytest.approx(300.0)
    assert math.degrees(units.ticks_to_rad(513)) == pytest.approx(0.29, abs=0.005)


@given(st.integers(0, 1023))
def test_every_position_survives_the_round_trip(ticks: int) -> None:
    assert round(units.rad_to_ticks(units.ticks_to_rad(ticks))) == ticks


@given(st.floats(-2.6, 2.6))
def test_an_angle_comes_back_within_half_a_tick(angle: float) -> None:
    back = units.ticks_to_rad(round(units.rad_to_ticks(angle)))
    assert abs(back - angle) <= 0.5 * units.RAD_PER_TICK * (1 + 1e-9)


@given(st.integers(-1023, 1023))
def test_signed_values_survive_the_round_trip(value: int) -> None:
    assert units.decode_signed(units.encode_signed(value)) == value


def test_bit_10_means_clockwise() -> None:
    assert units.decode_signed(0x400 + 100) == -100
    assert units.encode_signed(-100) == 0x400 + 100
    assert pytest.approx(0.111 * math.tau / 60) == units.RAD_S_PER_SPEED_UNIT
    assert units.load_to_fraction(1024 + 1023) == -1.0


def test_a_speed_beyond_the_register_is_refused() -> None:
    with pytest.raises(ValueError, match="1023"):
        units.encode_signed(1024)


def test_error_bits_have_the_names_of_the_manual() -> None:
    assert units.error_names(0x24) == ("overheating", "overload")
    assert units.error_names(0) == ()
    assert len(units.error_names(0x7F)) == 7


@pytest.mark.parametrize(
    ("slope", "step"),
    [(0, 2), (3, 2), (4, 4), (15, 8), (16, 16), (32, 32), (63, 32), (64, 64), (128, 128)],
)
def test_slopes_act_in_seven_steps(slope: int, step: int) -> None:
    assert units.compliance_step(slope) == step
