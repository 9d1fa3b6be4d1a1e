"""Faults planted in robots that are watched: which are named, how soon, and what is named wrongly.

``python -m pose_watch.campaign`` (with ``.`` and ``test`` on ``PYTHONPATH``) tries every joint's
direction, swapped joints, marker offsets and slip, on several robots and seeds, and robots with
nothing wrong for long. It writes out/pose_watch.md and out/pose_watch.json.
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import json
import statistics
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from snake_control.config import Config, load
from snake_control.control.pose_hypotheses import Cause, Hypotheses
from snake_control.experiment.cases import config_directory
from snake_control.mock.motion_capture import Noise
from support.experiments import LONG_ROBOT
from support.watched_robot import Planted, watched_run

ROBOTS = ("paper, case 3", "paper, scale_free", "long robot", "planar snake")
OFFSET_M = 0.02


@dataclasses.dataclass(frozen=True)
class Trial:
    """One run.

    Attributes:
        robot: one of ``ROBOTS``.
        kind: row of the table.
        expected: what should be named.
        joints: joints that should be named.
        planted: what is wrong.
        seed: of noise and start posture.
        duration_s: of the run [s].
        noise: of the poses: [m], [rad].
        moves: whether the robot does.
    """

    robot: str
    kind: str
    expected: Cause
    joints: tuple[int, ...]
    planted: Planted
    seed: int
    duration_s: float
    noise: tuple[float, float] = (0.0005, 0.002)
    moves: bool = True


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What was named in a run: first, when, and whatever else later."""

    trial: Trial
    cause: Cause
    joints: tuple[int, ...]
    named_s: float
    others: tuple[str, ...]
    residual: float
    offset_m: tuple[float, float, float]

    @property
    def right(self) -> bool:
        """Whether the right thing and nothing else was named."""
        same = (self.cause, self.joints) == (self.trial.expected, self.trial.joints)
        return same and not self.others

    @property
    def label(self) -> str:
        """What was named, as a column of the table; other joints than planted count apart."""
        if self.others:
            return "changed"
        if self.cause is self.trial.expected and self.joints != self.trial.joints:
            return f"{self.cause.value}, other joints"
        return self.cause.value


def robot_config(robot: str) -> Config:
    """Return the configuration of a robot."""
    directory = config_directory()
    if robot == "planar snake":
        return load(directory / "planar_snake.yaml")
    config = load(directory / "paper_robot.yaml", directory / "case_3.yaml")
    if robot == "paper, scale_free":
        return load(directory / "paper_robot.yaml", directory / "scale_free.yaml")
    if robot == "long robot":
        scale_free = load(directory / "paper_robot.yaml", directory / "scale_free.yaml")
        return dataclasses.replace(config, robot=LONG_ROBOT, controller=scale_free.controller)
    return config


def trials(robot: str, seeds: Sequence[int], duration_s: float, long_s: float) -> Iterator[Trial]:
    """Return all runs of one robot."""
    own = robot_config(robot).robot
    wheels = len(own.wheeled_links)

    def trial(kind: str, expected: Cause, planted: Planted, seed: int, **more: object) -> Trial:
        joints = planted.swapped or ((planted.flipped,) if planted.flipped else ())
        made = Trial(robot, kind, expected, joints, planted, seed, duration_s)
        return dataclasses.replace(made, **more)  # type: ignore[arg-type]

    nothing, slip = Cause.NOTHING, Cause.WHEEL_SLIP
    for seed in seeds:
        yield trial("nothing", nothing, Planted(), seed, duration_s=long_s)
        yield trial("at rest", nothing, Planted(), seed, duration_s=long_s, moves=False)
        noisy = (0.003, 0.015)
        yield trial("noisy pose", nothing, Planted(), seed, duration_s=long_s, noise=noisy)
        yield trial(
            "noisy, at rest", nothing, Planted(), seed, duration_s=long_s, noise=noisy, moves=False
        )
        slight = Planted(
            slip=tuple((wheel, 0.1) for wheel in range(wheels)), zeros_rad=0.005, early_s=0.01
        )
        yield trial("imperfect", nothing, slight, seed, duration_s=long_s)
        for hypothesis in Hypotheses(own).each[1:]:
            if hypothesis.cause is Cause.WRONG_DIRECTION:
                wrong = Planted(flipped=hypothesis.joints[0])
                yield trial("direction", hypothesis.cause, wrong, seed)
                continue
            a, b = hypothesis.joints
            yield trial("swap", hypothesis.cause, Planted(swapped=(a, b)), seed)
        # A marker above or below does not move otherwise than one on a snake that lies flat.
        for axis in range(2 if own.planar else 3):
            for sign in (-1.0, 1.0):
                offset = [0.0, 0.0, 0.0]
                offset[axis] = sign * OFFSET_M
                planted = Planted(offset=(offset[0], offset[1], offset[2]))
                yield trial(f"offset {'xyz'[axis]}", Cause.WRONG_MARKER_OFFSET, planted, seed)
        half = tuple((wheel, 0.5) for wheel in range(0, wheels, 2))
        yield trial("slip", slip, Planted(slip=half), seed, duration_s=2 * duration_s)
        later = Planted(skid_m_s=0.02, slips_from_s=10.0)
        yield trial("skid", slip, later, seed, duration_s=2 * duration_s)


def run(trial: Trial) -> Outcome:
    """Run one trial."""
    config = robot_config(trial.robot)
    named: list[tuple[Cause, tuple[int, ...]]] = []
    named_s, residual, offset = float("nan"), float("nan"), (0.0, 0.0, 0.0)
    for at in watched_run(
        config,
        trial.duration_s,
        trial.seed,
        trial.planted,
        noise=Noise(*trial.noise),
        moves=trial.moves,
    ):
        verdict = at.verdict
        residual = verdict.residual
        if verdict.cause is not Cause.NOTHING:
            offset = verdict.marker_offset_m
            if (verdict.cause, verdict.joints) not in named:
                named.append((verdict.cause, verdict.joints))
                named_s = at.t if len(named) == 1 else named_s
    cause, joints = named[0] if named else (Cause.NOTHING, ())
    others = tuple(f"{each.value} {list(which)}" for each, which in named[1:])
    return Outcome(trial, cause, joints, named_s, others, residual, offset)


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the confusion table of one robot in Markdown."""
    kinds = list(dict.fromkeys(outcome.trial.kind for outcome in outcomes))
    lines = [
        "| planted | runs | named right | named after: median, longest [s] | otherwise |",
        "|---|---|---|---|---|",
    ]
    for kind in kinds:
        those = [outcome for outcome in outcomes if outcome.trial.kind == kind]
        right = [outcome for outcome in those if outcome.right]
        late = [outcome.named_s - outcome.trial.planted.slips_from_s for outcome in right]
        times = (
            ""
            if (right and right[0].cause is Cause.NOTHING) or not right
            else (f"{statistics.median(late):.1f}, {max(late):.1f}")
        )
        wrong = collections.Counter(outcome.label for outcome in those if not outcome.right)
        otherwise = ", ".join(f"{label} {count}" for label, count in wrong.items())
        lines.append(f"| {kind} | {len(those)} | {len(right)} | {times} | {otherwise} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=ROBOTS)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration-s", type=float, default=20.0)
    parser.add_argument("--long-s", type=float, default=120.0)
    parser.add_argument("--kinds", nargs="+", default=[])
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out"))
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    sections, rows = [], []
    with ProcessPoolExecutor(given.processes) as pool:
        for robot in given.robots:
            todo = [
                trial
                for trial in trials(robot, range(given.seeds), given.duration_s, given.long_s)
                if not given.kinds or trial.kind in given.kinds
            ]
            outcomes = list(pool.map(run, todo, chunksize=4))
            sections.append(f"## {robot}\n\n{table(outcomes)}\n")
            print(sections[-1], flush=True)
            for outcome in outcomes:
                trial = outcome.trial
                row = {
                    "robot": robot,
                    "kind": trial.kind,
                    "seed": trial.seed,
                    "planted": dataclasses.asdict(trial.planted),
                    "named": outcome.cause.value,
                    "joints": outcome.joints,
                    "named_s": outcome.named_s,
                    "others": outcome.others,
                    "residual": outcome.residual,
                    "offset_m": outcome.offset_m,
                    "right": outcome.right,
                }
                rows.append(row)
                if not outcome.right:
                    print(json.dumps(row), flush=True)
    (given.out / "pose_watch.md").write_text("\n".join(sections))
    (given.out / "pose_watch.json").write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
