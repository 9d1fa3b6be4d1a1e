"""What docs/velocity.md says of slow motion, on the mock servo in simulated time."""

from __future__ import annotations

import math

import pytest

from benchmarks.low_speed import LOAD_N_M, run, wheel_run


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("load", [0.0, LOAD_N_M, -LOAD_N_M])
@pytest.mark.parametrize(("units", "tolerance"), [(0.1, 0.015), (0.7, 0.02), (43.0, 0.1)])
def test_slow_velocities_are_right_on_average(
    units: float, tolerance: float, load: float, direction: int
) -> None:
    found = run(units, load, direction)
    assert found.units == pytest.approx(units, abs=tolerance)
    assert math.degrees(found.unevenness) < 0.3
    assert math.degrees(found.overrun) < 0.3
    assert abs(math.degrees(found.stays)) < 0.3
    assert math.degrees(found.alone) < 16.0


def test_in_wheel_mode_a_load_takes_its_share() -> None:
    assert wheel_run(6.0, 0.0) > wheel_run(6.0, LOAD_N_M) > 0.0
    assert wheel_run(0.5, LOAD_N_M) < 0.0
