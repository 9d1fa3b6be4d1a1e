"""The figures of merit of an experiment, from its series and the totals of its bus."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import json
import math
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snake_control.experiment.series import HEAD_COMPONENTS, HEAD_UNITS, Series, pose_error
from snake_control.model.singular_shape import SINGULAR_ABOVE

Array = NDArray[np.float64]

SETTLED_FROM_S = 40.0
"""Errors are judged from this time on: the first seconds carry the run-in from w(0)."""

_RATE_WINDOW_S = 10.0

_PACKAGES = {
    "snake_control": ("snake_control", "snake-control"),
    "numpy": ("numpy",),
    "scipy": ("scipy",),
    "matplotlib": ("matplotlib",),
    "rclpy": ("rclpy", "ros-rclpy"),
    "dynamixel_sdk": ("dynamixel_sdk", "dynamixel-sdk"),
}


@dataclasses.dataclass(frozen=True)
class BusTotals:
    """What the servo bus did during a run.

    Attributes:
        cycle_times_s: duration of every bus cycle that was observed.
        cycles, late_cycles: since activation; late: started more than half a period late.
        replies, misses, retries, corrupt_replies, invalid_values: sums over all servos.
        lost: joints (numbers) whose servo did not answer for some time.
        duration_s: time over which the cycles were observed.
        unheard: cycles in that time whose state did not arrive.
    """

    cycle_times_s: Sequence[float]
    cycles: int
    late_cycles: int
    replies: int
    misses: int
    retries: int
    corrupt_replies: int
    invalid_values: int
    lost: tuple[int, ...]
    duration_s: float
    unheard: int = 0


@dataclasses.dataclass(frozen=True)
class Run:
    """What a summary says about a run beside its series.

    Attributes:
        case: preset of sub-tasks, 1..3.
        K: diagonal of the feedback gain for w, (6,) [1/s].
        ended: why the run ended, in words.
        parameters: seed, noise, delay, weights, ...: copied into the summary.
        bus: totals of the bus; ``None`` where there was none.
    """

    case: int
    K: Sequence[float]
    ended: str
    parameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    bus: BusTotals | None = None


def summarise(series: Series, run: Run) -> dict[str, Any]:
    """Return the summary of a run: names with units, numbers finite or null; ready for JSON.

    Tracking errors are those of the ground truth against the reference, where it is known.
    """
    summary: dict[str, Any] = {
        "case": run.case,
        "ended": run.ended,
        **_duration_and_fall(series),
        **_tracking(series, np.asarray(run.K, dtype=float)),
        **_stability(series),
        "control": _control(series),
        "bus": None if run.bus is None else _bus(run.bus),
        "limits": _limits(series),
        "parameters": dict(run.parameters),
        "software": software_versions(),
    }
    return {name: finite(value) for name, value in summary.items()}


def write_summary(summary: Mapping[str, Any], path: str | Path) -> None:
    """Write a summary as JSON.

    Raises:
        OSError: the file cannot be written.
    """
    text = json.dumps(summary, indent=2, allow_nan=False)
    Path(path).write_text(text + "\n", encoding="utf-8")


def software_versions() -> dict[str, str | None]:
    """Return the versions of Python and the packages that matter; ``None`` if not installed."""
    versions: dict[str, str | None] = {"python": platform.python_version()}
    for name, distributions in _PACKAGES.items():
        versions[name] = None
        for distribution in distributions:
            try:
                versions[name] = importlib.metadata.version(distribution)
                break
            except importlib.metadata.PackageNotFoundError:
                continue
    return versions


def error_from_exponential(series: Series, K: Array, from_s: float) -> tuple[float, Array]:
    """Return how far R, P, Y are from the error that (24) promises once no limit bites.

    Args:
        series: the run.
        K: diagonal of the feedback gain, (6,) [1/s].
        from_s: only steps from this time on count [s].

    Returns:
        t0, the end of the last speed scaling (0 if none) [s], and the largest
        ``|e(t) - e(t0) exp(-K (t - t0))|`` of R, P, Y, (3,) [rad]; NaN without a step to judge.
    """
    t = series.numbers("t_s")
    error = series.error
    scaled = np.flatnonzero(series.numbers("speed_scale") < 1.0)
    start = int(scaled[-1]) + 1 if len(scaled) else 0
    if start >= len(t):
        return (float(t[-1]) if len(t) else 0.0), np.full(3, np.nan)
    t0 = float(t[start]) if len(scaled) else 0.0
    chosen = (t >= from_s) & (t >= t0)
    if not chosen.any():
        return t0, np.full(3, np.nan)
    ideal = error[start] * np.exp(-K * (t[chosen, None] - t0))
    distance = pose_error(error[chosen], ideal)
    return t0, np.abs(distance[:, 3:]).max(axis=0)


def _duration_and_fall(series: Series) -> dict[str, Any]:
    t = series.numbers("t_s")
    fallen = np.flatnonzero(series.numbers("fallen") > 0)
    return {
        "duration_s": float(t[-1]) if len(t) else 0.0,
        "fell": len(fallen) > 0,
        "fell_at_s": float(t[fallen[0]]) if len(fallen) else None,
    }


def _tracking(series: Series, K: Array) -> dict[str, Any]:
    error = series.error
    known = np.isfinite(error).all(axis=1)
    error = error[known]
    settled = error[series.numbers("t_s")[known] >= SETTLED_FROM_S]
    t0, distance = error_from_exponential(series, K, SETTLED_FROM_S)
    from_40 = f"from_{SETTLED_FROM_S:.0f}_s"
    return {
        "tracking_error_source": _source(series.truth_known),
        "tracking_error_rms": _per_component(_rms(error)),
        "tracking_error_final": _per_component(error[-1] if len(error) else np.full(6, np.nan)),
        f"tracking_error_rms_{from_40}": _per_component(_rms(settled)),
        f"tracking_error_max_{from_40}": _per_component(_max_abs(settled)),
        "last_speed_scaling_end_s": t0,
        f"error_from_exponential_max_{from_40}": {
            f"{name}_rad": float(value)
            for name, value in zip(HEAD_COMPONENTS[3:], distance, strict=True)
        },
    }


def _source(truth_known: NDArray[np.bool_]) -> str:
    if truth_known.any() and not truth_known.all():
        measured = np.count_nonzero(~truth_known)
        return f"ground truth, in {measured} of {len(truth_known)} steps measurement"
    return "ground truth" if truth_known.any() else "measurement"


def _stability(series: Series) -> dict[str, Any]:
    t = series.numbers("t_s")
    found: dict[str, Any] = {}
    for name, unit, values in (("d_min", "_m", series.d_min), ("V_b1", "", series.numbers("V_b1"))):
        known = np.flatnonzero(np.isfinite(values))
        least = known[np.argmin(values[known])] if len(known) else None
        found[f"min_{name}{unit}"] = None if least is None else float(values[least])
        found[f"min_{name}_at_s"] = None if least is None else float(t[least])
    V_b1 = series.numbers("V_b1")
    known = np.flatnonzero(np.isfinite(V_b1))
    start = float(V_b1[known[0]]) if len(known) else math.nan
    found["start_V_b1"] = start
    found["min_V_b1_over_start"] = found["min_V_b1"] / start if start > 0 else None
    return {**found, **_singularity(series)}


def _singularity(series: Series) -> dict[str, Any]:
    t, nearness = series.numbers("t_s"), series.numbers("singular_nearness")
    known = np.flatnonzero(np.isfinite(nearness))
    found: dict[str, Any] = dict.fromkeys(
        (
            "max_singular_nearness",
            "max_singular_nearness_at_s",
            "max_singular_nearness_shape",
            "singular_at_s",
        )
    )
    if not len(known):
        return found
    most = known[np.argmax(nearness[known])]
    found["max_singular_nearness"] = float(nearness[most])
    found["max_singular_nearness_at_s"] = float(t[most])
    found["max_singular_nearness_shape"] = series.texts("singular_shape")[most]
    singular = np.flatnonzero(nearness > SINGULAR_ABOVE)
    if len(singular):
        found["singular_at_s"] = float(t[singular[0]])
    return found


def _control(series: Series) -> dict[str, Any]:
    t = series.numbers("t_s")
    periods = np.diff(t)
    median = _percentile(periods, 50)
    jitter = np.abs(periods - (median or 0.0))
    slowest, fastest = _rates_over_windows(t)
    return {
        "steps": len(series),
        "rate_hz": len(periods) / (t[-1] - t[0]) if len(t) > 1 and t[-1] > t[0] else None,
        "rate_slowest_10_s_hz": slowest,
        "rate_fastest_10_s_hz": fastest,
        "period_p50_s": median,
        "period_p99_s": _percentile(periods, 99),
        "period_max_s": float(periods.max()) if len(periods) else None,
        "jitter_p50_s": _percentile(jitter, 50),
        "jitter_p99_s": _percentile(jitter, 99),
        "step_time_p50_s": _percentile(series.numbers("step_time_s"), 50),
        "step_time_p99_s": _percentile(series.numbers("step_time_s"), 99),
        "steps_by_status": dict(Counter(series.texts("status"))),
    }


def _rates_over_windows(t: Array) -> tuple[float | None, float | None]:
    """Return the lowest and the highest rate over any window of 10 s; ``None`` if too short."""
    # For each step the first one at least a window later.
    later = np.searchsorted(t, t + _RATE_WINDOW_S)
    begin = np.flatnonzero(later < len(t))
    if not len(begin):
        return None, None
    rates = (later[begin] - begin) / (t[later[begin]] - t[begin])
    return float(rates.min()), float(rates.max())


def _bus(bus: BusTotals) -> dict[str, Any]:
    asked = bus.replies + bus.misses
    times = np.asarray(bus.cycle_times_s, dtype=float)
    periods = len(times) + bus.unheard - 1
    rate = periods / bus.duration_s if periods > 0 and bus.duration_s > 0 else None
    return {
        "rate_hz": rate,
        "cycle_time_p50_s": _percentile(times, 50),
        "cycle_time_p99_s": _percentile(times, 99),
        "cycles": bus.cycles,
        "late_cycles": bus.late_cycles,
        "unheard_cycles": bus.unheard,
        "replies": bus.replies,
        "missed_replies": bus.misses,
        "missed_replies_fraction": bus.misses / asked if asked else None,
        "retries": bus.retries,
        "corrupt_replies": bus.corrupt_replies,
        "invalid_values": bus.invalid_values,
        "servos_lost": len(bus.lost),
        "servos_lost_joints": list(bus.lost),
    }


def _limits(series: Series) -> dict[str, Any]:
    t = series.numbers("t_s")
    range_limited = series.joints("range_limited")
    speed_limited = series.joints("speed_limited")
    hits = [i for i, joints in enumerate(range_limited) if joints]
    scale = series.numbers("speed_scale")
    phi = np.abs(series.phi)
    return {
        "joint_limit_steps": len(hits),
        "first_joint_at_range_end": range_limited[hits[0]][0] if hits else None,
        "first_joint_at_range_end_at_s": float(t[hits[0]]) if hits else None,
        "joint_limit_steps_by_joint": _count_joints(range_limited),
        "speed_limit_steps": int(np.count_nonzero(scale < 1.0)),
        "speed_limit_steps_by_joint": _count_joints(speed_limited),
        "min_speed_scale": float(np.nanmin(scale)) if np.isfinite(scale).any() else None,
        "damped_steps": int(np.count_nonzero(series.numbers("damping") > 0.0)),
        "max_abs_joint_angle_rad": float(np.nanmax(phi)) if np.isfinite(phi).any() else None,
    }


def _count_joints(limited: Sequence[tuple[int, ...]]) -> dict[str, int]:
    counts = Counter(joint for joints in limited for joint in joints)
    return {f"joint_{joint}": counts[joint] for joint in sorted(counts)}


def _per_component(values: Array) -> dict[str, float]:
    return {
        f"{name}_{unit}": float(value)
        for name, unit, value in zip(HEAD_COMPONENTS, HEAD_UNITS, values, strict=True)
    }


def _rms(error: Array) -> Array:
    if not len(error):
        return np.full(6, np.nan)
    rms: Array = np.sqrt(np.mean(error**2, axis=0))
    return rms


def _max_abs(error: Array) -> Array:
    return np.abs(error).max(axis=0) if len(error) else np.full(6, np.nan)


def _percentile(values: Array, percent: float) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.percentile(known, percent)) if len(known) else None


def finite(value: Any) -> Any:
    """Replace what JSON has no number for (NaN, infinity) by null."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
