"""Writes the layouts for RViz, Foxglove and PlotJuggler, for the robot of a namespace.

ros2 run snake_control layouts --namespace robot_1 --out .
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from snake_control.cli.common import EXIT_FAILED, EXIT_OK
from snake_control.config.namespaces import layout_for
from snake_control.errors import SnakeError
from snake_control.experiment.cases import config_directory

LAYOUTS = ("snake.rviz", "layouts/foxglove.json", "layouts/plotjuggler.xml")


def main(argv: Sequence[str] | None = None) -> int:
    """Write the files and print their paths; 1 if one cannot be written."""
    parser = argparse.ArgumentParser(
        prog="layouts", description="Layouts for RViz, Foxglove and PlotJuggler."
    )
    parser.add_argument("--namespace", default="", metavar="NS", help="of the robot; default: none")
    parser.add_argument(
        "--out", type=Path, default=Path(), metavar="DIR", help="default: the current directory"
    )
    given = parser.parse_args(argv)
    robot = given.namespace.strip("/").replace("/", "_")
    try:
        given.out.mkdir(parents=True, exist_ok=True)
        for name in LAYOUTS:
            source = config_directory() / name
            stem = f"{robot}_{source.name}" if robot else source.name
            text = layout_for(source.read_text(encoding="utf-8"), given.namespace)
            (given.out / stem).write_text(text, encoding="utf-8")
            print(given.out / stem)
    except (SnakeError, OSError) as error:
        print(f"layouts: {error}", file=sys.stderr)
        return EXIT_FAILED
    return EXIT_OK


if __name__ == "__main__":
    sys.exit(main())
