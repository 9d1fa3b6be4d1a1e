"""Tries every fault of the motion capture and writes a table: ``python -m poses.campaign``."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from poses.rig import Outcome, Rig
from poses.rows import ROWS, Row

EXIT_OK, EXIT_VIOLATED = 0, 1
_TRIES = 2


def table(found: Sequence[tuple[Row, Outcome]]) -> str:
    """Return the results as a Markdown table."""
    lines = [
        "| fault | the controller was | `head/status` said | rest after [s] | "
        "largest head error before, during, after [mm] | following again after [s] |",
        "|---|---|---|---|---|---|",
    ]
    for row, outcome in found:
        errors = ", ".join(
            _number(1e3 * error, 1)
            for error in (outcome.error_before_m, outcome.error_m, outcome.error_after_m)
        )
        said = "; ".join(outcome.texts) or "-"
        said = (said if len(said) <= 160 else said[:157] + "...").replace("|", "/")
        if outcome.tries > 1:
            said += f" (try {outcome.tries})"
        if outcome.failures:
            said += " **" + "; ".join(outcome.failures) + "**"
        lines.append(
            f"| {row.name} | {', '.join(outcome.states)} | {said} | "
            f"{_number(outcome.stop_s, 2)} | {errors} | {_number(outcome.back_s, 2)} |"
        )
    return "\n".join(lines) + "\n"


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def run(rows: Sequence[Row]) -> list[tuple[Row, Outcome]]:
    """Run rows in order on one graph; one that failed once more, as a busy machine may be why.

    Not one that put the robot in danger.
    """
    found = []
    with Rig() as rig:
        for row in rows:
            for attempt in range(1, _TRIES + 1):
                try:
                    outcome = rig.run(row)
                except AssertionError as error:
                    outcome = Outcome(violations=[f"not carried out: {str(error).splitlines()[0]}"])
                if not outcome.violations or outcome.dangers:
                    break
                print(f"  {row.name}, try {attempt}: {'; '.join(outcome.failures)}", flush=True)
            found.append((row, outcome))
            print(f"{row.name}: {'VIOLATED' if outcome.failures else 'ok'}", flush=True)
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Run all rows, or those that are chosen; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="FAULT", help="parts of names; all if none")
    parser.add_argument("--short", action="store_true", help="only those marked short")
    parser.add_argument("--out", type=Path, default=Path("out"))
    given = parser.parse_args(argv)
    chosen = [
        row
        for row in ROWS
        if (row.short or not given.short)
        and (not given.names or any(name in row.name for name in given.names))
    ]
    if not chosen:
        parser.error(f"no such fault; there are {', '.join(row.name for row in ROWS)}")
    found = run(chosen)
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "pose_faults.md"
    path.write_text(f"# Faults of the motion capture\n\n{table(found)}")
    print(f"written to {path}")
    return EXIT_VIOLATED if any(outcome.failures for _, outcome in found) else EXIT_OK


if __name__ == "__main__":
    raise SystemExit(main())
