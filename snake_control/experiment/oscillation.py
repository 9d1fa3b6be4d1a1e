"""Whether a recorded signal oscillates, and how: period, size, and how much a sine explains."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_PERIODS = 200
_SMALLEST = 1e-9


@dataclasses.dataclass(frozen=True)
class Oscillation:
    """The oscillation found in a signal.

    Attributes:
        peak_to_peak: largest less smallest value, in the signal's unit.
        period_s: period of the sine that fits best; ``None`` for a signal that does not move.
        explained: share of the signal's variance about a straight line that this sine explains,
            0..1.
        turns: how often the signal turned round (went back by more than a tenth of peak_to_peak).
    """

    peak_to_peak: float
    period_s: float | None
    explained: float
    turns: int


def oscillation(t: ArrayLike, values: ArrayLike) -> Oscillation:
    """Analyse a signal by least squares: a straight line and one sine, over all periods.

    Periods from a twentieth of the signal's length up to all of it are tried, evenly spaced in
    their logarithm. With only two or three periods in the window this finds the period closer than
    a spectrum, whose lines lie as far apart as one over the window.

    Args:
        t: times, rising, at least eight, (N,) [s].
        values: the signal, finite, (N,).

    Raises:
        ValueError: fewer than eight samples.
    """
    t, values = np.asarray(t, dtype=float), np.asarray(values, dtype=float)
    if len(t) < 8:
        raise ValueError(f"an oscillation needs 8 samples or more, got {len(t)}")
    peak_to_peak = float(np.ptp(values))
    scale = max(float(np.abs(values).max()), 1.0)
    if peak_to_peak <= _SMALLEST * scale:
        return Oscillation(peak_to_peak, None, 0.0, 0)
    span = float(t[-1] - t[0])
    # A few hundred samples are plenty for the periods in question, and 200 fits stay cheap.
    stride = max(1, len(t) // 500)
    thin_t, thin = t[::stride] - t[0], values[::stride]
    line = np.column_stack((np.ones_like(thin_t), thin_t))
    rest = thin - line @ np.linalg.lstsq(line, thin, rcond=None)[0]
    variance = float(rest @ rest)
    periods = np.geomspace(span / 20, span, _PERIODS)
    shares = [_explained(thin_t, thin, line, period, variance) for period in periods]
    best = int(np.argmax(shares))
    return Oscillation(peak_to_peak, float(periods[best]), float(shares[best]), _turns(values))


def _explained(t: Array, values: Array, line: Array, period: float, variance: float) -> float:
    angle = 2 * np.pi * t / period
    model = np.column_stack((line, np.cos(angle), np.sin(angle)))
    left = values - model @ np.linalg.lstsq(model, values, rcond=None)[0]
    return 1.0 - float(left @ left) / variance if variance > 0 else 0.0


def _turns(values: Array) -> int:
    """Count turning points, each at least a tenth of peak to peak away from the last one."""
    least = 0.1 * float(np.ptp(values))
    turns, direction = 0, 0
    high = low = float(values[0])
    for value in values.tolist():
        high, low = max(high, value), min(low, value)
        if direction <= 0 and value - low > least:
            turns += direction < 0
            direction, high = 1, value
        elif direction >= 0 and high - value > least:
            turns += direction > 0
            direction, low = -1, value
    return turns
