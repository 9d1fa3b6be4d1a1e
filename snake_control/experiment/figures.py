"""Figures of an experiment, as the paper shows them (Figs. 8 to 15)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.style import context
from numpy.typing import NDArray

from snake_control.experiment import style
from snake_control.experiment.motion import motion
from snake_control.experiment.series import Series

Array = NDArray[np.float64]

_HEAD_LABELS = ("$x_h$ [m]", "$y_h$ [m]", "$z_h$ [m]", "$R$ [rad]", "$P$ [rad]", "$Y$ [rad]")
_FIGURE_OF_CASE = {1: 8, 2: 9, 3: 10}
_CASE = {
    1: "Case 1: SCPs still",
    2: "Case 2: singularity avoidance",
    3: "Case 3: singularity and fall avoidance",
}


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
    fell_at_s = _fell_at(series)
    # Figures made without pyplot: no global state, no display, whatever the back end.
    with context(style.RC):
        figures = {
            f"fig{_FIGURE_OF_CASE[case]:02d}_head_pose": head_pose(series, fell_at_s),
            "fig11_joint_velocities": joint_velocities(series, fell_at_s),
            "fig12_theta_bar": theta_bar(series, fell_at_s),
            "fig13_scps_and_V_h": scps(series, fell_at_s),
            "fig14_V_b1_and_d_min": base_costs(series, fell_at_s),
        }
        if np.isfinite(np.hstack((series.w, series.phi))).all(axis=1).any():
            figures["fig15_motion"] = motion(series)
        paths = []
        for name, figure in figures.items():
            title = figure.get_suptitle()
            figure.suptitle(f"{title}  ({_CASE[case]})", fontsize=11.5)
            path = Path(directory) / f"{name}.png"
            figure.savefig(path)
            paths.append(path)
    return paths


def head_pose(series: Series, fell_at_s: float | None) -> Figure:
    """Head pose w and its reference w_d over time (Figs. 8 to 10)."""
    t = series.numbers("t_s")
    w_d = series.numbers("w_d")
    figure = Figure(figsize=(9.0, 6.0))
    figure.suptitle("Head pose")
    grid = figure.subplots(3, 2, sharex=True)
    for i, label in enumerate(_HEAD_LABELS):
        axes = grid[i % 3][i // 3]
        axes.plot(t, series.w[:, i], color=style.BLUE, label="$w$")
        axes.plot(t, w_d[:, i], "--", color=style.REFERENCE, linewidth=1.1, label="$w_d$")
        _time_axis(axes, t, fell_at_s, last=i % 3 == 2)
        axes.set_ylabel(label)
        _least_span(axes, 0.02 if i < 3 else 0.1)
    grid[0][0].legend(loc="upper left", ncols=2)
    figure.align_ylabels(grid[:, 0])
    figure.align_ylabels(grid[:, 1])
    return figure


def joint_velocities(series: Series, fell_at_s: float | None) -> Figure:
    """Joint velocities u sent to the servos (Fig. 11), head and base part."""
    robot = series.robot
    figure = Figure(figsize=(9.0, 5.2))
    figure.suptitle("Joint velocities")
    groups = {
        "head part": range(1, robot.head_links + 1),
        "base part": range(robot.head_links + 1, robot.joints + 1),
    }
    _joint_panels(figure, series, series.numbers("u"), groups, "$u$ [rad/s]", "u", fell_at_s)
    return figure


def theta_bar(series: Series, fell_at_s: float | None) -> Figure:
    """Angles of the joints that are no SCPs, theta_bar (9) (Fig. 12), head and base part."""
    robot = series.robot
    others = [j for j in range(1, robot.joints + 1) if j not in robot.scp_joints]
    figure = Figure(figsize=(9.0, 5.2))
    figure.suptitle(r"Dependent joint angles $\bar\theta$")
    groups = {
        "head part": [j for j in others if j <= robot.head_links],
        "base part": [j for j in others if j > robot.head_links],
    }
    label = r"$\bar\theta$ [rad]"
    _joint_panels(figure, series, series.phi, groups, label, r"\phi", fell_at_s)
    return figure


def scps(series: Series, fell_at_s: float | None) -> Figure:
    """Angles of the shape controllable points, and V_h (29) (Fig. 13)."""
    robot = series.robot
    t = series.numbers("t_s")
    figure = Figure(figsize=(9.0, 5.2))
    figure.suptitle("Shape controllable points and manipulability")
    upper, lower = figure.subplots(2, 1, sharex=True)
    _joint_lines(upper, t, series.phi, robot.scp_joints, r"\phi")
    _time_axis(upper, t, fell_at_s, last=False)
    upper.set_ylabel(r"$\tilde\phi$ [rad]")
    lower.plot(t, series.numbers("V_h"), color=style.BLUE)
    _time_axis(lower, t, fell_at_s, last=True)
    lower.set_ylabel("$V_h$")
    lower.ticklabel_format(axis="y", scilimits=(-3, 3))
    figure.align_ylabels()
    return figure


def base_costs(series: Series, fell_at_s: float | None) -> Figure:
    """V_b1 on a logarithmic axis and d_min (30) (Fig. 14)."""
    t = series.numbers("t_s")
    figure = Figure(figsize=(9.0, 5.2))
    figure.suptitle("Distance from singularity and from falling")
    upper, lower = figure.subplots(2, 1, sharex=True)
    V_b1 = series.numbers("V_b1")
    upper.plot(t, np.where(V_b1 > 0, V_b1, np.nan), color=style.BLUE)
    if (V_b1 > 0).any():
        upper.set_yscale("log")
    _time_axis(upper, t, fell_at_s, last=False)
    upper.set_ylabel("$V_{b1}$")
    if series.truth_known.any():
        lower.plot(
            t,
            1e3 * series.numbers("d_min"),
            color=style.SKY_BLUE,
            linewidth=1.0,
            label="as the controller measures it",
        )
    lower.plot(t, 1e3 * series.d_min, color=style.BLUE, label="ground truth")
    lower.axhline(0.0, color=style.FALL, linewidth=0.9)
    _time_axis(lower, t, fell_at_s, last=True)
    lower.set_ylabel("$d_{min}$ [mm]")
    if series.truth_known.any():
        handles, labels = lower.get_legend_handles_labels()
        lower.legend(handles[::-1], labels[::-1], loc="lower right", ncols=2)
    figure.align_ylabels()
    return figure


def _joint_panels(
    figure: Figure,
    series: Series,
    values: Array,
    groups: Mapping[str, Sequence[int]],
    label: str,
    symbol: str,
    fell_at_s: float | None,
) -> None:
    t = series.numbers("t_s")
    # A planar snake has no head part.
    groups = {name: joints for name, joints in groups.items() if len(joints)}
    panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (name, joints) in zip(panels, groups.items(), strict=True):
        _joint_lines(panel, t, values, joints, symbol)
        _time_axis(panel, t, fell_at_s, last=panel is panels[-1])
        panel.set_ylabel(label)
        panel.set_title(name, loc="left")
    figure.align_ylabels()


def _joint_lines(axes: Axes, t: Array, values: Array, joints: Sequence[int], symbol: str) -> None:
    for joint, color in zip(joints, style.line_colors(len(joints)), strict=True):
        axes.plot(t, values[:, joint - 1], color=color, linewidth=1.1)
    style.legend_right(axes, [f"${symbol}_{{{joint}}}$" for joint in joints])


def _time_axis(axes: Axes, t: Array, fell_at_s: float | None, last: bool) -> None:
    axes.set_xlim(float(t[0]), max(float(t[-1]), float(t[0]) + 1e-3))
    style.mark_fall(axes, fell_at_s)
    if last:
        axes.set_xlabel("$t$ [s]")


def _least_span(axes: Axes, span: float) -> None:
    """Keep an axis from blowing up noise: show at least ``span`` around the middle."""
    low, high = axes.get_ylim()
    if high - low < span:
        middle = (low + high) / 2
        axes.set_ylim(middle - span / 2, middle + span / 2)


def _fell_at(series: Series) -> float | None:
    fallen = np.flatnonzero(series.numbers("fallen") > 0)
    return float(series.numbers("t_s")[fallen[0]]) if len(fallen) else None
