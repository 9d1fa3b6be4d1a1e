"""Prints every model quantity at a state as JSON, to check other implementations against.

python -m snake_control.cli.evaluate --params-file config/paper_robot.yaml --state q.json

``q.json``: ``{"q": [...], "q_dot": [...], "t": 0.0, "case": 2}`` or a list of those; the output is
a list then, too. ``-`` reads standard input. q_dot, t and case may be left out: 0, 0 and the
parameter file's case.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from snake_control.cli.common import EXIT_OK, EXIT_USAGE, add_params_file
from snake_control.config import Config
from snake_control.errors import ConfigError, SnakeError
from snake_control.experiment.cases import load_case
from snake_control.experiment.evaluation import evaluate, read_states


def main(argv: Sequence[str] | None = None) -> int:
    """Print the quantities; return the exit code: 0, or 2 with one line on stderr."""
    arguments = _parse(argv)
    try:
        result = _evaluate(arguments.params_file, arguments.state)
    except SnakeError as error:
        print(str(error).replace("\n", " "), file=sys.stderr)
        return EXIT_USAGE
    except OSError as error:
        print(f"--state {arguments.state}: {error.strerror or error}", file=sys.stderr)
        return EXIT_USAGE
    try:
        print(_text(result))
    except BrokenPipeError:
        # Whoever read has seen enough; without this Python complains once more at exit.
        sys.stderr.close()
    return EXIT_OK


def _evaluate(params_files: Sequence[Path], state: str) -> Any:
    configs: dict[int | None, Config] = {None: load_case(params_files, None)}
    states, is_list = read_states(_document(state), configs[None].robot)
    results = []
    for each in states:
        if each.case not in configs:
            configs[each.case] = load_case(params_files, each.case)
        results.append(evaluate(configs[each.case], each))
    return results if is_list else results[0]


def _text(result: Any) -> str:
    """Return JSON with one quantity a line; floats as repr, so that no digit is lost."""
    if isinstance(result, list):
        return "[" + ",\n".join(map(_text, result)) + "]"
    lines = (f"{json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in result.items())
    return "{" + ",\n ".join(lines) + "}"


def _document(state: str) -> object:
    try:
        text = sys.stdin.read() if state == "-" else Path(state).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ConfigError("--state", state, f"give a JSON file in UTF-8: {error.reason}") from error
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}: {error.msg}"
        raise ConfigError("--state", state, f"give valid JSON; {where}") from error


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="evaluate", description="Every model quantity at a state, as JSON on standard output."
    )
    add_params_file(parser)
    parser.add_argument(
        "--state",
        required=True,
        metavar="FILE",
        help='JSON: {"q": [...], "q_dot": [...], "t": 0.0, "case": 2} or a list of those; '
        "- for standard input",
    )
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
