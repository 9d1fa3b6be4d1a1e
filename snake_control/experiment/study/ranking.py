"""Ranks the choices of SCPs by what came of them over all trajectories."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.trial import Outcome
from snake_control.model.singular_shape import SINGULAR_ABOVE

LOST_M = 0.02
"""A head further than this from its reference (root mean square, last third) has lost it."""


@dataclasses.dataclass(frozen=True)
class Ranked:
    """One choice over all trajectories; each figure is the worst of them.

    Attributes:
        rank: 1 is the best.
        candidate: the choice.
        falls: on how many trajectories the robot fell.
        lost: on how many others the head lost its reference (``LOST_M``).
        singular: on how many it came nearer to a singular shape than ``SINGULAR_ABOVE``.
        position_error_rms_m, rotation_error_rms_rad, worst_singularity, min_d_min_m,
        peak_speed_rad_s, range_steps: as in ``Outcome``.
        mean_place: mean place (1 is best) in tracking, singularity, d_min and peak speed.
    """

    rank: int
    candidate: Candidate
    falls: int
    lost: int
    singular: int
    position_error_rms_m: float
    rotation_error_rms_rad: float
    worst_singularity: float
    min_d_min_m: float
    peak_speed_rad_s: float
    range_steps: float
    mean_place: float


def ranking(outcomes: Iterable[Outcome]) -> list[Ranked]:
    """Rank choices: fewest falls first, then fewest lost references, then fewest singular shapes.

    Among equals the mean place decides: it weighs tracking, distance from singular shapes, margin
    against falling and joint speed alike, without mixing their units.
    """
    of: dict[Candidate, list[Outcome]] = {}
    for outcome in outcomes:
        of.setdefault(outcome.candidate, []).append(outcome)
    if not of:
        return []
    worst = [_worst(candidate, runs) for candidate, runs in of.items()]
    places = np.mean(
        [
            _places([row.position_error_rms_m for row in worst]),
            _places([row.worst_singularity for row in worst]),
            _places([-row.min_d_min_m for row in worst]),
            _places([row.peak_speed_rad_s for row in worst]),
        ],
        axis=0,
    )
    rows = [
        dataclasses.replace(row, mean_place=float(place))
        for row, place in zip(worst, places, strict=True)
    ]
    rows.sort(key=lambda row: (row.falls, row.lost, row.singular, row.mean_place, row.candidate))
    return [dataclasses.replace(row, rank=i) for i, row in enumerate(rows, start=1)]


def _worst(candidate: Candidate, runs: Sequence[Outcome]) -> Ranked:
    return Ranked(
        rank=0,
        candidate=candidate,
        falls=sum(run.fell for run in runs),
        lost=sum(run.position_error_rms_m > LOST_M for run in runs if not run.fell),
        singular=sum(run.worst_singularity > SINGULAR_ABOVE for run in runs),
        position_error_rms_m=max(run.position_error_rms_m for run in runs),
        rotation_error_rms_rad=max(run.rotation_error_rms_rad for run in runs),
        worst_singularity=max(run.worst_singularity for run in runs),
        min_d_min_m=min(run.min_d_min_m for run in runs),
        peak_speed_rad_s=max(run.peak_speed_rad_s for run in runs),
        range_steps=max(run.range_steps for run in runs),
        mean_place=0.0,
    )


def _places(values: Sequence[float]) -> list[float]:
    """Return the place of each value, 1 for the least; equal values share the mean of theirs."""
    array = np.array(values)
    below = (array[None, :] < array[:, None]).sum(axis=1)
    equal = (array[None, :] == array[:, None]).sum(axis=1)
    return [float(place) for place in below + 0.5 * (equal + 1)]


_HEADER = (
    f"{'rank':>4}  {'wheelless':12}{'H-SCPs':>7}{'falls':>6}{'lost':>5}{'sing.':>6}"
    f"{'tracking':>9}{'nearness':>9}{'d_min':>6}{'speed':>8}{'ends':>6}"
)
_UNITS = (
    f"{'':4}  {'':12}{'':7}{'':6}{'':5}{'':6}{'[mm rms]':>9}{'[0..1]':>9}{'[mm]':>6}"
    f"{'[rad/s]':>8}{'[%]':>6}"
)


def format_ranking(rows: Sequence[Ranked], chosen: Candidate, most: int = 15) -> str:
    """Return the best choices and the robot's own as a table for people.

    Args:
        rows: as ``ranking`` returns them.
        chosen: the choice to mark with an asterisk, and to show wherever it stands.
        most: how many of the best.
    """
    lines = [_HEADER, _UNITS]
    for row in rows:
        if row.rank <= most or row.candidate == chosen:
            if row.rank > most + 1 and row.candidate == chosen:
                lines.append("  ..")
            lines.append(_line(row, "*" if row.candidate == chosen else " "))
    return "\n".join(lines)


def _line(row: Ranked, mark: str) -> str:
    links = " ".join(map(str, row.candidate.wheelless_links)) or "none"
    joints = " ".join(map(str, row.candidate.head_scp_joints)) or "none"
    return (
        f"{row.rank:>4}{mark} {links:12}{joints:>7}{row.falls:>6}{row.lost:>5}{row.singular:>6}"
        f"{1e3 * row.position_error_rms_m:>9.2f}{row.worst_singularity:>9.3f}"
        f"{1e3 * row.min_d_min_m:>6.1f}{row.peak_speed_rad_s:>8.2f}{100 * row.range_steps:>6.1f}"
    )


def verdict(rows: Sequence[Ranked], chosen: Candidate) -> str:
    """Say in one sentence how good the robot's own choice is among all."""
    own = next((row for row in rows if row.candidate == chosen), None)
    if own is None:
        return f"The configured choice ({chosen}) was not among those tried."
    safe = [row for row in rows if not (row.falls or row.lost or row.singular)]
    count = (
        f"{len(safe)} of {len(rows)} choices neither fell, nor lost their reference, nor came near "
        "a singular shape"
    )
    if own.falls:
        how = f"fell on {own.falls} of the trajectories"
    elif own.lost:
        how = f"lost its reference on {own.lost} of the trajectories"
    elif own.singular:
        how = f"came near a singular shape on {own.singular} of the trajectories"
    else:
        how = "did none of these"
    best = rows[0].candidate
    first = "it is the best" if best == chosen else f"the best is {best}"
    return (
        f"{count[0].upper()}{count[1:]}. The configured choice ({chosen}) {how} and ranks "
        f"{own.rank} of {len(rows)}; {first}."
    )


def write_csv(rows: Sequence[Ranked], path: Path) -> None:
    """Write the whole ranking.

    Raises:
        OSError: the file cannot be written.
    """
    names = [field.name for field in dataclasses.fields(Ranked) if field.name != "candidate"]
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["wheelless_links", "head_scp_joints", *names])
        for row in rows:
            links = " ".join(map(str, row.candidate.wheelless_links))
            joints = " ".join(map(str, row.candidate.head_scp_joints))
            writer.writerow([links, joints, *(getattr(row, name) for name in names)])
