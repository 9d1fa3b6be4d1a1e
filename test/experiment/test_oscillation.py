"""Oscillations whose period and size are known."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.experiment.oscillation import oscillation

T = np.linspace(25.0, 60.0, 1751)


@pytest.mark.parametrize("period", [4.0, 11.0, 18.0])
def test_period_and_size_of_a_sine_on_a_slope(period):
    found = oscillation(T, 0.5 * np.sin(2 * np.pi * T / period + 0.3) + 0.01 * T)
    assert found.period_s == pytest.approx(period, rel=0.03)
    assert found.peak_to_peak == pytest.approx(1.0, rel=0.35)
    assert found.explained > 0.99
    assert abs(found.turns - 2 * 35.0 / period) <= 1


def test_a_signal_that_rests_has_no_period():
    found = oscillation(T, np.full_like(T, 0.7))
    assert (found.peak_to_peak, found.period_s, found.turns) == (0.0, None, 0)


def test_a_run_in_one_direction_turns_never():
    found = oscillation(T, np.exp(0.05 * T))
    assert found.turns == 0


def test_noise_is_explained_by_no_sine():
    noise = np.random.default_rng(1).normal(size=len(T))
    assert oscillation(T, noise).explained < 0.1


def test_fewer_than_eight_samples_are_refused():
    with pytest.raises(ValueError, match="8 samples"):
        oscillation(T[:7], T[:7])
