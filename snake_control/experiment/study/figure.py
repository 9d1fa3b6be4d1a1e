"""The study's picture: every choice by its four figures, the robot's own marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.style import context

from snake_control.experiment import style
from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.ranking import Ranked

_COLORS = {
    "stood and followed": style.BLUE,
    "came near a singular shape": style.PURPLE,
    "lost its reference": style.ORANGE,
    "fell": style.VERMILION,
    "failed": style.SKY_BLUE,
}


def draw(rows: Sequence[Ranked], chosen: Candidate, path: Path) -> None:
    """Draw tracking over safety: against falling, and against singular shapes.

    Raises:
        OSError: the file cannot be written.
    """
    with context(style.RC):
        figure = Figure(figsize=(9.5, 4.6))
        figure.suptitle(f"Choice of SCPs: {len(rows)} robots, the worst of all trajectories")
        left, right = figure.subplots(1, 2, sharey=True)
        tracking = np.array([1e3 * row.position_error_rms_m for row in rows])
        # A robot that fell before the last third has no error; it belongs to the worst.
        worst = tracking[np.isfinite(tracking)].max(initial=1.0)
        tracking = np.where(np.isfinite(tracking), tracking, worst)
        d_min = np.array([1e3 * row.min_d_min_m for row in rows])
        singular = np.array([row.worst_singularity for row in rows])
        _scatter(left, d_min, tracking, rows, chosen)
        _scatter(right, singular, tracking, rows, chosen)
        left.set_xlabel("least $d_{min}$ [mm] (more is safer)")
        right.set_xlabel("nearest to a singular shape, 0..1 (less is safer)")
        settled = all(row.lost is not None for row in rows)
        left.set_ylabel("tracking error [mm rms]" + ("" if settled else ", not settled"))
        left.set_yscale("log")
        right.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        figure.savefig(path)


def _scatter(
    axes: Axes,
    x: np.ndarray,
    y: np.ndarray,
    rows: Sequence[Ranked],
    chosen: Candidate,
) -> None:
    kinds = np.array([_kind(row) for row in rows])
    for kind, color in _COLORS.items():
        of_kind = kinds == kind
        if of_kind.any():
            axes.scatter(
                x[of_kind], y[of_kind], s=22, color=color, alpha=0.75, linewidths=0, label=kind
            )
    for row, px, py in zip(rows, x, y, strict=True):
        if row.candidate == chosen:
            axes.scatter(
                [px], [py], s=150, marker="*", color=style.BLACK, zorder=3, label="configured"
            )
        elif row.rank == 1:
            axes.scatter(
                [px],
                [py],
                s=80,
                facecolors="none",
                edgecolors=style.GREEN,
                linewidths=1.6,
                zorder=3,
                label="ranked first",
            )


def _kind(row: Ranked) -> str:
    if row.failed:
        return "failed"
    if row.falls:
        return "fell"
    if row.lost:
        return "lost its reference"
    return "came near a singular shape" if row.singular else "stood and followed"
