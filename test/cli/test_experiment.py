"""The command experiment: what it writes, says and returns."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from snake_control.cli.experiment import main
from snake_control.cli.experiment_arguments import parse_arguments
from snake_control.experiment.series import Series
from support.robots import CONFIG, PAPER
from support.waiting import wait_for

ROOT = Path(__file__).parents[2]
QUICK = ("--duration", "0.2", "--plant-step", "0.02")


def test_defaults_are_one_case_of_the_papers_robot_with_perfect_servos():
    arguments = parse_arguments([])
    (config,) = arguments.configurations()
    settings = arguments.settings(config)
    assert (config.controller.case, config.robot) == (3, PAPER)
    assert (settings.servos, settings.rate_hz, settings.duration_s) == ("perfect", 50.0, 60.0)
    assert arguments.out == Path("out/experiment")


def test_all_cases_side_by_side(tmp_path, capsys):
    (tmp_path / "case_3").mkdir()
    stale = [tmp_path / "case_3" / "fig10_head_pose.png", tmp_path / "series.csv"]
    for path in stale:
        path.write_text("of another run")
    (tmp_path / "notes.txt").write_text("mine")

    assert main(["--case", "all", "--out", str(tmp_path), "--no-figures", *QUICK]) == 0
    for case in (1, 2, 3):
        directory = tmp_path / f"case_{case}"
        summary = json.loads((directory / "summary.json").read_text())
        assert (summary["case"], summary["ended"]) == (case, "duration reached")
        assert len(Series.read(directory / "series.csv", PAPER)) == 11
    verdicts = {entry["verdict"] for entry in json.loads((tmp_path / "findings.json").read_text())}
    assert "not shown" in verdicts
    assert (tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    shown = capsys.readouterr()
    assert "times real time" in shown.out
    assert shown.err == ""  # no progress bar where nobody looks
    assert not any(path.exists() for path in stale)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_one_case_writes_what_the_demo_writes(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text("/**:\n  ros__parameters:\n    controller:\n      a_h: 7.0\n")
    out = tmp_path / "out"
    arguments = ["--params-file", str(CONFIG / "paper_robot.yaml"), "--params-file", str(mine)]
    arguments += ["--case", "2", "--servos", "limited", "--no-carry", "--out", str(out), *QUICK]
    assert main(arguments) == 0
    names = {path.name for path in out.iterdir()}
    assert names == {
        "summary.json",
        "series.csv",
        "findings.json",
        "report.html",
        "fig09_head_pose.png",
        "fig11_joint_velocities.png",
        "fig12_theta_bar.png",
        "fig13_scps_and_V_h.png",
        "fig14_V_b1_and_d_min.png",
        "fig15_motion.png",
    }
    parameters = json.loads((out / "summary.json").read_text())["parameters"]
    assert (parameters["a_h"], parameters["b_prime_1_m"]) == (7.0, 0.0)
    assert (parameters["servos"], parameters["carry_remainder"]) == ("limited", False)


def test_internal_motion_is_drawn(tmp_path, capsys):
    assert main(["--internal-motion", "--out", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["internal_motion.png"]
    assert "phi_6: turns joints 6, 7, 9, 11" in capsys.readouterr().out


@pytest.mark.parametrize(
    "wrong",
    [
        ["--case", "4"],
        ["--case", "1,x"],
        ["--case", "1,1"],
        ["--duration", "0"],
        ["--rate", "0.5"],
        ["--plant-step", "nan"],
        ["--servos", "magic"],
        ["--servos", "limited", "--controller", "torque"],
    ],
)
def test_wrong_command_lines_end_with_usage(wrong, capsys):
    with pytest.raises(SystemExit) as caught:
        parse_arguments(wrong)
    assert caught.value.code == 2
    assert wrong[0] in capsys.readouterr().err


def test_wrong_configuration_is_one_line(tmp_path, capsys):
    wrong = tmp_path / "robot.yaml"
    wrong.write_text("/**:\n  ros__parameters:\n    robot:\n      links: 3\n")
    assert main(["--params-file", str(wrong), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("configuration error: robot.links = 3")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_directory_that_cannot_be_made_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["--out", str(tmp_path / "file" / "out"), *QUICK]) == 2
    assert "cannot write to" in capsys.readouterr().err


def test_interrupt_writes_what_there_is(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "snake_control.cli.experiment"]
        + ["--case", "all", "--duration", "3000", "--no-figures", "--no-report"]
        + ["--out", str(tmp_path)],
        cwd=ROOT,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    series = tmp_path / "case_1" / "series.csv"
    try:
        wait_for(
            lambda: series.exists() and series.read_text().count("\n") > 30, 30.0, "thirty rows"
        )
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=30)
    finally:
        process.kill()
    assert (process.returncode, error) == (130, "")
    summary = json.loads((tmp_path / "case_1" / "summary.json").read_text())
    assert summary["ended"].startswith("interrupted at ")
    assert "findings.json" in out
    assert not (tmp_path / "report.html").exists()
    assert not (tmp_path / "case_2" / "summary.json").exists()
