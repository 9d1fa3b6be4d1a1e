"""The ranking puts safety first and weighs the rest by places."""

import csv
import math

import pytest

from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.figure import draw
from snake_control.experiment.study.ranking import (
    format_ranking,
    ranking,
    verdict,
    write_csv,
)
from snake_control.experiment.study.trial import Outcome

A, B, C, D, E = (Candidate((link,), (3,)) for link in (7, 8, 9, 10, 11))


def outcome(candidate, trajectory="line", **changes):
    fields = {
        "fell_at_s": None,
        "position_error_rms_m": 0.001,
        "rotation_error_rms_rad": 0.01,
        "worst_singularity": 0.5,
        "min_d_min_m": 0.02,
        "peak_speed_rad_s": 1.0,
        "range_steps": 0.0,
    }
    return Outcome(candidate=candidate, trajectory=trajectory, **(fields | changes))


def order(outcomes):
    return [row.candidate for row in ranking(outcomes)]


def test_a_fall_is_worst_then_a_lost_reference_then_a_singular_shape():
    outcomes = [
        outcome(A, fell_at_s=30.0, position_error_rms_m=math.inf, min_d_min_m=-0.001),
        outcome(B, position_error_rms_m=0.05),
        outcome(C, position_error_rms_m=0.019, worst_singularity=0.9, peak_speed_rad_s=5.0),
        outcome(D),
        outcome(E, worst_singularity=0.96, min_d_min_m=0.03, peak_speed_rad_s=0.5),
    ]
    assert order(outcomes) == [D, C, E, B, A]
    rows = ranking(outcomes)
    counts = [(row.falls, row.lost, row.singular) for row in rows]
    assert counts == [(0, 0, 0), (0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)]
    assert [row.rank for row in rows] == [1, 2, 3, 4, 5]


def test_the_worst_trajectory_counts():
    outcomes = [
        outcome(A, "line"),
        outcome(A, "arc", worst_singularity=0.94, min_d_min_m=0.001, position_error_rms_m=0.01),
        outcome(B, "line", worst_singularity=0.6),
        outcome(B, "arc", worst_singularity=0.6),
    ]
    assert order(outcomes) == [B, A]
    worst = ranking(outcomes)[1]
    assert (worst.worst_singularity, worst.min_d_min_m) == (0.94, 0.001)
    assert worst.position_error_rms_m == 0.01


def test_units_do_not_matter_equal_values_share_their_place():
    outcomes = [
        outcome(A, peak_speed_rad_s=3.0),
        outcome(B, peak_speed_rad_s=300.0),
        outcome(C, peak_speed_rad_s=2.0),
    ]
    rows = ranking(outcomes)
    assert [row.candidate for row in rows] == [C, A, B]
    # Three equal places of 2 and one of its own, 1 to 3.
    assert [row.mean_place for row in rows] == pytest.approx([7 / 4, 8 / 4, 9 / 4])


def test_verdict_and_table_name_the_robot_s_own_choice():
    outcomes = [outcome(c, peak_speed_rad_s=1.0 + i) for i, c in enumerate((A, B, C, D))]
    rows = ranking(outcomes)
    assert "ranks 3 of 4" in verdict(rows, C)
    assert "4 of 4 choices neither fell" in verdict(rows, C)
    assert "it is the best" in verdict(rows, A)
    assert "not among those tried" in verdict(rows, Candidate((12,), (3,)))
    table = format_ranking(rows, D, most=2).splitlines()
    assert [line.split()[0] for line in table[2:]] == ["1", "2", "..", "4*"]
    assert all(len(line) <= 80 for line in table)


def test_csv_holds_every_row(tmp_path):
    rows = ranking([outcome(A), outcome(B, fell_at_s=3.0)])
    write_csv(rows, tmp_path / "r.csv")
    with (tmp_path / "r.csv").open() as stream:
        read = list(csv.DictReader(stream))
    assert [row["wheelless_links"] for row in read] == ["7", "8"]
    assert [int(row["falls"]) for row in read] == [0, 1]
    draw(rows, A, tmp_path / "r.png")
    assert (tmp_path / "r.png").read_bytes().startswith(b"\x89PNG")


def test_runs_that_failed_are_counted_and_named():
    outcomes = [
        outcome(A, failed="after 0.10 s: sub-task m:T fails", position_error_rms_m=math.inf),
        outcome(A, "arc"),
        outcome(B, fell_at_s=3.0),
        outcome(B, "arc"),
    ]
    rows = ranking(outcomes)
    assert [(row.candidate, row.failed, row.falls, row.lost) for row in rows] == [
        (B, 0, 1, 0),
        (A, 1, 0, 0),
    ]
    assert "0 of 2 choices neither fell" in verdict(rows, A)
    assert f"({A}) could not be run to the end on 1 of the trajectories" in verdict(rows, A)
    for chosen in (A, B, C):
        assert verdict(rows, chosen).endswith(
            f"Failed runs: 1, such as {A}: line, after 0.10 s: sub-task m:T fails"
        )
    table = format_ranking(rows, A).splitlines()
    assert [line.split()[-1] for line in table if line != table[1]] == ["failed", "0", "1"]
    assert "failed" not in format_ranking(ranking(outcomes[2:]), B)


def test_tracking_that_has_not_settled_is_not_judged(tmp_path):
    outcomes = [
        outcome(A, position_error_rms_m=0.05),
        outcome(B, peak_speed_rad_s=2.0),
    ]
    rows = ranking(outcomes, judge_tracking=False)
    assert [(row.candidate, row.lost) for row in rows] == [(A, None), (B, None)]
    assert "2 of 2 choices neither fell, nor came near a singular shape" in verdict(rows, A)
    assert "tracking is not judged" in verdict(rows, A)
    cells = format_ranking(rows, A).splitlines()[2].split()
    assert (cells[4], cells[6]) == ("-", "-")
    draw(rows, A, tmp_path / "r.png")
