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
        failed: how many trajectories could not be run to their end.
        falls: on how many the robot fell.
        lost: on how many others the head lost its reference (``LOST_M``); ``None`` where tracking
            is not judged.
        singular: on how many it came nearer to a singular shape than ``SINGULAR_ABOVE``.
        position_error_rms_m, rotation_error_rms_rad, worst_singularity, min_d_min_m,
        peak_speed_rad_s, range_steps: as in ``Outcome``.
        mean_place: mean place (1 is best) in tracking (where it is judged), singularity, d_min and
            peak speed.
        failure: why the first of those that failed did.
    """

    rank: int
    candidate: Candidate
    failed: int
    falls: int
    lost: int | None
    singular: int
    position_error_rms_m: float
    rotation_error_rms_rad: float
    worst_singularity: float
    min_d_min_m: float
    peak_speed_rad_s: float
    range_steps: float
    mean_place: float
    failure: str | None = None

    @property
    def sound(self) -> bool:
        """Whether nothing of what is counted happened."""
        return not (self.failed or self.falls or self.lost or self.singular)


def ranking(outcomes: Iterable[Outcome], judge_tracking: bool = True) -> list[Ranked]:
    """Rank choices: fewest failed runs first, then falls, lost references, singular shapes.

    Among equals the mean place decides: it weighs tracking, distance from singular shapes, margin
    against falling and joint speed alike, without mixing their units.

    Args:
        outcomes: all trajectories of each choice.
        judge_tracking: whether the errors count; not where runs ended before they had settled.
    """
    of: dict[Candidate, list[Outcome]] = {}
    for outcome in outcomes:
        of.setdefault(outcome.candidate, []).append(outcome)
    if not of:
        return []
    worst = [_worst(candidate, runs, judge_tracking) for candidate, runs in of.items()]
    merits = [
        [row.worst_singularity for row in worst],
        [-row.min_d_min_m for row in worst],
        [row.peak_speed_rad_s for row in worst],
    ]
    if judge_tracking:
        merits.append([row.position_error_rms_m for row in worst])
    places = np.mean([_places(merit) for merit in merits], axis=0)
    rows = [
        dataclasses.replace(row, mean_place=float(place))
        for row, place in zip(worst, places, strict=True)
    ]
    rows.sort(key=_order)
    return [dataclasses.replace(row, rank=i) for i, row in enumerate(rows, start=1)]


def _order(row: Ranked) -> tuple[int, int, int, int, float, Candidate]:
    return row.failed, row.falls, row.lost or 0, row.singular, row.mean_place, row.candidate


def _worst(candidate: Candidate, runs: Sequence[Outcome], judge_tracking: bool) -> Ranked:
    whole = [run for run in runs if run.failed is None]
    lost = sum(run.position_error_rms_m > LOST_M for run in whole if not run.fell)
    return Ranked(
        rank=0,
        candidate=candidate,
        failed=len(runs) - len(whole),
        falls=sum(run.fell for run in runs),
        lost=lost if judge_tracking else None,
        singular=sum(run.worst_singularity > SINGULAR_ABOVE for run in runs),
        position_error_rms_m=max(run.position_error_rms_m for run in runs),
        rotation_error_rms_rad=max(run.rotation_error_rms_rad for run in runs),
        worst_singularity=max(run.worst_singularity for run in runs),
        min_d_min_m=min(run.min_d_min_m for run in runs),
        peak_speed_rad_s=max(run.peak_speed_rad_s for run in runs),
        range_steps=max(run.range_steps for run in runs),
        mean_place=0.0,
        failure=next((f"{r.trajectory}, {r.failed}" for r in runs if r.failed is not None), None),
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
    # A column that is there when it is needed: the others fill 80 characters.
    failed = any(row.failed for row in rows)
    lines = [_HEADER + (f"{'failed':>8}" if failed else ""), _UNITS]
    for row in rows:
        if row.rank <= most or row.candidate == chosen:
            if row.rank > most + 1 and row.candidate == chosen:
                lines.append("  ..")
            line = _line(row, "*" if row.candidate == chosen else " ")
            lines.append(line + (f"{row.failed:>8}" if failed else ""))
    return "\n".join(lines)


def _line(row: Ranked, mark: str) -> str:
    links = " ".join(map(str, row.candidate.wheelless_links)) or "none"
    joints = " ".join(map(str, row.candidate.head_scp_joints)) or "none"
    lost, tracking = str(row.lost), f"{1e3 * row.position_error_rms_m:.2f}"
    if row.lost is None:
        lost = tracking = "-"
    return (
        f"{row.rank:>4}{mark} {links:12}{joints:>7}{row.falls:>6}{lost:>5}{row.singular:>6}"
        f"{tracking:>9}{row.worst_singularity:>9.3f}"
        f"{1e3 * row.min_d_min_m:>6.1f}{row.peak_speed_rad_s:>8.2f}{100 * row.range_steps:>6.1f}"
    )


def verdict(rows: Sequence[Ranked], chosen: Candidate) -> str:
    """Say in a few sentences how good the robot's own choice is among all, and what failed."""
    own = next((row for row in rows if row.candidate == chosen), None)
    if own is None:
        return f"The configured choice ({chosen}) was not among those tried.{_failures(rows)}"
    count = f"{sum(row.sound for row in rows)} of {len(rows)} choices neither fell, "
    if own.lost is None:
        count += "nor came near a singular shape (tracking is not judged)"
    else:
        count += "nor lost their reference, nor came near a singular shape"
    if own.failed:
        how = f"could not be run to the end on {own.failed} of the trajectories"
    elif own.falls:
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
        f"{count}. The configured choice ({chosen}) {how} and ranks "
        f"{own.rank} of {len(rows)}; {first}.{_failures(rows)}"
    )


def _failures(rows: Sequence[Ranked]) -> str:
    failed = [row for row in rows if row.failed]
    if not failed:
        return ""
    first = failed[0]
    return (
        f"\nFailed runs: {sum(row.failed for row in failed)}, such as {first.candidate}: "
        f"{first.failure}"
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
