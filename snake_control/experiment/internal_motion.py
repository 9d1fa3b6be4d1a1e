"""The internal motion (4)-(6) in a picture: the head stands still while the body moves."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.style import context
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.experiment import style
from snake_control.experiment.motion import draw_from_above
from snake_control.experiment.series import pose_error
from snake_control.model.geometry import geometry, link_points
from snake_control.model.internal_motion import internal_motion_basis
from snake_control.model.redundancy import kinematics
from snake_control.plant.kinematic import KinematicPlant
from snake_control.plant.plant import PlantState

Array = NDArray[np.float64]

PHASES_RAD = (-0.3, -0.15, 0.0, 0.15, 0.3)
"""How far the SCP is turned from where it starts, in the rows of the picture."""
_STEP_RAD = 0.002
_TURNED_RAD = 1e-6
_GHOST = "#BBBBBB"


@dataclasses.dataclass(frozen=True, eq=False)
class InternalMotion:
    """What one internal motion does.

    Attributes:
        joint: the SCP that drives it, counted from 1.
        q: posture at each phase, (phases, n + 5) [m, rad].
        head_moved: largest change of each component of w, (6,) [m, rad].
        body_moved_m: largest way of any link's end [m].
        joints: joints that turned, counted from 1.
    """

    joint: int
    q: Array
    head_moved: Array
    body_moved_m: float
    joints: tuple[int, ...]


def internal_motions(
    robot: RobotConfig, phi: ArrayLike | None = None, phases: ArrayLike = PHASES_RAD
) -> list[InternalMotion]:
    """Let the plant go through each internal motion alone, from a posture both ways.

    Args:
        robot: the robot.
        phi: joint angles at phase 0, (n-1,) [rad]; by default where the experiment starts.
        phases: turns of the driving SCP, rising, 0 among them [rad].
    """
    start = np.array(robot.start_joint_angles_rad if phi is None else phi, dtype=float)
    phases = np.asarray(phases, dtype=float)
    return [
        _motion(robot, start, column, joint, phases)
        for column, joint in enumerate(robot.scp_joints)
    ]


def _motion(
    robot: RobotConfig, start: Array, column: int, joint: int, phases: Array
) -> InternalMotion:
    down = _states(robot, start, column, phases[phases <= 0][::-1])
    up = _states(robot, start, column, phases[phases > 0])
    q = np.array([np.concatenate((state.w, state.phi)) for state in (*down[::-1], *up)])
    still = KinematicPlant(robot).reset(start)
    home = np.concatenate((still.w, still.phi))
    points = np.array([link_points(robot, each) for each in q]) - link_points(robot, home)
    turned = np.abs(q[:, 6:] - start).max(axis=0)
    return InternalMotion(
        joint=joint,
        q=q,
        head_moved=np.abs(pose_error(q[:, :6], home[:6])).max(axis=0),
        body_moved_m=float(np.linalg.norm(points, axis=2).max()),
        joints=tuple(int(j) + 1 for j in np.flatnonzero(turned > _TURNED_RAD)),
    )


def _states(robot: RobotConfig, start: Array, column: int, angles: Array) -> list[PlantState]:
    """Turn one SCP from ``start`` to each angle in turn; the plant decides where the head goes."""
    plant = KinematicPlant(robot)
    state, turned, states = plant.reset(start), 0.0, []
    for angle in angles:
        steps = max(1, round(abs(angle - turned) / _STEP_RAD))
        dt = (angle - turned) / steps
        for _ in range(steps):
            # Midpoint rule: N at the posture half a step on.
            middle = state.phi + 0.5 * dt * _column(robot, state.w, state.phi, column)
            state = plant.step(_column(robot, state.w, middle, column), dt)
        turned = angle
        states.append(state)
    return states


def _column(robot: RobotConfig, w: Array, phi: Array, column: int) -> Array:
    k = kinematics(geometry(robot, np.concatenate((w, phi))))
    return internal_motion_basis(k)[:, column]


def draw(motions: list[InternalMotion], robot: RobotConfig) -> Figure:
    """Draw one column for each internal motion, one row for each phase, all from above.

    A last row shows all phases from the side.
    """
    phases = len(motions[0].q)
    everything = np.vstack([link_points(robot, q) for m in motions for q in m.q])
    low, high = everything.min(axis=0) - 0.05, everything.max(axis=0) + 0.05
    low[2] = -0.02
    heights = [high[1] - low[1]] * phases + [high[2] - low[2]]
    width = 2.9
    scale = width / (high[0] - low[0])
    figure = Figure(
        figsize=(width * len(motions) + 0.6, scale * sum(heights) + 0.12 * phases + 1.5)
    )
    figure.suptitle("Internal motion: the head stands still, the body moves")
    grid = figure.subplots(
        phases + 1,
        len(motions),
        sharex=True,
        sharey="row",
        squeeze=False,
        gridspec_kw={"height_ratios": heights},
    )
    middle = phases // 2
    for column, motion in zip(grid.T, motions, strict=True):
        ghost = link_points(robot, motion.q[middle])
        for axes, q in zip(column, motion.q, strict=False):
            axes.plot(*ghost[:, :2].T, color=_GHOST, linewidth=1.2, zorder=1.6)
            draw_from_above(axes, robot, q)
            _mark(axes, robot, motion.joint, q, 1)
        for q in motion.q:
            _from_the_side(column[-1], robot, q, ghost)
        _mark(column[-1], robot, motion.joint, motion.q[-1], 2)
        for axes, vertical in zip(column, [1] * phases + [2], strict=True):
            axes.set_aspect("equal")
            axes.set_xlim(low[0], high[0])
            axes.set_ylim(low[vertical], high[vertical])
        kind = "H-SCP" if motion.joint in robot.head_scp_joints else "B-SCP"
        column[0].set_title(rf"{kind} $\phi_{{{motion.joint}}}$")
        column[-1].set_xlabel("$x$ [m]")
    for axes, q in zip(grid[:, 0], motions[0].q, strict=False):
        joint = motions[0].joint
        turn = round(np.rad2deg(q[5 + joint] - motions[0].q[middle][5 + joint]))
        axes.set_ylabel(f"{turn:+d}°\n$y$ [m]" if turn else "start\n$y$ [m]")
    grid[-1][0].set_ylabel("all, side\n$z$ [m]")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=5)
    return figure


def describe(motion: InternalMotion) -> str:
    """Return one line on a motion, with numbers."""
    position, rotation = motion.head_moved[:3].max(), motion.head_moved[3:].max()
    joints = ", ".join(map(str, motion.joints))
    return (
        f"phi_{motion.joint}: turns joints {joints}; the body moves by up to "
        f"{1e3 * motion.body_moved_m:.0f} mm, the head by {position:.1e} m and {rotation:.1e} rad"
    )


def save(motions: list[InternalMotion], robot: RobotConfig, path: Path) -> None:
    """Write the picture as a PNG file.

    Raises:
        OSError: it cannot be written.
    """
    with context(style.RC):
        draw(motions, robot).savefig(path, dpi=110)


def _from_the_side(axes: Axes, robot: RobotConfig, q: Array, ghost: Array) -> None:
    points = link_points(robot, q)
    head = robot.head_links + 1
    moved = not np.allclose(points[:head], ghost[:head], atol=1e-3)
    axes.axhline(0.0, color="#888888", linewidth=0.9)
    axes.plot(*points[head - 1 :, [0, 2]].T, color=style.BLUE, linewidth=1.2)
    color = style.ORANGE if moved else style.VERMILION
    axes.plot(*points[:head, [0, 2]].T, "-o", color=color, markersize=2.6, linewidth=1.4)
    axes.plot(*points[0, [0, 2]], "o", color=style.VERMILION, markersize=5.0, zorder=5)


def _mark(axes: Axes, robot: RobotConfig, joint: int, q: Array, vertical: int) -> None:
    x, y = link_points(robot, q)[joint, [0, vertical]]
    axes.plot(x, y, "o", markersize=7, markerfacecolor="none", color=style.PURPLE, zorder=6)


def _legend() -> list[Line2D]:
    return [
        Line2D([], [], color=style.VERMILION, marker="o", markersize=4, label="head part"),
        Line2D([], [], color=style.BLUE, marker="o", markersize=3, label="base part"),
        Line2D([], [], color="#222222", linewidth=2, label="wheels"),
        Line2D([], [], color=_GHOST, linewidth=1.4, label="start"),
        Line2D(
            [],
            [],
            color=style.PURPLE,
            marker="o",
            markerfacecolor="none",
            linestyle="",
            label="the SCP that turns",
        ),
    ]
