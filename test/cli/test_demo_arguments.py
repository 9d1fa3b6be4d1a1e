"""The demo's command line and the files it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from snake_control.cli.demo_arguments import parse_arguments


def test_defaults_are_the_papers_case_3():
    arguments = parse_arguments([])
    config = arguments.load()
    assert (arguments.case, arguments.duration_s) == (3, 60.0)
    assert arguments.out == Path("out/demo")
    assert config.controller.case == 3
    assert config.robot.links == 12
    assert config.bus_driver.port == config.mock_bus.port
    assert [path.name for path in arguments.all_params_files] == [
        "paper_robot.yaml",
        "mock.yaml",
        "case_3.yaml",
    ]


def test_case_seed_and_noise_reach_the_configuration_and_the_summary():
    arguments = parse_arguments(["--case", "1", "--seed", "5", "--no-noise", "--duration", "2.5"])
    config = arguments.load()
    assert config.controller.case == 1
    assert config.mock_bus.seed == 5
    assert config.mock_bus.mocap_position_noise_m == 0.0
    found = arguments.summary_parameters(config)
    assert found["seed"] == 5
    assert found["mocap_rotation_noise_rad"] == 0.0
    assert found["mocap_delay_s"] == config.mock_bus.mocap_delay_s > 0
    assert found["requested_duration_s"] == 2.5


def test_users_files_come_last(tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text("/**:\n  ros__parameters:\n    controller:\n      a_h: 7.0\n")
    arguments = parse_arguments(["--params-file", str(mine)])
    assert arguments.all_params_files[-1] == mine
    assert arguments.load().controller.a_h == 7.0
    assert arguments.summary_parameters(arguments.load())["params_files"] == [str(mine)]


@pytest.mark.parametrize(
    "wrong",
    [
        ["--case", "4"],
        ["--duration", "0"],
        ["--duration", "nan"],
        ["--seed", "-1"],
        ["--unknown"],
    ],
)
def test_wrong_command_lines_end_with_usage(wrong, capsys):
    with pytest.raises(SystemExit) as caught:
        parse_arguments(wrong)
    assert caught.value.code == 2
    assert "usage: demo" in capsys.readouterr().err


def test_only_results_of_an_older_run_are_removed(tmp_path):
    (tmp_path / "logs").mkdir()
    old = ("fig08_head_pose.png", "fig15_motion.png", "summary.json", "logs/bus_driver.log")
    kept = ("notes.txt", "fig_mine.png")
    for name in (*old, *kept):
        (tmp_path / name).write_text("x")
    parse_arguments(["--out", str(tmp_path)]).prepare_out()
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert left == set(kept)
