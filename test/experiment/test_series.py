"""The recorded series in memory and as CSV."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.errors import SeriesFileError
from snake_control.experiment.series import Series, columns, pose_error
from support.experiments import LONG_ROBOT, step

PAPER_ROBOT = RobotConfig()


def eventful_steps(robot: RobotConfig):
    joints = np.arange(1, robot.joints + 1)
    yield step(robot, 0.0, speed_limited=(2, 5), speed_scale=0.75, u=0.125 * joints)
    yield step(robot, 0.02, status="limited", range_limited=(robot.joints,), fallen=True)
    yield step(robot, 0.04, w=None, phi=None, slip=None, d_min_true=np.nan, V_b1=np.inf)


def test_pose_error_wraps_angles_only():
    error = pose_error([7.0, 0.0, 0.0, 3.0, 0.0, -3.0], [0.0, 0.0, 0.0, -3.0, 0.0, 3.0])
    assert error == pytest.approx([7.0, 0.0, 0.0, 6.0 - 2 * np.pi, 0.0, 2 * np.pi - 6.0])


@pytest.mark.parametrize("robot", [PAPER_ROBOT, LONG_ROBOT])
def test_streamed_file_read_back_is_the_series(robot, tmp_path):
    path = tmp_path / "series.csv"
    series = Series(robot, path)
    for row in eventful_steps(robot):
        series.append(row)
    series.close()

    again = Series.read(path, robot)

    assert len(again) == 3
    for column in columns(robot):
        if column.kind == "text":
            assert again.texts(column.field) == series.texts(column.field)
        elif column.kind == "joints":
            assert again.joints(column.field) == series.joints(column.field)
        else:
            np.testing.assert_allclose(
                again.numbers(column.field), series.numbers(column.field), rtol=1e-8
            )


def test_headers_carry_units_and_follow_the_robot():
    headers = [header for column in columns(LONG_ROBOT) for header in column.headers]
    assert len(set(headers)) == len(headers)
    for expected in ("t_s", "x_h_m", "Y_measured_rad", "P_d_rad", "e_R_rad", "phi_15_rad"):
        assert expected in headers
    assert [h for h in headers if h.endswith("_dot_d_rad_s")] == [
        f"phi_{joint}_dot_d_rad_s" for joint in (2, 3, 7, 9, 11, 13)
    ]
    assert [h for h in headers if h.startswith("slip_")] == [
        f"slip_{link}_m_s" for link in (7, 9, 11, 13, 15, 16)
    ]


def test_limited_joints_are_joint_numbers_in_one_cell(tmp_path):
    series = Series(PAPER_ROBOT, tmp_path / "series.csv")
    series.append(step(PAPER_ROBOT, 0.0, speed_limited=(3, 5)))
    series.close()
    with open(tmp_path / "series.csv", newline="") as file:
        row = next(csv.DictReader(file))
    assert row["speed_limited_joints"] == "3;5"
    assert row["range_limited_joints"] == ""
    assert row["fallen"] == "0"


def test_rows_survive_a_process_that_is_killed(tmp_path):
    path = tmp_path / "series.csv"
    program = (
        "import os, signal, sys\n"
        "from support.experiments import step\n"
        "from snake_control.config import RobotConfig\n"
        "from snake_control.experiment.series import Series\n"
        "robot = RobotConfig()\n"
        "series = Series(robot, sys.argv[1])\n"
        "for i in range(7):\n"
        "    series.append(step(robot, 0.02 * i))\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    root = Path(__file__).parents[2]
    environment = os.environ | {"PYTHONPATH": f"{root}:{root / 'test'}"}
    subprocess.run([sys.executable, "-c", program, str(path)], env=environment, check=False)
    assert len(Series.read(path, PAPER_ROBOT)) == 7


def test_row_that_was_cut_off_is_left_out(tmp_path):
    path = tmp_path / "series.csv"
    series = Series(PAPER_ROBOT, path)
    for i in range(3):
        series.append(step(PAPER_ROBOT, 0.02 * i))
    series.close()
    path.write_text(path.read_text()[:-10])
    assert Series.read(path, PAPER_ROBOT).numbers("t_s") == pytest.approx([0.0, 0.02])


def test_file_of_another_robot_is_refused(tmp_path):
    path = tmp_path / "series.csv"
    Series(PAPER_ROBOT, path).close()
    with pytest.raises(SeriesFileError, match="other columns"):
        Series.read(path, LONG_ROBOT)


def test_damaged_line_is_named(tmp_path):
    path = tmp_path / "series.csv"
    series = Series(PAPER_ROBOT, path)
    series.append(step(PAPER_ROBOT, 0.0))
    series.close()
    path.write_text(path.read_text().replace("tracking,", "tracking,oops,"))
    with pytest.raises(SeriesFileError, match="line 2"):
        Series.read(path, PAPER_ROBOT)


def test_step_of_wrong_size_leaves_the_series_as_it_was():
    series = Series(PAPER_ROBOT)
    with pytest.raises(ValueError, match="u: 3 values instead of 11"):
        series.append(step(PAPER_ROBOT, 0.0, u=[1.0, 2.0, 3.0]))
    assert len(series) == 0
    assert series.numbers("u").shape == (0, 11)


def test_measurement_stands_in_where_the_truth_is_unknown():
    series = Series(PAPER_ROBOT)
    series.append(step(PAPER_ROBOT, 0.0, w=None, w_measured=np.ones(6), d_min=0.01))
    assert not series.truth_known.any()
    assert series.w == pytest.approx(np.ones((1, 6)))
    assert series.d_min == pytest.approx([0.01])
    assert series.error[0] == pytest.approx([1.0, 1.0, 0.8, 0.6, 0.6, 1.0])
    assert series.numbers("error")[0] == pytest.approx(series.error[0])


def test_one_step_without_truth_changes_no_other():
    series = Series(PAPER_ROBOT)
    angles = np.zeros(PAPER_ROBOT.joints)
    wrong = {"w_measured": np.ones(6), "phi_measured": angles + 1.0, "d_min": 0.01}
    series.append(step(PAPER_ROBOT, 0.0, **wrong))
    series.append(step(PAPER_ROBOT, 0.02, **wrong, w=None, phi=None, d_min_true=np.nan))
    assert series.truth_known.tolist() == [True, False]
    assert series.w[0] == pytest.approx(step(PAPER_ROBOT, 0.0).w)
    assert series.w[1] == pytest.approx(np.ones(6))
    assert series.phi[0] == pytest.approx(np.array(PAPER_ROBOT.start_joint_angles_rad))
    assert series.phi[1] == pytest.approx(angles + 1.0)
    assert series.d_min == pytest.approx([0.03, 0.01])
    assert series.error == pytest.approx(series.numbers("error"))
