"""The parameter files of the paper's experiment, in a checkout and in an installed package."""

from __future__ import annotations

import os
from pathlib import Path

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
