"""The paper's figures with the cases side by side: one column for each case, axes shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from snake_control.config import RobotConfig
from snake_control.experiment import panels
from snake_control.experiment.figures import CASE_NAMES
from snake_control.experiment.series import Series

# A row: label of its y axis, and what draws one case into it.
_Row = tuple[str, Callable[[Axes, Series], object]]


def head_poses(runs: Mapping[int, Series]) -> Figure:
    """Head pose and reference (Figs. 8 to 10)."""
    rows = [
        (label, _head_component(component)) for component, label in enumerate(panels.HEAD_LABELS)
    ]
    figure = _side_by_side(runs, rows, 1.35)
    figure.axes[0].legend(loc="lower right", ncols=2)
    return figure


def joint_velocities(runs: Mapping[int, Series]) -> Figure:
    """Joint velocities u (Fig. 11)."""
    return _joint_rows(runs, lambda series: series.numbers("u"), False, "$u$ [rad/s]", "u")


def theta_bar(runs: Mapping[int, Series]) -> Figure:
    """Angles of the joints that are no SCPs (Fig. 12)."""
    label = r"$\bar\theta$ [rad]"
    return _joint_rows(runs, lambda series: series.phi, True, label, r"\phi")


def scps(runs: Mapping[int, Series]) -> Figure:
    """Angles of the SCPs, and V_h (Fig. 13)."""
    robot = _robot(runs)
    rows: list[_Row] = [
        (
            r"$\tilde\phi$ [rad]",
            lambda axes, s: panels.joint_lines(axes, s, s.phi, robot.scp_joints, r"\phi"),
        ),
        ("$V_h$", panels.V_h_line),
    ]
    return _side_by_side(runs, rows, 2.3)


def base_costs(runs: Mapping[int, Series]) -> Figure:
    """V_b1 and d_min (Fig. 14), and the nearness of a singular shape (Fig. 5)."""
    rows: list[_Row] = [
        ("$V_{b1}$", panels.V_b1_line),
        ("singular shape", panels.nearness_line),
        ("$d_{min}$ [mm]", panels.d_min_lines),
    ]
    return _side_by_side(runs, rows, 2.3)


def _joint_rows(
    runs: Mapping[int, Series],
    values: Callable[[Series], panels.Array],
    without_scps: bool,
    label: str,
    symbol: str,
) -> Figure:
    robot = _robot(runs)
    groups = panels.joint_groups(robot, robot.scp_joints if without_scps else ())

    def row(joints: Sequence[int]) -> Callable[[Axes, Series], object]:
        return lambda axes, s: panels.joint_lines(axes, s, values(s), joints, symbol)

    rows = [(f"{name}\n{label}", row(joints)) for name, joints in groups.items()]
    return _side_by_side(runs, rows, 2.3)


def _head_component(component: int) -> Callable[[Axes, Series], object]:
    return lambda axes, series: panels.head_component(axes, series, component)


def _robot(runs: Mapping[int, Series]) -> RobotConfig:
    return next(iter(runs.values())).robot


def _side_by_side(runs: Mapping[int, Series], rows: Sequence[_Row], row_height: float) -> Figure:
    width = 4.0 * len(runs) + 0.6 if len(runs) > 1 else 7.5
    figure = Figure(figsize=(width, row_height * len(rows) + 0.6))
    grid = figure.subplots(len(rows), len(runs), sharex=True, sharey="row", squeeze=False)
    for column, (case, series) in enumerate(sorted(runs.items())):
        for (label, draw), axes in zip(rows, grid[:, column], strict=True):
            draw(axes, series)
            panels.time_axis(axes, series, last=axes is grid[-1, column])
            if column == 0:
                axes.set_ylabel(label)
            # One legend for a row: the columns show the same joints.
            elif axes.get_legend() is not None and column < len(runs) - 1:
                axes.get_legend().remove()
        if column == 0 and len(runs) > 1:
            for axes in grid[:, 0]:
                if axes.get_legend() is not None:
                    axes.get_legend().remove()
        grid[0, column].set_title(CASE_NAMES[case])
    # Columns end at different times when a run ended early.
    longest = max(float(series.numbers("t_s")[-1]) for series in runs.values())
    grid[0, 0].set_xlim(0.0, max(longest, 1e-3))
    figure.align_ylabels(grid[:, 0])
    return figure
