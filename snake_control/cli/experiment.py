"""The paper's experiment in lockstep: no ROS, no clock, the same numbers every time.

    python -m snake_control.cli.experiment --case all --duration 60 --out out/experiment

Runs cases of the paper on a simulated body and writes for each ``summary.json``, ``series.csv`` and
the paper's figures, and for all of them one ``report.html`` that sets what the paper states
against what came out.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from tqdm import tqdm

from snake_control.cli.common import EXIT_FAILED, EXIT_OK, EXIT_USAGE, ending_signals
from snake_control.cli.experiment_arguments import ExperimentArguments, parse_arguments
from snake_control.config import Config
from snake_control.errors import SnakeError
from snake_control.experiment.run import CaseRun, run_case
from snake_control.experiment.series import Step
from snake_control.experiment.summary import write_summary
from snake_control.experiment.table import format_summary


class _Stop:
    """Remembers that somebody wants the run to end; results are written all the same."""

    def __init__(self) -> None:
        self.signal: int | None = None

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        self.signal = number


def main(argv: Sequence[str] | None = None) -> int:
    """Run the experiment; return its exit code.

    0: done, whatever the robot did; 1: results cannot be written; 2: bad arguments or
    configuration; 130, 143: ended by SIGINT, SIGTERM, results up to then written.
    """
    arguments = parse_arguments(argv)
    try:
        configurations = arguments.configurations()
        arguments.prepare_out()
    except SnakeError as error:
        print(f"configuration error: {error}", file=sys.stderr)
        return EXIT_USAGE
    except OSError as error:
        print(f"cannot write to {arguments.out}: {error}", file=sys.stderr)
        return EXIT_USAGE
    stop = _Stop()
    with ending_signals(stop):
        try:
            if arguments.internal_motion:
                _internal_motion(configurations[0], arguments.out)
            else:
                _cases(arguments, configurations, stop)
        except SnakeError as error:
            print(error, file=sys.stderr)
            return EXIT_FAILED
        except OSError as error:
            print(f"cannot write to {arguments.out}: {error}", file=sys.stderr)
            return EXIT_FAILED
    return EXIT_OK if stop.signal is None else 128 + stop.signal


def _cases(arguments: ExperimentArguments, configurations: Sequence[Config], stop: _Stop) -> None:
    runs = []
    for config in configurations:
        run = _one_case(arguments, config, stop)
        runs.append(run)
        if run.interrupted:
            break
    runs = [run for run in runs if len(run.series)]
    if runs:
        _judge(runs, arguments)


def _one_case(arguments: ExperimentArguments, config: Config, stop: _Stop) -> CaseRun:
    settings, case = arguments.settings(config), config.controller.case
    directory = arguments.directory(case)
    # None: no bar where nobody looks, as in a log.
    with tqdm(
        total=settings.duration_s,
        desc=f"case {case}",
        unit="s",
        disable=None,
        bar_format="{desc}: {percentage:3.0f}% |{bar}| {n:.1f} / {total:g} s{postfix}",
    ) as bar:

        def on_step(step: Step) -> bool:
            bar.update(step.t_s - bar.n)
            return stop.signal is None

        begin = time.monotonic()
        run = run_case(config, settings, directory / "series.csv", on_step)
        took = time.monotonic() - begin
    write_summary(run.summary, directory / "summary.json")
    print(f"\n{format_summary(run.summary)}")
    ran = run.summary["duration_s"]
    # Printed only: the files hold nothing that a clock has a part in.
    print(f"{'took':20}{took:.1f} s, {ran / took:.1f} times real time\n")
    print(directory / "summary.json")
    print(directory / "series.csv")
    if arguments.figures:
        # Here, because matplotlib takes a second to load.
        from snake_control.experiment.figures import draw_all

        for path in draw_all(run.series, case, directory):
            print(path)
    return run


def _judge(runs: Sequence[CaseRun], arguments: ExperimentArguments) -> None:
    from snake_control.experiment.facts import Facts
    from snake_control.experiment.findings import as_json, findings

    out = arguments.out
    facts = {run.case: Facts(run) for run in runs}
    found = findings(facts)
    text = json.dumps(as_json(found), indent=2, allow_nan=False)
    (out / "findings.json").write_text(text + "\n", encoding="utf-8")
    if arguments.report:
        from snake_control.experiment.internal_motion import internal_motions
        from snake_control.experiment.report import write_report

        write_report(facts, found, internal_motions(runs[0].config.robot), out / "report.html")
    if len(runs) > 1:
        print()
        for finding in found:
            cases = ", ".join(map(str, finding.cases))
            print(f"{finding.verdict.value:16}case {cases}: {finding.paper}")
    print()
    print(out / "findings.json")
    if arguments.report:
        print(out / "report.html")


def _internal_motion(config: Config, out: Path) -> None:
    from snake_control.experiment.internal_motion import describe, internal_motions, save

    motions = internal_motions(config.robot)
    path = out / "internal_motion.png"
    save(motions, config.robot, path)
    for motion in motions:
        print(describe(motion))
    print(path)


if __name__ == "__main__":
    sys.exit(main())
