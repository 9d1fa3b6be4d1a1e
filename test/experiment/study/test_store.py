"""What is stored is what comes back, also after a death in the middle of a line."""

import dataclasses
import math

import pytest

from snake_control.config import ControllerConfig
from snake_control.errors import StudyError
from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.store import OutcomeStore
from snake_control.experiment.study.trajectories import built_in
from snake_control.experiment.study.trial import Outcome, Trial, run_trial, transient_s
from support.own_sub_tasks import LATE
from support.robots import PAPER, ROBOTS

OUTCOME = Outcome(Candidate((7, 9), (3,)), "line", None, 0.1 + 0.2, math.inf, 0.5, -1e-3, 2.0, 0.25)
FAILED = dataclasses.replace(OUTCOME, failed="after 0.10 s: sub-task m:T fails: KeyError: 'x'")
FALLEN = dataclasses.replace(OUTCOME, fell_at_s=12.3)


def test_outcomes_come_back_exactly(tmp_path):
    path = tmp_path / "outcomes.jsonl"
    store = OutcomeStore(path)
    store.add("a", OUTCOME)
    store.add("b", FAILED)
    store.add("b", FALLEN)
    store.add("d", FAILED)
    again = OutcomeStore(path)
    assert again["d"] == FAILED
    assert again["a"] == OUTCOME
    assert again["b"] == FALLEN
    assert "c" not in again


def test_half_a_line_at_the_end_is_dropped_and_the_file_goes_on(tmp_path):
    path = tmp_path / "outcomes.jsonl"
    OutcomeStore(path).add("a", OUTCOME)
    whole = path.read_text()
    path.write_text(whole + whole[: len(whole) // 2])
    store = OutcomeStore(path)
    assert "a" in store
    store.add("b", FALLEN)
    assert OutcomeStore(path)["b"] == FALLEN


def test_a_damaged_line_is_named(tmp_path):
    path = tmp_path / "outcomes.jsonl"
    OutcomeStore(path).add("a", OUTCOME)
    path.write_text("{}\n" + path.read_text())
    with pytest.raises(StudyError, match="line 1 is damaged"):
        OutcomeStore(path)


def trial(**changes):
    fields = {
        "template": PAPER,
        "controller": ControllerConfig(case=3),
        "candidate": Candidate((7, 9, 11), (3,)),
        "trajectory": built_in(PAPER)[0],
        "duration_s": 3.0,
        "dt": 0.02,
    }
    return Trial(**(fields | changes))


def test_a_key_stands_for_all_that_determines_the_outcome():
    base = trial()
    assert trial().key == base.key
    others = [
        trial(controller=ControllerConfig(case=2)),
        trial(candidate=Candidate((7, 9), (3,))),
        trial(trajectory=built_in(PAPER)[1]),
        trial(duration_s=4.0),
        trial(dt=0.01),
        trial(template=dataclasses.replace(PAPER, wheel_offset_m=0.03)),
    ]
    assert len({base.key, *(other.key for other in others)}) == 1 + len(others)
    # The choice that the template itself makes has no part in it.
    assert trial(template=dataclasses.replace(PAPER, wheelless_links=(8,))).key == base.key


def test_a_trial_repeats_itself_and_ends_with_a_fall():
    first = run_trial(trial())
    assert first == run_trial(trial())
    assert not first.fell
    assert first.position_error_rms_m < 0.05
    assert 0.0 < first.worst_singularity < 1.0
    # A heavy head far in front tips the robot at once.
    heavy = dataclasses.replace(PAPER, link_mass_kg=(5.0,) + (0.1,) * 11)
    fallen = run_trial(trial(template=heavy))
    assert fallen.fell_at_s == 0.0
    assert math.isinf(fallen.position_error_rms_m)


def test_a_trial_whose_sub_task_fails_says_so(own_package):
    own_package(LATE)
    gains = ControllerConfig(base_sub_tasks=("my_package.my_module:Late",))
    found = run_trial(trial(controller=gains))
    assert found.failed is not None
    assert found.failed.startswith("after 0.")
    assert "sub-task my_package.my_module:Late, gradient fails: KeyError: 'gone'" in found.failed
    assert math.isinf(found.position_error_rms_m)
    assert 0.0 < found.worst_singularity < 1.0
    assert 0.0 < found.min_d_min_m < 1.0
    nowhere = ControllerConfig(base_sub_tasks=("my_package.nowhere:Late",))
    assert "my_package.nowhere" in str(run_trial(trial(controller=nowhere)).failed)


def test_a_head_needs_three_time_constants_of_its_slowest_gain():
    assert transient_s(PAPER, ControllerConfig()) == pytest.approx(3.0 / 0.25)
    gains = ControllerConfig(K=(0.5, 0.0, 0.1, 0.01, 0.01, 0.01))
    assert transient_s(PAPER, gains) == pytest.approx(30.0)
    # z is nothing that a planar snake moves.
    assert transient_s(ROBOTS["planar"], gains) == pytest.approx(6.0)
    assert transient_s(PAPER, ControllerConfig(K=(0.0,) * 6)) == 0.0
