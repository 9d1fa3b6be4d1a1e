"""How control step and plant step grow with the length of the robot."""

from __future__ import annotations

import math
from collections.abc import Callable

from tqdm import tqdm

from benchmarks.common import LENGTHS, Call, in_turn, median_ms, median_ratio, robot_of
from benchmarks.steps import control_step, plant_step
from snake_control.config import RobotConfig


def _of(
    make: Callable[[RobotConfig], Call], blocks: int, calls: int, title: str
) -> dict[str, dict[str, float]]:
    timed = [make(robot_of(n)) for n in tqdm(LENGTHS, desc=title)]
    rounds = in_turn(timed, blocks, calls)
    found = {
        str(n): {
            "median_ms": median_ms(rounds, i),
            f"ratio_to_{LENGTHS[0]}_links": median_ratio(rounds, i, 0),
        }
        for i, n in enumerate(LENGTHS)
    }
    first, last = LENGTHS.index(24), LENGTHS.index(96)
    ratio = median_ratio(rounds, last, first)
    found["24 to 96"] = {"ratio": ratio, "exponent": math.log(ratio) / math.log(96 / 24)}
    return found


def measure(blocks: int, calls: int) -> dict[str, dict[str, float]]:
    """Time the control step over all lengths."""
    return _of(control_step, blocks, calls, "control step")


def measure_plant(blocks: int, calls: int) -> dict[str, dict[str, float]]:
    """Time the plant step over all lengths."""
    return _of(plant_step, blocks, calls, "plant step")
