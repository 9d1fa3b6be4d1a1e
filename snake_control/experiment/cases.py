"""The parameter files of the paper's experiment, and configurations that are made of them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from snake_control.config import Config, load
from snake_control.errors import ConfigFileError

CASES = (1, 2, 3)
_ROBOT = "paper_robot.yaml"


def config_directory() -> Path:
    """Return the directory of this package's YAML files.

    That is ``config/`` of the checkout this module lies in, else ``share/snake_control/config`` of
    an installation.

    Raises:
        ConfigFileError: neither is there.
    """
    here = Path(__file__).resolve()
    candidates = [here.parents[2] / "config"]
    # The same look-up as ament_index_python's, which this ROS-free room cannot import.
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            candidates.append(Path(prefix) / "share" / "snake_control" / "config")
    for candidate in candidates:
        if (candidate / _ROBOT).is_file():
            return candidate
    raise ConfigFileError(
        _ROBOT, "not found; searched " + ", ".join(str(candidate) for candidate in candidates)
    )


def case_files(case: int) -> list[Path]:
    """Return the parameter files of one case of the paper, robot first.

    Raises:
        ConfigFileError: the files are not installed.
    """
    directory = config_directory()
    return [directory / _ROBOT, directory / f"case_{case}.yaml"]


def load_case(params_files: Sequence[str | Path], case: int | None) -> Config:
    """Return the configuration of files that a user gave, with a case of the paper.

    Args:
        params_files: ROS parameter files, later ones winning; none for the paper's robot.
        case: preset of sub-tasks, 1..3, that wins over the files' own; ``None`` for theirs.

    Raises:
        ConfigError, ConfigFileError: as ``snake_control.config.load``.
    """
    files = list(params_files) or [config_directory() / _ROBOT]
    if case is not None:
        files.append(config_directory() / f"case_{case}.yaml")
    return load(*files)
