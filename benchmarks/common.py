"""What all benchmarks share: the robots, and times in paired blocks.

Figures are medians of one process. Compare ratios, since machines and their load differ: what is
compared runs in turn, block by block, so that a change of the machine's speed meets all alike.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig
from snake_control.model.floor import head_pose_on_floor

Call = Callable[[], object]

LENGTHS = (12, 24, 48, 96)


def robot_of(n: int) -> RobotConfig:
    """Return the paper's robot with its base continued to n links; links 7, 9, 11 wheelless.

    Joint k beyond Table 1 starts at 0.3 sin(0.7 k).
    """
    start = RobotConfig().start_joint_angles_rad
    return RobotConfig(
        links=n,
        joint_axes=("pitch", "yaw", "pitch", "yaw", "pitch") + ("yaw",) * (n - 6),
        start_joint_angles_rad=(*start, *(0.3 * np.sin(0.7 * np.arange(12, n)))),
    )


def start_posture(robot: RobotConfig) -> NDArray[np.float64]:
    """Return q of the robot standing at the origin with its joints where they start."""
    phi = np.array(robot.start_joint_angles_rad)
    return np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi))


def block(call: Call, calls: int) -> float:
    """Return the median time of one call [s]."""
    times = []
    for _ in range(calls):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def in_turn(timed: Sequence[Call], blocks: int, calls: int) -> list[list[float]]:
    """Return the blocks of several calls, each round one of every call in order [s]."""
    for call in timed:
        block(call, calls)
    return [[block(call, calls) for call in timed] for _ in range(blocks)]


def median_ms(rounds: Sequence[Sequence[float]], which: int) -> float:
    """Return the median over all rounds of one call [ms]."""
    return 1e3 * statistics.median(times[which] for times in rounds)


def median_ratio(rounds: Sequence[Sequence[float]], which: int, to: int) -> float:
    """Return the median over all rounds of the ratio of two calls in the same round."""
    return statistics.median(times[which] / times[to] for times in rounds)
