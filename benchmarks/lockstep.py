"""How much faster than real time Case 3 runs in lockstep, control cycles of 20 ms.

By processor time, in which other processes on the machine do not count, and by the clock.
"""

from __future__ import annotations

import dataclasses
import statistics
import time

from tqdm import tqdm

from snake_control.config import load
from snake_control.experiment.cases import case_files
from snake_control.experiment.run import SERVOS, Settings, run_case

SIMULATED_S = 10.0


def measure(blocks: int, calls: int) -> dict[str, dict[str, float]]:
    """Run Case 3 with perfect and with limited servos, ``blocks`` times in turn.

    ``calls`` counts for nothing here: a run has steps enough.
    """
    del calls
    config = load(*case_files(3))
    settings = Settings(duration_s=SIMULATED_S)
    run_case(config, dataclasses.replace(settings, duration_s=1.0))
    taken: dict[str, list[tuple[float, float]]] = {servos: [] for servos in SERVOS}
    for _ in tqdm(range(max(1, blocks // 3)), desc="Case 3 in lockstep"):
        for servos in SERVOS:
            start, cpu = time.perf_counter(), time.process_time()
            run_case(config, dataclasses.replace(settings, servos=servos))
            taken[servos].append((time.process_time() - cpu, time.perf_counter() - start))
    return {
        servos: {
            "times_real_time": SIMULATED_S / statistics.median(cpu for cpu, _ in times),
            "times_real_time_by_clock": SIMULATED_S / statistics.median(wall for _, wall in times),
        }
        for servos, times in taken.items()
    }
