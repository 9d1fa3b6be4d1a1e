"""Tries every admissible choice of SCPs of a robot in lockstep and ranks them; no ROS.

ros2 run snake_control scp_study --params-file config/paper_robot.yaml --out out/study
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from snake_control.cli.checked import natural, positive
from snake_control.config import Config, load
from snake_control.errors import SnakeError
from snake_control.experiment.cases import config_directory
from snake_control.experiment.study.candidates import Candidate, admissible, sample
from snake_control.experiment.study.figure import draw
from snake_control.experiment.study.ranking import (
    format_ranking,
    ranking,
    verdict,
    write_csv,
)
from snake_control.experiment.study.store import OutcomeStore
from snake_control.experiment.study.trajectories import (
    StudyTrajectory,
    built_in,
    read_trajectories,
)
from snake_control.experiment.study.trial import Outcome, Trial
from snake_control.experiment.study.workers import run_in_processes, run_on_dask

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the study; return its exit code.

    0: done; 1: a trial or the cluster failed; 2: bad arguments or configuration; 130: Ctrl-C (what
    was done is kept, and the next call goes on from there).
    """
    given = _parser().parse_args(argv)
    try:
        config = load(*(given.params_file or [config_directory() / "paper_robot.yaml"]))
        trials = _trials(config, given)
        given.out.mkdir(parents=True, exist_ok=True)
        store_path = given.out / "outcomes.jsonl"
        if given.fresh:
            store_path.unlink(missing_ok=True)
        store = OutcomeStore(store_path)
    except (SnakeError, OSError) as error:
        print(f"scp_study: {error}", file=sys.stderr)
        return EXIT_USAGE
    chosen = Candidate.of(config.robot)
    try:
        _run(trials, store, given)
        code = EXIT_OK
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on from here", file=sys.stderr)
        code = EXIT_INTERRUPTED
    except (SnakeError, OSError) as error:
        print(f"scp_study: {error}", file=sys.stderr)
        return EXIT_FAILED
    outcomes = _complete(trials, store)
    if outcomes:
        _write_results(outcomes, chosen, given.out)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="scp_study", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--params-file",
        type=Path,
        action="append",
        metavar="F",
        help="the robot and its controller, later files win; default: the paper's",
    )
    parser.add_argument("--out", type=Path, default=Path("out/study"), metavar="DIR")
    parser.add_argument(
        "--trajectories",
        type=Path,
        metavar="F",
        help="YAML file of head trajectories; default: a line, a faster rising line, an arc",
    )
    parser.add_argument("--duration", type=positive, default=60.0, metavar="S", help="of each run")
    parser.add_argument(
        "--dt", type=positive, default=0.02, metavar="S", help="control and plant step"
    )
    parser.add_argument(
        "--wheelless",
        type=natural,
        nargs="+",
        metavar="COUNT",
        help="only sets of so many wheelless links; default: all",
    )
    parser.add_argument(
        "--sample",
        type=natural,
        metavar="N",
        help="try N choices drawn at random (and the configured one), not all",
    )
    parser.add_argument("--seed", type=natural, default=0, metavar="N", help="of the sample")
    parser.add_argument(
        "--workers", type=natural, default=os.cpu_count() or 1, metavar="N", help="processes"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on this Dask cluster, such as tcp://host:8786"
    )
    parser.add_argument(
        "--fresh", action="store_true", help="forget outcomes of earlier calls in --out"
    )
    return parser


def _trials(config: Config, given: argparse.Namespace) -> list[Trial]:
    trajectories: list[StudyTrajectory] = (
        read_trajectories(given.trajectories) if given.trajectories else built_in(config.robot)
    )
    candidates = admissible(config.robot, given.wheelless)
    if given.sample is not None:
        drawn = set(sample(candidates, given.sample, given.seed))
        # The question is how good the configured choice is.
        drawn.add(Candidate.of(config.robot))
        candidates = sorted(drawn)
    return [
        Trial(config.robot, config.controller, candidate, trajectory, given.duration, given.dt)
        for candidate in candidates
        for trajectory in trajectories
    ]


def _run(trials: Sequence[Trial], store: OutcomeStore, given: argparse.Namespace) -> None:
    missing = [trial for trial in trials if trial.key not in store]
    kept = len(trials) - len(missing)
    names = len({trial.trajectory.name for trial in trials})
    print(
        f"{len(trials) // names} choices of SCPs on {names} trajectories of "
        f"{given.duration:g} s: {len(trials)} runs, {kept} of them done before"
    )
    if not missing:
        return
    done = (
        run_on_dask(missing, given.scheduler)
        if given.scheduler
        else run_in_processes(missing, max(1, given.workers))
    )
    with tqdm(total=len(trials), initial=kept, desc="runs", mininterval=1.0) as progress:
        for trial, outcome in done:
            store.add(trial.key, outcome)
            progress.update()


def _complete(trials: Sequence[Trial], store: OutcomeStore) -> list[Outcome]:
    """Return the outcomes of all choices that have run on every trajectory."""
    of: dict[Candidate, list[Trial]] = {}
    for trial in trials:
        of.setdefault(trial.candidate, []).append(trial)
    return [
        store[trial.key]
        for runs in of.values()
        if all(run.key in store for run in runs)
        for trial in runs
    ]


def _write_results(outcomes: Sequence[Outcome], chosen: Candidate, out: Path) -> None:
    rows = ranking(outcomes)
    text = f"{format_ranking(rows, chosen)}\n\n{verdict(rows, chosen)}\n"
    (out / "ranking.txt").write_text(text, encoding="utf-8")
    write_csv(rows, out / "ranking.csv")
    draw(rows, chosen, out / "ranking.png")
    print(f"\n{text}")
    for name in ("ranking.txt", "ranking.csv", "ranking.png", "outcomes.jsonl"):
        print(out / name)


if __name__ == "__main__":
    sys.exit(main())
