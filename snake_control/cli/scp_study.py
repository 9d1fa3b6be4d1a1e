"""Tries every admissible choice of SCPs of a robot in lockstep and ranks them; no ROS.

ros2 run snake_control scp_study --params-file config/paper_robot.yaml --out out/study
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from tqdm import tqdm

from snake_control.cli.checked import counting, natural, network_address, positive
from snake_control.cli.common import (
    EXIT_FAILED,
    EXIT_OK,
    EXIT_USAGE,
    add_params_file,
    ending_signals,
)
from snake_control.config import Config, load
from snake_control.control.scp_controller import ScpController
from snake_control.errors import SnakeError
from snake_control.experiment.cases import config_directory
from snake_control.experiment.study.candidates import Candidate, admissible, sample
from snake_control.experiment.study.figure import draw
from snake_control.experiment.study.gains import gains_text, scale_free
from snake_control.experiment.study.ranking import (
    Ranked,
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
from snake_control.experiment.study.trial import Outcome, Trial, settled_from_s, transient_s
from snake_control.experiment.study.workers import run_in_processes, run_on_dask

# Fewer steps than this show nothing of a motion.
_LEAST_STEPS = 10


def main(argv: Sequence[str] | None = None) -> int:
    """Run the study; return its exit code.

    0: done; 1: some run failed (the others are ranked), or the cluster did; 2: bad arguments or
    configuration; 130, 143: SIGINT, SIGTERM (what was done is kept, and the next call goes on from
    there).
    """
    given = _parsed(argv)
    try:
        config = _config(given)
        trials = _trials(config, given)
        given.out.mkdir(parents=True, exist_ok=True)
        store_path = given.out / "outcomes.jsonl"
        if given.fresh:
            store_path.unlink(missing_ok=True)
        store = OutcomeStore(store_path)
    except (SnakeError, OSError) as error:
        print(f"scp_study: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_USAGE
    chosen = Candidate.of(config.robot)
    print(f"gains: {gains_text(config.controller)}")
    settled = _says_settled(config, given.duration)
    try:
        # Also where whoever started this process has it ignore Ctrl-C, as shells do in scripts.
        with ending_signals(_stop):
            _run(trials, store, given)
        code = EXIT_OK
    except KeyboardInterrupt as stop:
        print("\nstopped; the same command goes on from here", file=sys.stderr)
        code = 128 + int(stop.args[0])
    except (SnakeError, OSError) as error:
        print(f"scp_study: {error}", file=sys.stderr)
        return EXIT_FAILED
    outcomes = _complete(trials, store)
    if outcomes:
        _write_results(ranking(outcomes, settled), chosen, given.out)
    if code == EXIT_OK and any(outcome.failed for outcome in outcomes):
        code = EXIT_FAILED
    return code


def _stop(number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt(number)


def _config(given: argparse.Namespace) -> Config:
    config = load(*(given.params_file or [config_directory() / "paper_robot.yaml"]))
    if not given.own_gains:
        config = dataclasses.replace(config, controller=scale_free(config.controller))
    # Made once here, so that a sub-task that cannot be made shows before the workers start.
    ScpController(config.robot, config.controller)
    return config


def _says_settled(config: Config, duration_s: float) -> bool:
    """Return whether the runs are long enough to judge tracking; say so if they are not."""
    transient = transient_s(config.robot, config.controller)
    if settled_from_s(duration_s) >= transient:
        return True
    print(
        f"tracking is not judged: the head is on its way to the reference for {transient:g} s, and "
        f"the last third of {duration_s:g} s begins before; it takes {1.5 * transient:g} s"
    )
    return False


def _parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scp_study", description=(__doc__ or "").splitlines()[0])
    add_params_file(parser, "the robot and its controller, later files win; default: the paper's")
    parser.add_argument(
        "--own-gains",
        action="store_true",
        help="the files' gains as they are; without it gains of the paper's kind are replaced by "
        "the preset scale_free, which fits every choice alike",
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
        type=counting,
        metavar="N",
        help="try N choices drawn at random (and the configured one), not all",
    )
    parser.add_argument("--seed", type=natural, default=0, metavar="N", help="of the sample")
    parser.add_argument(
        "--workers", type=counting, default=os.cpu_count() or 1, metavar="N", help="processes"
    )
    parser.add_argument(
        "--scheduler",
        type=network_address,
        metavar="ADDRESS",
        help="run on this Dask cluster, such as tcp://host:8786",
    )
    parser.add_argument(
        "--fresh", action="store_true", help="forget outcomes of earlier calls in --out"
    )
    given = parser.parse_args(argv)
    if given.dt > given.duration / _LEAST_STEPS:
        parser.error(f"--dt {given.dt:g} leaves fewer than {_LEAST_STEPS} steps of --duration")
    return given


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
    # What failed is tried again: the code that failed is no part of a trial's key.
    missing = [t for t in trials if t.key not in store or store[t.key].failed is not None]
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
        else run_in_processes(missing, given.workers)
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


def _write_results(rows: Sequence[Ranked], chosen: Candidate, out: Path) -> None:
    text = f"{format_ranking(rows, chosen)}\n\n{verdict(rows, chosen)}\n"
    (out / "ranking.txt").write_text(text, encoding="utf-8")
    write_csv(rows, out / "ranking.csv")
    draw(rows, chosen, out / "ranking.png")
    print(f"\n{text}")
    for name in ("ranking.txt", "ranking.csv", "ranking.png", "outcomes.jsonl"):
        print(out / name)


if __name__ == "__main__":
    sys.exit(main())
