"""Runs the fault campaign and writes its table: ``python -m faults.campaign`` in ``test``."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from pathlib import Path

from faults.check import Outcome
from faults.rig import Rig
from faults.scenario import Scenario, load

EXIT_OK, EXIT_VIOLATED = 0, 1


def run(scenarios: Sequence[Scenario], tries: int = 2) -> list[tuple[Scenario, Outcome]]:
    """Run scenarios in order; one that failed is tried once more, as a busy machine may be why."""
    found = []
    begin = time.monotonic()
    with Rig() as rig:
        for number, scenario in enumerate(scenarios, 1):
            for attempt in range(1, tries + 1):
                try:
                    outcome = rig.run(scenario)
                except AssertionError as error:
                    first, *rest = f"not carried out: {error}".splitlines()
                    outcome = Outcome(violations=[first], timeline=rest)
                if not outcome.violations:
                    break
                words = str(outcome).replace("\n", "\n    ")
                print(f"  {scenario.name}, try {attempt}: {words}", flush=True)
            found.append((scenario, outcome))
            result = "VIOLATED" if outcome.violations else "ok"
            elapsed = time.monotonic() - begin
            print(
                f"[{number}/{len(scenarios)}, {elapsed:.0f} s] {scenario.name}: {result}",
                flush=True,
            )
    return found


def table(found: Sequence[tuple[Scenario, Outcome]]) -> str:
    """Return the results as a Markdown table."""
    lines = [
        "| scenario | in | injected | the driver said | time to rest [s] | travel [rad] | back |",
        "|---|---|---|---|---|---|---|",
    ]
    for scenario, outcome in found:
        said = outcome.did.replace("|", "/")
        said = said if len(said) <= 130 else said[:127] + "..."
        if outcome.violations:
            said += " **" + "; ".join(outcome.violations) + "**"
        lines.append(
            f"| {scenario.name} | {scenario.situation} | {scenario.what} | {said} | "
            f"{_number(outcome.stop_s, 2)} | {_number(outcome.travel, 3)} | {outcome.recovered} |"
        )
    return "\n".join(lines) + "\n"


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run all scenarios, or those that are named; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="SCENARIO")
    parser.add_argument("--short", action="store_true", help="only those marked short")
    parser.add_argument("--out", type=Path, default=Path("out"))
    given = parser.parse_args(argv)
    scenarios = load()
    known = {scenario.name for scenario in scenarios}
    for name in given.names:
        if name not in known:
            parser.error(f"no scenario {name}; there are {', '.join(sorted(known))}")
    chosen = [
        scenario
        for scenario in scenarios
        if (not given.names or scenario.name in given.names) and (scenario.short or not given.short)
    ]
    found = run(chosen)
    given.out.mkdir(parents=True, exist_ok=True)
    text = f"# Fault campaign\n\n{table(found)}"
    (given.out / "faults.md").write_text(text)
    (given.out / "faults.json").write_text(
        json.dumps(
            {
                scenario.name: {
                    "injected": scenario.what,
                    "did": outcome.did,
                    "stop_s": None if math.isnan(outcome.stop_s) else outcome.stop_s,
                    "travel_rad": None if math.isnan(outcome.travel) else outcome.travel,
                    "recovered": outcome.recovered,
                    "violations": outcome.violations,
                }
                for scenario, outcome in found
            },
            indent=2,
        )
        + "\n"
    )
    violated = [scenario.name for scenario, outcome in found if outcome.violations]
    print(f"written to {given.out / 'faults.md'}")
    if violated:
        print(f"{len(violated)} of {len(found)} violated: {', '.join(violated)}")
        return EXIT_VIOLATED
    print(f"all {len(found)} scenarios hold")
    return EXIT_OK


if __name__ == "__main__":
    raise SystemExit(main())
