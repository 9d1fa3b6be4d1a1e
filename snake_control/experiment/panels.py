"""Single axes of the paper's figures: one quantity of one run over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from snake_control.config import RobotConfig
from snake_control.experiment import style
from snake_control.experiment.series import Series
from snake_control.model.singular_shape import SINGULAR_ABOVE

Array = NDArray[np.float64]

HEAD_LABELS = ("$x_h$ [m]", "$y_h$ [m]", "$z_h$ [m]", "$R$ [rad]", "$P$ [rad]", "$Y$ [rad]")


def fell_at(series: Series) -> float | None:
    """Return when the robot fell [s], ``None`` if it did not."""
    fallen = np.flatnonzero(series.numbers("fallen") > 0)
    return float(series.numbers("t_s")[fallen[0]]) if len(fallen) else None


def joint_groups(robot: RobotConfig, leave_out: Sequence[int] = ()) -> dict[str, list[int]]:
    """Return the joints of head and base part, counted from 1; groups without any are left out."""
    head = range(1, robot.head_links + 1)
    base = range(robot.head_links + 1, robot.joints + 1)
    groups = {
        "head part": [joint for joint in head if joint not in leave_out],
        "base part": [joint for joint in base if joint not in leave_out],
    }
    return {name: joints for name, joints in groups.items() if joints}


def head_component(axes: Axes, series: Series, component: int) -> None:
    """Draw one component of w and its reference w_d."""
    t = series.numbers("t_s")
    axes.plot(t, series.w[:, component], color=style.BLUE, label="$w$")
    w_d = series.numbers("w_d")[:, component]
    axes.plot(t, w_d, "--", color=style.REFERENCE, linewidth=1.1, label="$w_d$")
    least_span(axes, 0.02 if component < 3 else 0.1)


def joint_lines(
    axes: Axes, series: Series, values: Array, joints: Sequence[int], symbol: str
) -> None:
    """Draw a quantity of several joints, (N, n-1), with a legend at the right."""
    t = series.numbers("t_s")
    for joint, color in zip(joints, style.line_colors(len(joints)), strict=True):
        axes.plot(t, values[:, joint - 1], color=color, linewidth=1.1)
    style.legend_right(axes, [f"${symbol}_{{{joint}}}$" for joint in joints])


def V_h_line(axes: Axes, series: Series) -> None:
    """Draw V_h (29)."""
    axes.plot(series.numbers("t_s"), series.numbers("V_h"), color=style.BLUE)
    axes.ticklabel_format(axis="y", scilimits=(-3, 3))


def V_b1_line(axes: Axes, series: Series) -> None:
    """Draw V_b1 (30) on a logarithmic axis."""
    V_b1 = series.numbers("V_b1")
    axes.plot(series.numbers("t_s"), np.where(V_b1 > 0, V_b1, np.nan), color=style.BLUE)
    if (V_b1 > 0).any():
        axes.set_yscale("log")


def nearness_line(axes: Axes, series: Series) -> None:
    """Draw how near a singular shape of Fig. 5 is, 0..1, and from where on it counts as one."""
    axes.plot(series.numbers("t_s"), series.numbers("singular_nearness"), color=style.BLUE)
    axes.axhline(SINGULAR_ABOVE, color=style.FALL, linewidth=0.9)
    axes.set_ylim(0.0, 1.02)


def d_min_lines(axes: Axes, series: Series) -> None:
    """Draw d_min (30) in millimetres, in truth and as the controller measures it."""
    t = series.numbers("t_s")
    if series.truth_known.any():
        axes.plot(
            t,
            1e3 * series.numbers("d_min"),
            color=style.SKY_BLUE,
            linewidth=1.0,
            label="as the controller measures it",
        )
    axes.plot(t, 1e3 * series.d_min, color=style.BLUE, label="ground truth")
    axes.axhline(0.0, color=style.FALL, linewidth=0.9)


def time_axis(axes: Axes, series: Series, last: bool) -> None:
    """Set the time axis, mark a fall, and label the axis if it is the ``last`` one below."""
    t = series.numbers("t_s")
    axes.set_xlim(float(t[0]), max(float(t[-1]), float(t[0]) + 1e-3))
    style.mark_fall(axes, fell_at(series))
    if last:
        axes.set_xlabel("$t$ [s]")


def least_span(axes: Axes, span: float) -> None:
    """Keep an axis from blowing up noise: show at least ``span`` around the middle."""
    low, high = axes.get_ylim()
    if high - low < span:
        middle = (low + high) / 2
        axes.set_ylim(middle - span / 2, middle + span / 2)
