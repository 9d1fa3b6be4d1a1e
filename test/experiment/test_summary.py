"""Figures of merit, on series whose figures are known."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.experiment.series import Series
from snake_control.experiment.summary import BusTotals, Run, summarise, write_summary
from snake_control.experiment.table import format_summary
from support.experiments import LONG_ROBOT, step

ROBOT = RobotConfig()
K = (0.4, 0.25, 0.5, 0.1, 0.1, 0.1)
RUN = Run(case=3, K=K, ended="duration reached", parameters={"seed": 7})


def series_of(times, change=lambda t: {}, robot=ROBOT) -> Series:
    series = Series(robot)
    for t in times:
        series.append(step(robot, t, **change(t)))
    return series


def off_by(robot, t, error):
    return {"w": np.asarray(step(robot, t).w_d) + error}


def test_tracking_errors_are_those_of_the_ground_truth():
    errors = {0.0: 0.003, 1.0: -0.004, 45.0: 0.002, 50.0: -0.001}

    def change(t):
        truth = off_by(ROBOT, t, [errors[t], 0.0, 0.0, 0.0, 0.0, -2 * errors[t]])
        return truth | {"w_measured": np.full(6, 99.0)}

    found = summarise(series_of(errors, change), RUN)

    assert found["tracking_error_source"] == "ground truth"
    assert found["tracking_error_rms"]["x_h_m"] == pytest.approx(math.sqrt(30e-6 / 4))
    assert found["tracking_error_rms"]["Y_rad"] == pytest.approx(2 * math.sqrt(30e-6 / 4))
    assert found["tracking_error_rms"]["z_h_m"] == 0.0
    assert found["tracking_error_final"]["x_h_m"] == pytest.approx(-0.001)
    assert found["tracking_error_max_from_40_s"]["x_h_m"] == pytest.approx(0.002)


def test_source_tells_of_steps_without_ground_truth():
    def change(t):
        return {"w": None, "w_measured": np.full(6, 99.0)} if t == 1.0 else {}

    found = summarise(series_of([0.0, 1.0, 2.0], change), RUN)
    assert found["tracking_error_source"] == "ground truth, in 1 of 3 steps measurement"
    assert found["tracking_error_final"]["x_h_m"] == 0.0
    assert found["tracking_error_rms"]["x_h_m"] == pytest.approx(98.99 / math.sqrt(3))


def test_exponential_counts_from_the_end_of_the_last_scaling():
    # Scaled until 2 s; from there the exact exponential, plus 0.01 rad in P at 50 s alone.
    def change(t):
        error = np.zeros(6)
        error[3:] = 0.5 * np.exp(-0.1 * (t - 3.0)) if t >= 3.0 else 1.0
        error[4] += 0.01 * (t == 50.0)
        return off_by(ROBOT, t, error) | {"speed_scale": 0.5 if t <= 2.0 else 1.0}

    found = summarise(series_of(np.arange(0.0, 61.0), change), RUN)

    assert found["last_speed_scaling_end_s"] == 3.0
    distance = found["error_from_exponential_max_from_40_s"]
    assert distance["R_rad"] == pytest.approx(0.0, abs=1e-12)
    assert distance["P_rad"] == pytest.approx(0.01)
    assert distance["Y_rad"] == pytest.approx(0.0, abs=1e-12)


def test_exponential_counts_from_zero_without_scaling():
    found = summarise(
        series_of(
            [0.0, 40.0], lambda t: off_by(ROBOT, t, [0.0, 0.0, 0.0, 0.2 * (t == 0), 0.0, 0.0])
        ),
        RUN,
    )
    assert found["last_speed_scaling_end_s"] == 0.0
    assert found["error_from_exponential_max_from_40_s"]["R_rad"] == pytest.approx(
        0.2 * math.exp(-4.0)
    )


def test_short_run_has_no_settled_errors():
    found = summarise(series_of([0.0, 0.02]), RUN)
    assert set(found["tracking_error_max_from_40_s"].values()) == {None}
    assert set(found["error_from_exponential_max_from_40_s"].values()) == {None}
    assert found["tracking_error_rms"]["x_h_m"] == 0.0


def test_scaling_to_the_very_end_leaves_nothing_to_judge():
    found = summarise(series_of([0.0, 50.0], lambda t: {"speed_scale": 0.9}), RUN)
    assert found["last_speed_scaling_end_s"] == 50.0
    assert set(found["error_from_exponential_max_from_40_s"].values()) == {None}


def test_stability_figures():
    def change(t):
        return {
            "d_min": -1.0,
            "d_min_true": 0.03 - 0.01 * t,
            "V_b1": {0.0: 2e8, 1.0: 3e6, 2.0: 1e9}[t],
        }

    found = summarise(series_of([0.0, 1.0, 2.0], change), RUN)
    assert found["min_d_min_m"] == pytest.approx(0.01)
    assert found["min_d_min_at_s"] == 2.0
    assert found["min_V_b1"] == 3e6
    assert found["min_V_b1_at_s"] == 1.0
    assert found["start_V_b1"] == 2e8
    assert found["min_V_b1_over_start"] == pytest.approx(0.015)


def test_singularity_is_named_with_its_time():
    def change(t):
        nearness = {0.0: 0.5, 1.0: np.nan, 2.0: 0.96, 3.0: 0.98, 4.0: 0.3}[t]
        return {"singular_nearness": nearness, "singular_shape": "parallel" if t == 3.0 else "arc"}

    found = summarise(series_of([0.0, 1.0, 2.0, 3.0, 4.0], change), RUN)
    assert found["max_singular_nearness"] == 0.98
    assert found["max_singular_nearness_at_s"] == 3.0
    assert found["max_singular_nearness_shape"] == "parallel"
    assert found["singular_at_s"] == 2.0
    assert "0.980 (parallel) at 3.0 s; singular from 2.0 s" in format_summary(found)
    assert summarise(series_of([0.0]), RUN)["singular_at_s"] is None


def test_first_fall_counts():
    found = summarise(series_of([0.0, 1.0, 2.0, 3.0], lambda t: {"fallen": t >= 2.0}), RUN)
    assert found["fell"] is True
    assert found["fell_at_s"] == 2.0
    assert found["duration_s"] == 3.0
    assert summarise(series_of([0.0, 1.0]), RUN)["fell"] is False


def test_control_rate_and_jitter():
    times = np.concatenate(([0.0], np.cumsum([0.02] * 98 + [0.03, 0.01])))
    control = summarise(series_of(times), RUN)["control"]
    assert control["steps"] == 101
    assert control["rate_hz"] == pytest.approx(50.0)
    assert control["period_p50_s"] == pytest.approx(0.02)
    # 99 % of 99 intervals: between the two largest of 100 sorted periods, 0.02 and 0.03.
    assert control["period_p99_s"] == pytest.approx(0.02 + 0.01 * 0.01)
    assert control["period_max_s"] == pytest.approx(0.03)
    assert control["jitter_p50_s"] == pytest.approx(0.0, abs=1e-12)
    assert control["steps_by_status"] == {"tracking": 101}


def test_a_slow_quarter_of_a_minute_is_seen_in_the_rates_of_windows():
    periods = [0.02] * 1000 + [0.025] * 600 + [0.02] * 1000
    control = summarise(series_of(np.concatenate(([0.0], np.cumsum(periods)))), RUN)["control"]
    assert control["rate_slowest_10_s_hz"] == pytest.approx(40.0, rel=1e-3)
    assert control["rate_fastest_10_s_hz"] == pytest.approx(50.0, rel=1e-3)


def test_a_run_shorter_than_a_window_has_no_rate_of_windows():
    control = summarise(series_of(np.arange(400) * 0.02), RUN)["control"]
    assert control["rate_slowest_10_s_hz"] is None


def test_limits_name_the_first_joint_at_the_end_of_its_range():
    def change(t):
        return {
            "range_limited": {0.0: (), 1.0: (11,), 2.0: (4, 11)}[t],
            "speed_scale": {0.0: 0.5, 1.0: 1.0, 2.0: 0.25}[t],
            "speed_limited": {0.0: (2,), 1.0: (), 2.0: (2, 3)}[t],
        }

    limits = summarise(series_of([0.0, 1.0, 2.0], change), RUN)["limits"]
    assert limits["first_joint_at_range_end"] == 11
    assert limits["first_joint_at_range_end_at_s"] == 1.0
    assert limits["joint_limit_steps"] == 2
    assert limits["joint_limit_steps_by_joint"] == {"joint_4": 1, "joint_11": 2}
    assert limits["speed_limit_steps"] == 2
    assert limits["damped_steps"] == 0
    assert limits["speed_limit_steps_by_joint"] == {"joint_2": 2, "joint_3": 1}
    assert limits["min_speed_scale"] == 0.25
    assert limits["max_abs_joint_angle_rad"] == pytest.approx(1.1)


def test_bus_figures():
    totals = BusTotals(
        cycle_times_s=[0.005] * 98 + [0.007, 0.009],
        cycles=120,
        late_cycles=2,
        replies=1095,
        misses=5,
        retries=8,
        corrupt_replies=1,
        invalid_values=0,
        lost=(4,),
        duration_s=2.0,
        unheard=1,
    )
    bus = summarise(series_of([0.0]), Run(3, K, "x", {}, totals))["bus"]
    assert bus["rate_hz"] == pytest.approx(50.0)
    assert bus["unheard_cycles"] == 1
    assert bus["cycle_time_p50_s"] == 0.005
    assert bus["cycle_time_p99_s"] == pytest.approx(0.007 + 0.01 * 0.002)
    assert bus["missed_replies"] == 5
    assert bus["missed_replies_fraction"] == pytest.approx(5 / 1100)
    assert (bus["retries"], bus["corrupt_replies"], bus["late_cycles"]) == (8, 1, 2)
    assert bus["servos_lost"] == 1
    assert bus["servos_lost_joints"] == [4]


@pytest.mark.parametrize(
    "series",
    [
        Series(ROBOT),
        series_of([0.0]),
        series_of([0.0, 0.02], robot=LONG_ROBOT),
        series_of([0.0, 1.0], lambda t: {"V_b1": np.nan, "d_min_true": np.nan, "w": None}),
        series_of([0.0, 1.0], lambda t: {"V_b1": np.inf, "w_measured": np.full(6, np.nan)}),
    ],
    ids=["empty", "one step", "another robot", "unknown", "not finite"],
)
def test_json_is_finite_and_the_table_complete_whatever_the_series(series, tmp_path):
    summary = summarise(series, RUN)
    write_summary(summary, tmp_path / "summary.json")

    def refuse(text):
        raise AssertionError(f"{text} is no JSON")

    read = json.loads((tmp_path / "summary.json").read_text(), parse_constant=refuse)
    assert read == summary
    assert read["case"] == 3
    assert read["ended"] == "duration reached"
    assert read["parameters"] == {"seed": 7}
    assert read["software"]["python"]
    table = format_summary(summary)
    assert "duration reached" in table
    assert max(len(line) for line in table.splitlines()) <= 80


def test_table_says_what_the_nodes_take_of_the_processor():
    summary = summarise(series_of([0.0, 1.0]), RUN)
    assert "processor" not in format_summary(summary)
    summary["processor"] = {"mock_bus": 0.2, "scp_controller": 0.254}
    table = format_summary(summary)
    assert "45 % of one core (the mock 20 %); scp_controller 25 %" in table
    assert max(len(line) for line in table.splitlines()) <= 80


def test_table_names_the_joint_at_the_end_of_its_range():
    summary = summarise(series_of([0.0, 1.0], lambda t: {"range_limited": (11,) if t else ()}), RUN)
    assert "joint_11 first, at 1.0 s" in format_summary(summary)
