"""Figures of an experiment, as the paper shows them (Figs. 8 to 15)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.style import context
from numpy.typing import NDArray

from snake_control.experiment import panels, style
from snake_control.experiment.motion import motion
from snake_control.experiment.series import Series

Array = NDArray[np.float64]

CASE_NAMES = {
    1: "Case 1: SCPs still",
    2: "Case 2: singularity avoidance",
    3: "Case 3: singularity and fall avoidance",
}
_FIGURE_OF_CASE = {1: 8, 2: 9, 3: 10}


def draw_all(series: Series, case: int, directory: str | Path) -> list[Path]:
    """Draw every figure of a run as PNG files and return their paths.

    Args:
        series: the run; figures of an empty series are not drawn.
        case: preset of sub-tasks, 1..3; named in the titles.
        directory: an existing directory.

    Raises:
        OSError: a file cannot be written.
    """
    if not len(series):
        return []
    # Figures made without pyplot: no global state, no display, whatever the back end.
    with context(style.RC):
        figures = {
            f"fig{_FIGURE_OF_CASE[case]:02d}_head_pose": head_pose(series),
            "fig11_joint_velocities": joint_velocities(series),
            "fig12_theta_bar": theta_bar(series),
            "fig13_scps_and_V_h": scps(series),
            "fig14_V_b1_and_d_min": base_costs(series),
        }
        if np.isfinite(np.hstack((series.w, series.phi))).all(axis=1).any():
            figures["fig15_motion"] = motion(series)
        paths = []
        for name, figure in figures.items():
            title = figure.get_suptitle()
            figure.suptitle(f"{title}  ({CASE_NAMES[case]})", fontsize=11.5)
            path = Path(directory) / f"{name}.png"
            figure.savefig(path)
            paths.append(path)
    return paths


def head_pose(series: Series) -> Figure:
    """Head pose w and its reference w_d over time (Figs. 8 to 10)."""
    figure = Figure(figsize=(9.0, 6.0))
    figure.suptitle("Head pose")
    grid = figure.subplots(3, 2, sharex=True)
    for i, label in enumerate(panels.HEAD_LABELS):
        axes = grid[i % 3][i // 3]
        panels.head_component(axes, series, i)
        panels.time_axis(axes, series, last=i % 3 == 2)
        axes.set_ylabel(label)
    grid[0][0].legend(loc="upper left", ncols=2)
    figure.align_ylabels(grid[:, 0])
    figure.align_ylabels(grid[:, 1])
    return figure


def joint_velocities(series: Series) -> Figure:
    """Joint velocities u sent to the servos (Fig. 11), head and base part."""
    figure = _joint_figure(series, series.numbers("u"), (), "$u$ [rad/s]", "u")
    figure.suptitle("Joint velocities")
    return figure


def theta_bar(series: Series) -> Figure:
    """Angles of the joints that are no SCPs, theta_bar (9) (Fig. 12), head and base part."""
    scp_joints = series.robot.scp_joints
    figure = _joint_figure(series, series.phi, scp_joints, r"$\bar\theta$ [rad]", r"\phi")
    figure.suptitle(r"Dependent joint angles $\bar\theta$")
    return figure


def scps(series: Series) -> Figure:
    """Angles of the shape controllable points, and V_h (29) (Fig. 13)."""
    figure = Figure(figsize=(9.0, 5.2))
    figure.suptitle("Shape controllable points and manipulability")
    upper, lower = figure.subplots(2, 1, sharex=True)
    panels.joint_lines(upper, series, series.phi, series.robot.scp_joints, r"\phi")
    panels.time_axis(upper, series, last=False)
    upper.set_ylabel(r"$\tilde\phi$ [rad]")
    panels.V_h_line(lower, series)
    panels.time_axis(lower, series, last=True)
    lower.set_ylabel("$V_h$")
    figure.align_ylabels()
    return figure


def base_costs(series: Series) -> Figure:
    """V_b1 on a logarithmic axis, d_min (30) (Fig. 14), and the nearness of a singular shape."""
    figure = Figure(figsize=(9.0, 7.0))
    figure.suptitle("Distance from singularity and from falling")
    upper, middle, lower = figure.subplots(3, 1, sharex=True)
    panels.V_b1_line(upper, series)
    panels.time_axis(upper, series, last=False)
    upper.set_ylabel("$V_{b1}$")
    panels.nearness_line(middle, series)
    panels.time_axis(middle, series, last=False)
    middle.set_ylabel("nearness of a\nsingular shape")
    panels.d_min_lines(lower, series)
    panels.time_axis(lower, series, last=True)
    lower.set_ylabel("$d_{min}$ [mm]")
    if series.truth_known.any():
        handles, labels = lower.get_legend_handles_labels()
        lower.legend(handles[::-1], labels[::-1], loc="lower right", ncols=2)
    figure.align_ylabels()
    return figure


def _joint_figure(
    series: Series, values: Array, leave_out: tuple[int, ...], label: str, symbol: str
) -> Figure:
    figure = Figure(figsize=(9.0, 5.2))
    groups = panels.joint_groups(series.robot, leave_out)
    axes = figure.subplots(len(groups), 1, sharex=True, squeeze=False)[:, 0]
    for each, (name, joints) in zip(axes, groups.items(), strict=True):
        panels.joint_lines(each, series, values, joints, symbol)
        panels.time_axis(each, series, last=each is axes[-1])
        each.set_ylabel(label)
        each.set_title(name, loc="left")
    figure.align_ylabels()
    return figure
