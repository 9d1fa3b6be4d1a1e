"""What the demo can be told on its command line, and what follows from it; no ROS."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from snake_control.cli.checked import natural, positive
from snake_control.cli.common import add_params_file
from snake_control.config import Config, load
from snake_control.experiment.cases import CASES, case_files, config_directory
from snake_control.experiment.parameters import configuration_parameters


@dataclasses.dataclass(frozen=True)
class DemoArguments:
    """The command line of the demo.

    Attributes:
        case: preset of sub-tasks, 1..3.
        duration_s: how long the reference is followed [s].
        seed: of the mock's noise; ``None`` for the one in its configuration.
        out: directory of the results.
        params_files: the user's files, read last.
        no_noise: whether the motion capture is exact (its delay stays).
        record: whether every topic is recorded to ``recording``.
    """

    case: int
    duration_s: float
    seed: int | None
    out: Path
    params_files: tuple[Path, ...]
    no_noise: bool
    record: bool = False

    @property
    def recording(self) -> Path:
        """The file that ``record`` makes."""
        return self.out / "demo.mcap"

    @property
    def all_params_files(self) -> tuple[Path, ...]:
        """Every parameter file that the nodes read, in order.

        Raises:
            ConfigFileError: the package's own files are not installed.
        """
        robot, case = case_files(self.case)
        return (robot, config_directory() / "mock.yaml", case, *self.params_files)

    @property
    def mock_parameters(self) -> dict[str, Any]:
        """Parameters of the mock that the command line sets."""
        parameters: dict[str, Any] = {}
        if self.seed is not None:
            parameters["seed"] = self.seed
        if self.no_noise:
            parameters |= {"mocap_position_noise_m": 0.0, "mocap_rotation_noise_rad": 0.0}
        return parameters

    def load(self) -> Config:
        """Return the configuration in force.

        Raises:
            ConfigError, ConfigFileError: as ``snake_control.config.load``.
        """
        config = load(*self.all_params_files)
        mock = dataclasses.replace(config.mock_bus, **self.mock_parameters)
        return dataclasses.replace(config, mock_bus=mock)

    def prepare_out(self) -> None:
        """Make the directory of the results and remove an older run's, maybe of another case.

        Raises:
            OSError: it cannot be made or cleared.
        """
        (self.out / "logs").mkdir(parents=True, exist_ok=True)
        for pattern in (
            "fig[01][0-9]_*.png",
            "summary.json",
            "series.csv",
            "demo.mcap",
            "logs/*.log",
        ):
            for path in self.out.glob(pattern):
                path.unlink()

    def summary_parameters(self, config: Config) -> dict[str, Any]:
        """Return what the summary says about the parameters of the run."""
        mock = config.mock_bus
        return {
            "seed": mock.seed,
            "mocap_rate_hz": mock.mocap_rate_hz,
            "mocap_position_noise_m": mock.mocap_position_noise_m,
            "mocap_rotation_noise_rad": mock.mocap_rotation_noise_rad,
            "mocap_delay_s": mock.mocap_delay_s,
            "requested_duration_s": self.duration_s,
            **configuration_parameters(config),
            "params_files": [str(path) for path in self.params_files],
        }


def parse_arguments(argv: Sequence[str] | None = None) -> DemoArguments:
    """Read a command line; ends the process with code 2 and the usage if it is wrong."""
    parser = argparse.ArgumentParser(
        prog="demo", description="The paper's experiment on a simulated robot."
    )
    parser.add_argument("--case", type=int, choices=CASES, default=3, help="default: %(default)s")
    parser.add_argument(
        "--duration", type=positive, default=60.0, metavar="S", help="default: %(default)s s"
    )
    parser.add_argument(
        "--seed", type=natural, metavar="N", help="of the mock's noise; default: its configuration"
    )
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR")
    add_params_file(
        parser, "read after the paper's robot, the mock and the case; may be given several times"
    )
    parser.add_argument(
        "--no-noise", action="store_true", help="motion capture without noise (delay stays)"
    )
    parser.add_argument(
        "--record", action="store_true", help="write every topic to demo.mcap beside the results"
    )
    given = parser.parse_args(argv)
    return DemoArguments(
        case=given.case,
        duration_s=given.duration,
        seed=given.seed,
        out=given.out,
        params_files=tuple(given.params_file),
        no_noise=given.no_noise,
        record=given.record,
    )
