"""What the experiment can be told on its command line; no ROS."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

from snake_control.cli.checked import positive
from snake_control.cli.common import add_params_file
from snake_control.config import Config
from snake_control.experiment.cases import CASES, load_case
from snake_control.experiment.run import CONTROLLERS, SERVOS, TORQUE_RATE_HZ, Settings

_RATE_LIMITS_HZ = (1.0, 10000.0)


@dataclasses.dataclass(frozen=True)
class ExperimentArguments:
    """The command line of the experiment.

    Attributes:
        cases: presets of sub-tasks to run; empty for the one of the files.
        params_files: the user's files; the paper's robot if there are none.
        out: directory of the results.
        duration_s: length of each run [s].
        rate_hz: control cycles per second; ``None`` for the controller's of the files.
        plant_step_s: longest step of the plant [s].
        servos: ``perfect`` or ``limited``.
        carry_remainder: whether limited servos carry what rounding leaves.
        controller: ``velocity`` or ``torque``.
        internal_motion: only draw the internal motion.
        figures: whether to draw the figures of each case.
        report: whether to write the report.
    """

    cases: tuple[int, ...]
    params_files: tuple[Path, ...]
    out: Path
    duration_s: float
    rate_hz: float | None
    plant_step_s: float
    servos: str
    carry_remainder: bool
    controller: str
    internal_motion: bool
    figures: bool
    report: bool

    def configurations(self) -> list[Config]:
        """Return the configuration of each case, in rising order of cases.

        Raises:
            ConfigError, ConfigFileError: as ``snake_control.config.load``.
        """
        if not self.cases:
            return [load_case(self.params_files, None)]
        return [load_case(self.params_files, case) for case in self.cases]

    def settings(self, config: Config) -> Settings:
        """Return how a configuration is to be run."""
        rate_hz = self.rate_hz
        if rate_hz is None:
            torque = self.controller == "torque"
            rate_hz = TORQUE_RATE_HZ if torque else config.scp_controller.rate_hz
        return Settings(
            duration_s=self.duration_s,
            rate_hz=rate_hz,
            plant_step_s=self.plant_step_s,
            servos=self.servos,
            carry_remainder=self.carry_remainder,
            controller=self.controller,
        )

    def directory(self, case: int) -> Path:
        """Return where the results of one case go: a directory each if there are several."""
        return self.out / f"case_{case}" if len(self.cases) > 1 else self.out

    def prepare_out(self) -> None:
        """Make the directory of the results and remove an older run's, maybe of other cases.

        Raises:
            OSError: it cannot be made or cleared.
        """
        self.out.mkdir(parents=True, exist_ok=True)
        names = ("report.html", "findings.json", "internal_motion.png")
        own = ("fig[01][0-9]_*.png", "summary.json", "series.csv")
        directories = [self.out, *(self.out / f"case_{case}" for case in CASES)]
        stale = [self.out / name for name in names]
        stale += [p for d in directories for pattern in own for p in d.glob(pattern)]
        for path in stale:
            path.unlink(missing_ok=True)
        for case in self.cases:
            self.directory(case).mkdir(exist_ok=True)


def parse_arguments(argv: Sequence[str] | None = None) -> ExperimentArguments:
    """Read a command line; ends the process with code 2 and the usage if it is wrong."""
    parser = argparse.ArgumentParser(
        prog="experiment",
        description="The paper's experiment in lockstep: no ROS, no clock, the same numbers "
        "every time. Writes summary.json, series.csv, the paper's figures and report.html.",
    )
    add_params_file(parser)
    parser.add_argument(
        "--case",
        type=_cases,
        default=(),
        metavar="N",
        help="1, 2, 3, several as 1,3, or all (side by side); default: the files' own",
    )
    parser.add_argument(
        "--duration", type=positive, default=60.0, metavar="S", help="default: %(default)s s"
    )
    parser.add_argument("--out", type=Path, default=Path("out/experiment"), metavar="DIR")
    parser.add_argument(
        "--servos",
        choices=SERVOS,
        default="perfect",
        help="perfect: joints follow at once, without limits; limited: ticks, speed units, range, "
        "speed limit and a cycle of delay of AX-12 servos; default: %(default)s",
    )
    parser.add_argument(
        "--no-carry",
        dest="carry_remainder",
        action="store_false",
        help="limited servos lose what rounding a speed leaves, instead of carrying it on",
    )
    parser.add_argument(
        "--controller",
        choices=CONTROLLERS,
        default="velocity",
        help="velocity: (22) on a body without inertia; torque: (21) on rigid links; "
        "default: %(default)s",
    )
    parser.add_argument(
        "--rate",
        type=_rate,
        metavar="HZ",
        help="control cycles a second; default: scp_controller.rate_hz of the files "
        f"(50), {TORQUE_RATE_HZ:g} for torque control",
    )
    parser.add_argument(
        "--plant-step",
        type=positive,
        default=Settings().plant_step_s,
        metavar="S",
        help="longest step of the body without inertia; default: %(default)s s",
    )
    parser.add_argument(
        "--no-figures", dest="figures", action="store_false", help="no figures for each case"
    )
    parser.add_argument(
        "--no-report", dest="report", action="store_false", help="findings.json, no report.html"
    )
    parser.add_argument(
        "--internal-motion",
        action="store_true",
        help="run no case; draw how the body moves while the head stands still",
    )
    given = parser.parse_args(argv)
    if given.controller == "torque" and given.servos == "limited":
        parser.error("--servos limited takes velocities: not with --controller torque")
    return ExperimentArguments(
        cases=given.case,
        params_files=tuple(given.params_file),
        out=given.out,
        duration_s=given.duration,
        rate_hz=given.rate,
        plant_step_s=given.plant_step,
        servos=given.servos,
        carry_remainder=given.carry_remainder,
        controller=given.controller,
        internal_motion=given.internal_motion,
        figures=given.figures,
        report=given.report,
    )


def _cases(text: str) -> tuple[int, ...]:
    if text == "all":
        return CASES
    try:
        cases = sorted(int(part) for part in text.split(","))
    except ValueError:
        cases = []
    if len(set(cases)) < len(cases):
        raise argparse.ArgumentTypeError(f"{text!r} has a case twice")
    if not cases or not set(cases) <= set(CASES):
        raise argparse.ArgumentTypeError(f"{text!r} is not 1, 2, 3, a list like 1,3, or all")
    return tuple(cases)


def _rate(text: str) -> float:
    value = float(text)
    low, high = _RATE_LIMITS_HZ
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text} is not {low:g} to {high:g}")
    return value
