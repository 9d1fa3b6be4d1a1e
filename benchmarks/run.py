"""Times the control step over robots of several lengths and writes `out/bench.json`.

Figures are medians of one process; compare ratios, since machines and their load differ. Each
robot's blocks alternate with those of the shortest robot, so that a change of the machine's
speed during the run meets both alike.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.model.floor import head_pose_on_floor
from snake_control.plant.kinematic import KinematicPlant

LENGTHS = (12, 24, 48, 96)


def robot_of(n: int) -> RobotConfig:
    """Return the paper's robot with its base continued to n links; links 7, 9, 11 wheelless."""
    start = RobotConfig().start_joint_angles_rad
    return RobotConfig(
        links=n,
        joint_axes=("pitch", "yaw", "pitch", "yaw", "pitch") + ("yaw",) * (n - 6),
        start_joint_angles_rad=(*start, *(0.3 * np.sin(0.7 * np.arange(12, n)))),
    )


def control_step(robot: RobotConfig) -> Callable[[], object]:
    """Return a call of the whole velocity control step of Case 3."""
    controller = ScpController(robot, ControllerConfig(case=3))
    phi = np.array(robot.start_joint_angles_rad)
    q = np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi))
    w_d = np.array([0.0, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0])
    reference = Reference(w_d, np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]))
    return lambda: controller.step(q, None, reference, 0.0)


def plant_step(robot: RobotConfig) -> Callable[[], object]:
    """Return a call of one step of the kinematic plant, joints at rest."""
    plant = KinematicPlant(robot)
    plant.reset(robot.start_joint_angles_rad)
    still = np.zeros(robot.joints)
    return lambda: plant.step(still, 1e-3)


def block(call: Callable[[], object], calls: int) -> float:
    """Return the median time of one call [s]."""
    times = []
    for _ in range(calls):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def measure(
    make: Callable[[RobotConfig], Callable[[], object]], blocks: int, calls: int, title: str
) -> dict[str, dict[str, float]]:
    """Time a call over all lengths, each in blocks paired with blocks of the shortest robot."""
    shortest = make(robot_of(LENGTHS[0]))
    found = {}
    for n in tqdm(LENGTHS, desc=title):
        call = make(robot_of(n))
        block(call, calls)
        pairs = [(block(call, calls), block(shortest, calls)) for _ in range(blocks)]
        found[str(n)] = {
            "median_ms": 1e3 * statistics.median(pair[0] for pair in pairs),
            f"ratio_to_{LENGTHS[0]}_links": statistics.median(p[0] / p[1] for p in pairs),
        }
    return found


def main() -> int:
    """Run all benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"))
    parser.add_argument("--blocks", type=int, default=15, help="paired blocks for each robot")
    parser.add_argument("--calls", type=int, default=40, help="calls in a block")
    arguments = parser.parse_args()
    result = {
        "machine": {
            "processor": platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
        "control_step": measure(control_step, arguments.blocks, arguments.calls, "control step"),
        "plant_step": measure(plant_step, arguments.blocks, arguments.calls, "plant step"),
    }
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(result, indent=2) + "\n")
    for name in ("control_step", "plant_step"):
        for n, figures in result[name].items():
            print(f"{name:13} n = {n:>3}  " + "  ".join(f"{k} {v:.3f}" for k, v in figures.items()))
    print(f"written to {arguments.out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
