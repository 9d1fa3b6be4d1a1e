import math

import pytest

from snake_control.ax12.compliance import Compliance

HARD = Compliance(margin_ticks=1, slope_ticks=32, punch_raw=32, limit_raw=1023)
SOFT = Compliance(margin_ticks=4, slope_ticks=128, punch_raw=0, limit_raw=512)


@pytest.mark.parametrize(
    ("distance", "output"),
    [(0.0, 0.0), (1.0, 0.0), (1.001, 32.0), (17.0, 527.5), (33.0, 1023.0)],
)
def test_the_output_is_that_of_the_manuals_figure(distance: float, output: float) -> None:
    assert HARD.output_at(distance) == pytest.approx(output, abs=0.05)


def test_beyond_the_slope_the_place_tells_nothing() -> None:
    assert math.isnan(HARD.output_at(34.0))


@pytest.mark.parametrize("distance", [5.0, 17.3, 33.0])
def test_distance_and_output_are_inverse(distance: float) -> None:
    assert HARD.distance_at(HARD.output_at(distance)) == pytest.approx(distance)


def test_the_same_output_is_farther_away_for_a_softer_servo() -> None:
    # Half of its limit at half of its slope.
    assert SOFT.distance_at(256.0) == 4.0 + 64.0
    assert SOFT.distance_at(1000.0) == 4.0 + 128.0, "it cannot give that much"


def test_less_than_the_punch_is_held_at_the_margin() -> None:
    assert HARD.distance_at(20.0) == 1.0
    assert Compliance(1, 32, 100, 100).distance_at(50.0) == 1.0


def test_a_servo_has_two_sides() -> None:
    ram = bytes(range(26))
    assert Compliance.found(ram, 24, True) == Compliance(3, 4, 0x1918, 0x0B0A)
    assert Compliance.found(ram, 24, False) == Compliance(2, 4, 0x1918, 0x0B0A)
