"""Draws a moment of a recording as RViz shows it, from the markers in it, and the way there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from snake_control.experiment.recording import Recording, RecordingFileError

Array = NDArray[np.float64]

TOPICS = ("/markers", "/controller_state")
"""What has to be decoded."""

# Of ControllerState: tracking, limited, recovering.
_FOLLOWING = (2, 3, 8)
# Of visualization_msgs/Marker.
_ARROW, _CUBE, _SPHERE, _CYLINDER, _LINE_STRIP = 0, 1, 2, 3, 4
_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
_RIM = np.linspace(0.0, 2.0 * np.pi, 17)


def draw_recording(recording: Recording, at_s: float, path: Path) -> Path:
    """Draw the robot at a time, and error, V_b1 and d_min up to the end.

    Args:
        recording: with ``TOPICS`` decoded.
        at_s: time after the first step that follows a reference [s].
        path: picture to make.

    Raises:
        RecordingFileError: the recording has no markers or no control steps.
    """
    for name in TOPICS:
        if name not in recording.topics:
            raise RecordingFileError(f"no {name} in the recording")
    markers, states = (recording.topics[name] for name in TOPICS)
    following = [state.status in _FOLLOWING for state in states.messages]
    zero_ns = states.times_ns[following.index(True) if any(following) else 0]
    seconds = (np.array(states.times_ns) - zero_ns) * 1e-9
    moments = (np.array(markers.times_ns) - zero_ns) * 1e-9
    nearest = int(np.argmin(np.abs(moments - at_s)))
    figure = plt.figure(figsize=(11.0, 5.0), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.5, 1.0))
    _draw_scene(figure.add_subplot(grid[:, 0], projection="3d"), markers.messages[nearest].markers)
    error = np.array([state.error[:3] for state in states.messages])
    rows = (
        ("error [mm]", 1e3 * error, "linear"),
        ("V_b1", np.array([state.v_b1 for state in states.messages]), "log"),
        ("d_min [mm]", np.array([1e3 * state.d_min for state in states.messages]), "linear"),
    )
    for row, (label, values, scale) in enumerate(rows):
        axes = figure.add_subplot(grid[row, 1])
        lines = axes.plot(seconds, values, linewidth=1.0)
        if len(lines) == 3:
            axes.legend(lines, "xyz", loc="upper right", ncols=3, fontsize=8, frameon=False)
        axes.set_yscale(scale)
        axes.set_ylabel(label)
        axes.axvline(moments[nearest], color="0.5", linewidth=0.8)
    axes.set_xlabel("time since the reference began [s]")
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


def _draw_scene(axes: Any, markers: list[Any]) -> None:
    seen: list[Array] = []
    for marker in markers:
        color = (marker.color.r, marker.color.g, marker.color.b)
        position, rotation = _pose(marker)
        if marker.type == _CUBE:
            corners = position + rotation.apply(_CORNERS * _vector(marker.scale))
            faces = [corners[list(face)] for face in _FACES]
            axes.add_collection3d(Poly3DCollection(faces, facecolor=color, edgecolor="w", lw=0.3))
            seen.append(corners)
        elif marker.type == _CYLINDER:
            disc = 0.5 * marker.scale.x * np.column_stack((np.cos(_RIM), np.sin(_RIM), 0.0 * _RIM))
            rim = position + rotation.apply(disc)
            axes.add_collection3d(Poly3DCollection([rim], facecolor=color))
        elif marker.type in (_ARROW, _LINE_STRIP):
            points = np.array([_vector(point) for point in marker.points])
            axes.plot(*points.T, color=color, linewidth=2.0)
            seen.append(points)
        elif marker.type == _SPHERE:
            axes.scatter(*position, color=color, s=25)
        else:
            axes.set_title(marker.text, fontsize=9, color=color)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.tick_params(labelsize=7)
    axes.view_init(elev=22.0, azim=-60.0)
    if not seen:
        return
    low = np.min([points.min(axis=0) for points in seen], axis=0)
    high = np.max([points.max(axis=0) for points in seen], axis=0)
    # A snake is long: room at its sides, so that the floor is seen.
    side = 0.25 * (high - low).max()
    low[1], high[1] = low[1] - side, high[1] + side
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(0.0, high[2]))
    axes.set_box_aspect((*(high - low)[:2], high[2]))
    for axis in (axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))


def _pose(marker: Any) -> tuple[Array, Rotation]:
    q = marker.pose.orientation
    return _vector(marker.pose.position), Rotation.from_quat([q.x, q.y, q.z, q.w])


def _vector(value: Any) -> Array:
    return np.array([value.x, value.y, value.z])
