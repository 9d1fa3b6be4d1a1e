"""Runs all benchmarks and writes `out/bench.json`."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
from pathlib import Path

from benchmarks import bus_cycle, dynamics, growth, latency, lockstep, pink_ik

# Name in the result: what measures it, from the number of blocks and of calls in a block.
BENCHMARKS = {
    "control_step": growth.measure,
    "control_step_and_pink": pink_ik.measure,
    "plant_step": growth.measure_plant,
    "reduced_dynamics": dynamics.measure,
    "lockstep_case_3": lockstep.measure,
    "bus_cycle": bus_cycle.measure,
    "latency": latency.measure,
}


def machine() -> dict[str, object]:
    """Return what the figures belong to."""
    names = ("numpy", "scipy", "pin", "pin-pink", "daqp")
    return {
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in names},
    }


def main() -> int:
    """Run all benchmarks, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(BENCHMARKS)}")
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"))
    parser.add_argument("--blocks", type=int, default=25, help="rounds of blocks for each robot")
    parser.add_argument("--calls", type=int, default=40, help="calls in a block")
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in BENCHMARKS:
            parser.error(f"no benchmark {name}; there are {', '.join(BENCHMARKS)}")
    found = {
        name: BENCHMARKS[name](arguments.blocks, arguments.calls)
        for name in arguments.names or BENCHMARKS
    }
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps({"machine": machine(), **found}, indent=2) + "\n")
    for name, rows in found.items():
        for row, figures in rows.items():
            text = "  ".join(f"{key} {value:.3g}" for key, value in figures.items())
            print(f"{name:22} {row:>9}  {text}")
    print(f"written to {arguments.out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
