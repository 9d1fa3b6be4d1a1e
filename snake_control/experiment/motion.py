"""The motion of the robot seen from above and from the side at several times (Fig. 15)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from snake_control.config import RobotConfig
from snake_control.errors import ModelError
from snake_control.experiment import style
from snake_control.experiment.series import Series
from snake_control.model.geometry import geometry, link_points, wheel_contacts
from snake_control.model.stability import support

Array = NDArray[np.float64]

SNAPSHOTS = 7


def motion(series: Series) -> Figure:
    """Draw the robot at evenly spaced times, each as one row: from above, from the side.

    Raises:
        ModelError: no step holds a finite posture.
    """
    robot = series.robot
    q = np.hstack((series.w, series.phi))
    known = np.isfinite(q).all(axis=1)
    if not known.any():
        raise ModelError("no posture is known throughout, so there is no motion to draw")
    q, t, w_d = q[known], series.numbers("t_s")[known], series.numbers("w_d")[known]
    w = q[:, :6]
    shown = snapshot_steps(t, SNAPSHOTS)
    points = [link_points(robot, q[i]) for i in shown]
    # A reference that is not known in a step is NaN there.
    everything = np.vstack((*points, w[:, :3], w_d[:, :3]))
    low, high = np.nanmin(everything, axis=0) - 0.05, np.nanmax(everything, axis=0) + 0.05
    low[2] = -0.03

    width = 10.0
    span_x, span_y, span_z = high - low
    # Rows as high as the robot needs at equal scales, so that no row is mostly empty.
    row = (width / 2 - 0.6) * max(span_y, span_z) / span_x
    figure = Figure(figsize=(width, min(len(shown) * (row + 0.12) + 1.3, 14.0)))
    figure.suptitle("Motion of the robot")
    grid = figure.subplots(len(shown), 2, sharex=True, sharey="col", squeeze=False)
    for (above, side), i, chain in zip(grid, shown, points, strict=True):
        _from_above(above, robot, q[i])
        _from_the_side(side, robot, chain)
        _paths(above, w[: i + 1], w_d, 1)
        _paths(side, w[: i + 1], w_d, 2)
        above.set_title(f"$t$ = {t[i]:.1f} s", loc="left", fontsize=9.5, pad=3)
        above.set_ylabel("$y$ [m]")
        side.set_ylabel("$z$ [m]")
        for axes, vertical in ((above, 1), (side, 2)):
            axes.set_aspect("equal")
            axes.set_xlim(low[0], high[0])
            axes.set_ylim(low[vertical], high[vertical])
    grid[0][0].set_title("from above")
    grid[0][1].set_title("from the side")
    for axes in grid[-1]:
        axes.set_xlabel("$x$ [m]")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=6)
    return figure


def snapshot_steps(t: Array, count: int) -> list[int]:
    """Return the steps nearest to ``count`` evenly spaced times, first and last among them."""
    times = np.linspace(t[0], t[-1], count)
    return sorted({int(np.abs(t - time).argmin()) for time in times})


def _paths(axes: Axes, w: Array, w_d: Array, vertical: int) -> None:
    axes.plot(w_d[:, 0], w_d[:, vertical], "--", color=style.REFERENCE, linewidth=0.8, zorder=1.5)
    axes.plot(w[:, 0], w[:, vertical], color=style.ORANGE, linewidth=1.0, zorder=4)


def draw_from_above(axes: Axes, robot: RobotConfig, q: Array) -> None:
    """Draw links and wheels at a posture q, (n + 5,), seen from above."""
    chain = link_points(robot, q)
    radius = robot.wheel_radius_m
    for link, pair in zip(robot.wheeled_links, wheel_contacts(geometry(robot, q)), strict=True):
        along = chain[link - 1, :2] - chain[link, :2]
        along *= radius / np.hypot(*along)
        for contact in pair:
            axes.plot(*np.stack((contact - along, contact + along)).T, color="#222222", lw=1.8)
        axes.plot(*pair.T, color="#888888", lw=0.8)
    _chain(axes, robot, chain[:, :2])


def _from_above(axes: Axes, robot: RobotConfig, q: Array) -> None:
    stand = support(geometry(robot, q))
    axes.add_patch(
        Polygon(stand.polygon, facecolor=f"{style.GREEN}26", edgecolor=style.GREEN, linewidth=0.7)
    )
    draw_from_above(axes, robot, q)
    axes.plot(*stand.center_of_mass, "P", color=style.PURPLE, markersize=6, zorder=5)


def _from_the_side(axes: Axes, robot: RobotConfig, chain: Array) -> None:
    axes.axhline(0.0, color="#888888", linewidth=0.9)
    _chain(axes, robot, chain[:, [0, 2]])


def _chain(axes: Axes, robot: RobotConfig, points: Array) -> None:
    base = robot.head_links
    axes.plot(*points[base:].T, "-o", color=style.BLUE, markersize=2.6, linewidth=1.8)
    axes.plot(*points[: base + 1].T, "-o", color=style.VERMILION, markersize=2.6, linewidth=1.8)
    axes.plot(*points[0], "o", color=style.VERMILION, markersize=5.0)


def _legend() -> list[Line2D]:
    return [
        Line2D([], [], color=style.VERMILION, marker="o", markersize=4, label="head part"),
        Line2D([], [], color=style.BLUE, marker="o", markersize=3, label="base part"),
        Line2D([], [], color="#222222", linewidth=2, label="wheels"),
        Line2D(
            [],
            [],
            color=style.PURPLE,
            marker="P",
            linestyle="",
            label="$P_G$ in the support polygon",
        ),
        Line2D([], [], color=style.ORANGE, label="path of the head"),
        Line2D([], [], color=style.REFERENCE, linestyle="--", label="wanted path"),
    ]
