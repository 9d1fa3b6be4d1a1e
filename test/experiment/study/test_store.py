"""What is stored is what comes back, also after a death in the middle of a line."""

import dataclasses
import math

import pytest

from snake_control.config import ControllerConfig
from snake_control.errors import StudyError
from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.store import OutcomeStore
from snake_control.experiment.study.trajectories import built_in
from snake_control.experiment.study.trial import Outcome, Trial, run_trial
from support.robots import PAPER

OUTCOME = Outcome(Candidate((7, 9), (3,)), "line", None, 0.1 + 0.2, math.inf, 0.5, -1e-3, 2.0, 0.25)
FALLEN = dataclasses.replace(OUTCOME, fell_at_s=12.3)


def test_outcomes_come_back_exactly(tmp_path):
    path = tmp_path / "outcomes.jsonl"
    store = OutcomeStore(path)
    store.add("a", OUTCOME)
    store.add("b", FALLEN)
    again = OutcomeStore(path)
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
