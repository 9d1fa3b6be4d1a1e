"""The figures are drawn for any robot and any end of a run."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.image import imread

from snake_control.config import RobotConfig
from snake_control.experiment import figures
from snake_control.experiment.figures import draw_all
from snake_control.experiment.motion import motion, snapshot_steps
from snake_control.experiment.series import Series
from support.experiments import LONG_ROBOT, step
from support.robots import ROBOTS

ROBOT = RobotConfig()


def moving(robot: RobotConfig, fell_at_s: float | None = None, truth: bool = True) -> Series:
    series = Series(robot)
    start = np.array(robot.start_joint_angles_rad)
    for t in np.linspace(0.0, 60.0, 61):
        phi = start + 0.2 * np.sin(0.3 * t + np.arange(robot.joints))
        seen = {"w": step(robot, t).w, "phi": phi} if truth else {"w": None, "phi": None}
        fallen = fell_at_s is not None and t >= fell_at_s
        series.append(step(robot, t, phi_measured=phi, u=np.cos(phi), fallen=fallen, **seen))
    return series


@pytest.mark.parametrize(
    ("robot", "case", "head_pose"),
    [
        (ROBOT, 3, "fig10_head_pose.png"),
        (LONG_ROBOT, 1, "fig08_head_pose.png"),
        (ROBOTS["planar"], 2, "fig09_head_pose.png"),
    ],
)
def test_all_figures_are_readable_pictures(robot, case, head_pose, tmp_path):
    paths = draw_all(moving(robot, fell_at_s=45.7), case, tmp_path)
    assert [path.name for path in paths] == [
        head_pose,
        "fig11_joint_velocities.png",
        "fig12_theta_bar.png",
        "fig13_scps_and_V_h.png",
        "fig14_V_b1_and_d_min.png",
        "fig15_motion.png",
    ]
    for path in paths:
        picture = imread(path)
        assert min(picture.shape[:2]) >= 500
        assert picture[..., :3].std() > 0.02  # not one colour


def test_scps_and_dependent_joints_follow_the_robot():
    series = moving(LONG_ROBOT)
    upper, _ = figures.scps(series).get_axes()
    assert _legend(upper) == [rf"$\phi_{{{joint}}}$" for joint in (2, 3, 7, 9, 11, 13)]
    head, base = figures.theta_bar(series).get_axes()
    assert _legend(head) == [rf"$\phi_{{{joint}}}$" for joint in (1, 4, 5, 6)]
    assert _legend(base) == [rf"$\phi_{{{joint}}}$" for joint in (8, 10, 12, 14, 15)]
    np.testing.assert_array_equal(upper.get_lines()[0].get_ydata(), series.numbers("phi")[:, 1])


def test_reference_is_broken_and_the_fall_marked_in_every_panel():
    figure = figures.head_pose(moving(ROBOT, fell_at_s=45.0))
    for axes in figure.get_axes():
        w, w_d, fall = axes.get_lines()
        assert (w.get_linestyle(), w_d.get_linestyle()) == ("-", "--")
        assert list(fall.get_xdata()) == [45.0, 45.0]


def test_d_min_is_in_millimetres():
    *_, lower = figures.base_costs(moving(ROBOT)).get_axes()
    assert np.max(lower.get_lines()[0].get_ydata()) == pytest.approx(30.0)


def test_motion_shows_as_many_moments_as_there_are():
    assert snapshot_steps(np.linspace(0.0, 60.0, 3001), 7) == [500 * i for i in range(7)]
    assert snapshot_steps(np.array([0.0]), 7) == [0]
    series = Series(ROBOT)
    series.append(step(ROBOT, 0.0))
    assert len(motion(series).get_axes()) == 2


def test_series_without_ground_truth_shows_what_was_measured():
    series = moving(ROBOT, truth=False)
    *_, lower = figures.base_costs(series).get_axes()
    assert lower.get_legend() is None
    assert len(lower.get_lines()) == 2  # d_min and the floor of it
    assert len(motion(series).get_axes()) == 14


def test_steps_without_a_reference_leave_gaps():
    series = moving(ROBOT)
    series.append(step(ROBOT, 61.0, w_d=np.full(6, np.nan), status="stale"))
    for axes in motion(series).get_axes():
        assert np.isfinite(axes.get_xlim()).all()


def test_steps_that_are_not_finite_are_drawn(tmp_path):
    series = Series(ROBOT)
    for t in (0.0, 1.0):
        nothing = np.full(ROBOT.joints, np.nan)
        unknown = {"w": None, "phi": None, "w_measured": np.full(6, np.nan)}
        series.append(step(ROBOT, t, V_b1=np.nan, d_min=np.nan, u=nothing, **unknown))
    # All but the motion: there is no posture to show.
    assert len(draw_all(series, 3, tmp_path)) == 5


def test_empty_series_draws_nothing(tmp_path):
    assert draw_all(Series(ROBOT), 3, tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def _legend(axes) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]
