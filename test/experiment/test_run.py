"""Cases in lockstep: the same every time, recorded like the demo's, whatever ends them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.experiment.cases import case_files, load_case
from snake_control.experiment.facts import Facts
from snake_control.experiment.run import AFTER_FALL_S, Settings, run_case
from snake_control.experiment.series import Series
from support.own_sub_tasks import LATE
from support.robots import CONFIG
from support.runs import paper_run

SHORT = Settings(duration_s=0.4, plant_step_s=0.02)


@pytest.mark.parametrize("servos", ["perfect", "limited"])
def test_the_same_run_writes_the_same_bytes(servos, tmp_path):
    settings = dataclasses.replace(SHORT, servos=servos)
    files = [tmp_path / "a.csv", tmp_path / "b.csv"]
    runs = [run_case(load_case((), 3), settings, path) for path in files]
    assert files[0].read_bytes() == files[1].read_bytes()
    assert runs[0].summary == runs[1].summary
    assert len(Series.read(files[0], runs[0].config.robot)) == 21


def test_summary_says_how_the_run_was_made():
    run = run_case(load_case((), 2), dataclasses.replace(SHORT, servos="limited"))
    parameters = run.summary["parameters"]
    assert (run.case, run.summary["case"], run.summary["ended"]) == (2, 2, "duration reached")
    assert parameters["servos"] == "limited"
    assert parameters["carry_remainder"] is True
    assert parameters["control_rate_hz"] == 50.0
    assert parameters["a_prime"] == 1e-11
    assert run.summary["control"]["period_p50_s"] == pytest.approx(0.02)
    assert run.summary["tracking_error_source"] == "ground truth"


def test_rate_sets_the_number_of_cycles():
    run = run_case(load_case((), 2), dataclasses.replace(SHORT, rate_hz=100.0))
    assert len(run.series) == 41


def test_plant_step_hardly_matters_beside_the_control_cycle():
    fine = run_case(load_case((), 3), Settings(duration_s=3.0, plant_step_s=0.005))
    coarse = run_case(load_case((), 3), Settings(duration_s=3.0, plant_step_s=0.02))
    np.testing.assert_allclose(fine.series.phi[-1], coarse.series.phi[-1], atol=2e-3)


def test_a_wish_to_stop_ends_the_run_with_what_there_is():
    run = run_case(load_case((), 3), SHORT, on_step=lambda step: step.t_s < 0.1)
    assert run.interrupted
    assert run.summary["ended"] == "interrupted at 0.10 s"
    assert len(run.series) == 6


def test_a_fall_ends_the_run_a_little_later():
    config = load_case((), 3)
    # The head leans so far to the side that P_G leaves the wheels.
    robot = dataclasses.replace(
        config.robot, start_joint_angles_rad=(0.0, 1.4, 0.0, 1.4, 0.9, *(0.1,) * 6)
    )
    run = run_case(dataclasses.replace(config, robot=robot), Settings(plant_step_s=0.02))
    assert run.summary["fell_at_s"] == 0.0
    assert run.summary["ended"] == "the robot fell at 0.0 s"
    assert run.summary["duration_s"] == pytest.approx(AFTER_FALL_S)


def test_a_start_in_a_singular_posture_ends_the_run_in_words():
    config = load_case((), 3)
    robot = dataclasses.replace(config.robot, start_joint_angles_rad=(0.0,))
    run = run_case(dataclasses.replace(config, robot=robot), SHORT)
    # V_b1 of a head without manipulability is beyond what its weight was made for.
    assert run.summary["ended"].startswith("the motion ran away at 0.02 s")
    assert len(run.series) == 2


def test_perfect_servos_know_no_limits_and_limited_ones_do():
    assert np.abs(paper_run(1).series.phi).max() > 6.5
    assert paper_run(1).summary["limits"]["speed_limit_steps"] == 0
    short = Settings(duration_s=4.0, plant_step_s=0.02, servos="limited")
    limited = run_case(load_case((), 1), short)
    assert np.abs(limited.series.phi).max() <= 2.4
    assert limited.summary["limits"]["speed_limit_steps"] > 0
    assert limited.summary["limits"]["joint_limit_steps"] > 0


def test_torque_control_runs_on_the_body_with_inertia():
    settings = Settings(duration_s=0.1, rate_hz=500.0, controller="torque")
    run = run_case(load_case((), 3), settings)
    assert run.summary["ended"] == "duration reached"
    assert run.summary["parameters"]["controller"] == "torque"
    assert set(run.summary["error_from_exponential_max_from_40_s"].values()) == {None}
    effort = run.series.numbers("effort")
    assert 0.3 < np.abs(effort).max() < 1.5
    np.testing.assert_array_less(np.abs(run.series.numbers("u")[0]), 1e-12)  # starts at rest
    facts = Facts(run)
    assert facts.law == "(21)"
    assert facts.off_law.max() < 5e-3


def test_torques_held_too_long_end_the_run_in_words():
    run = run_case(load_case((), 3), Settings(duration_s=5.0, rate_hz=20.0, controller="torque"))
    assert run.summary["ended"].startswith("no answer after")
    assert len(run.series) > 0


def test_a_sub_task_of_somebody_else_s_that_fails_ends_the_run_in_words(tmp_path, own_package):
    own_package(LATE)
    config = load_case((), 3)
    gains = ControllerConfig(base_sub_tasks=("my_package.my_module:Late",))
    path = tmp_path / "series.csv"
    run = run_case(dataclasses.replace(config, controller=gains), SHORT, path)
    assert run.summary["ended"].startswith("no answer after 0.")
    assert "sub-task my_package.my_module:Late, gradient fails: KeyError" in run.summary["ended"]
    assert not run.interrupted
    assert 0 < len(Series.read(path, config.robot)) == len(run.series) < 21


def test_planar_snake_runs():
    run = run_case(load_case([CONFIG / "planar_snake.yaml"], None), SHORT)
    assert run.summary["ended"] == "duration reached"
    assert run.case == 2


def test_case_wins_over_the_files_and_explicit_weights_over_the_case(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text(
        "/**:\n  ros__parameters:\n    controller:\n      case: 1\n      b_prime: 7.0\n"
    )
    config = load_case([case_files(3)[0], mine], 2)
    assert (config.controller.case, config.controller.b_prime) == (2, 7.0)
    assert load_case([mine], None).controller.case == 1
    assert load_case((), None).controller.case == 3
