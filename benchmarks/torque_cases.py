"""Runs Cases 1 to 3 under torque control (21) and writes what `docs/dynamics.md` states.

Each case starts as the paper's does, far from w_d(0), and again with an approach from the head. The
controller answers at every moment, or holds its torques for the step of a computer.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.style import context
from numpy.typing import NDArray
from tqdm import tqdm

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.reference import Reference
from snake_control.control.torque_controller import TorqueController, TorqueResult
from snake_control.experiment import style
from snake_control.model.posture import Posture
from snake_control.plant.torque import TorquePlant, TorquePlantState
from snake_control.trajectory.approach import Approach
from snake_control.trajectory.line import Line

Array = NDArray[np.float64]

LINE = Line([0.0, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0], [0.01, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0)
SAMPLE_S = 0.01
SETTLED_FROM_S = 5.0


@dataclasses.dataclass(frozen=True)
class Run:
    """One experiment.

    Attributes:
        case: 1, 2 or 3.
        hold_s: how long torques are held [s]; 0 for a controller that answers at every moment.
        approach_s: duration of the approach from the head [s]; 0 for the paper's start.
    """

    case: int
    hold_s: float
    approach_s: float

    @property
    def title(self) -> str:
        """Return the run in words."""
        rate = f"{1 / self.hold_s:.0f} Hz" if self.hold_s else "continuous"
        start = f"approach {self.approach_s:g} s" if self.approach_s else "Table 1"
        return f"Case {self.case}, {start}, {rate}"


def simulate(run: Run, duration_s: float) -> list[tuple[float, TorquePlantState, TorqueResult]]:
    """Return time, plant state and what the controller decided, every 10 ms."""
    robot = RobotConfig()
    controller = TorqueController(robot, ControllerConfig(case=run.case))
    plant = TorquePlant(robot)
    state = plant.reset(robot.start_joint_angles_rad)
    goal: Callable[[float], Reference] = LINE.sample
    if run.approach_s:
        goal = Approach(LINE, state.w, 0.0, run.approach_s).sample
    samples = []
    for step in tqdm(range(round(duration_s / SAMPLE_S) + 1), desc=run.title, disable=None):
        t = step * SAMPLE_S
        result = controller.step(*_measured(state), goal(t), t)
        samples.append((t, state, result))
        if run.hold_s == 0:

            def law(q: Array, q_dot: Array, elapsed: float, t: float = t) -> Array:
                return controller.step(q, q_dot, goal(t + elapsed), t + elapsed).u

            state = plant.follow(law, SAMPLE_S)
            continue
        for hold in range(round(SAMPLE_S / run.hold_s)):
            now = t + hold * run.hold_s
            command = controller.step(*_measured(state), goal(now), now).u
            state = plant.step(command, run.hold_s)
    return samples


def _measured(state: TorquePlantState) -> tuple[Array, Array]:
    return np.concatenate((state.w, state.phi)), np.concatenate((state.w_dot, state.phi_dot))


def figures(samples: list[tuple[float, TorquePlantState, TorqueResult]]) -> dict[str, Any]:
    """Return the run in numbers."""
    t = np.array([sample[0] for sample in samples])
    states = [sample[1] for sample in samples]
    results = [sample[2] for sample in samples]
    error = np.array([r.error for r in results])
    # e_ddot + 4 e_dot + 4 e = 0 from the first sample on.
    e, e_dot = results[0].error, results[0].error_dot
    law = (e + np.outer(t, e_dot + 2 * e)) * np.exp(-2 * t)[:, None]
    off = np.abs(error - law).max(axis=1)
    torque = np.abs([r.u for r in results])
    speed = np.abs([s.phi_dot for s in states]).max(axis=1)
    # The first state is that of a robot without torques.
    side = np.abs([s.wheel_forces for s in states[1:]]).max(axis=1)
    V_b1 = np.array([r.V_b1 for r in results])
    late = t >= SETTLED_FROM_S
    fell = [time_s for time_s, state, _ in samples if state.fallen]
    below = t[V_b1 < 0.01 * V_b1[0]]
    return {
        "off_error_law_max": float(off.max()),
        "off_error_law_max_settled": float(off[late].max(initial=0.0)),
        "torque_max_n_m": float(torque.max()),
        "torque_max_joint": int(torque.max(axis=0).argmax()) + 1,
        "torque_max_other_joints_n_m": float(np.delete(torque, 4, axis=1).max()),
        "joint_speed_max_rad_s": float(speed.max()),
        "joint_speed_max_settled_rad_s": float(speed[late].max(initial=0.0)),
        "joint_angle_max_rad": float(np.abs([s.phi for s in states]).max()),
        "side_force_max_n": float(side.max()),
        "side_force_max_settled_n": float(side[late[1:]].max(initial=0.0)),
        "V_b1_min": float(V_b1.min()),
        "V_b1_below_1_percent_at_s": float(below[0]) if len(below) else None,
        "sigma_min_E_tilde_min": min(r.sigma_min_E_tilde for r in results),
        "push_at_start_n_m": _push(results[0]),
        "push_at_end_n_m": _push(results[-1]),
        "d_min_min_m": min(s.d_min for s in states),
        "fell_at_s": fell[0] if fell else None,
    }


def _push(result: TorqueResult) -> float:
    """Return the largest torque that 1 m/s^2 of the head in x takes by itself [N m]."""
    posture = Posture(RobotConfig(), np.concatenate((result.w, result.phi)))
    return float(np.abs(np.linalg.pinv(posture.k.E_tilde) @ result.M_tilde[:, 0]).max())


def plot(runs: dict[int, list[tuple[float, TorquePlantState, TorqueResult]]]) -> Figure:
    """Draw error, torques, V_b1 and d_min of one run of each case over time."""
    figure = Figure(figsize=(8.0, 6.5))
    panels = figure.subplots(4, 1, sharex=True)
    colours = (style.VERMILION, style.BLUE, style.GREEN)
    for (case, samples), colour in zip(sorted(runs.items()), colours, strict=True):
        t = [sample[0] for sample in samples]
        line = {"color": colour, "label": f"Case {case}"}
        panels[0].semilogy(t, [np.abs(r.error).max() for _, _, r in samples], **line)
        panels[1].plot(t, [np.abs(r.u).max() for _, _, r in samples], **line)
        panels[2].semilogy(t, [r.V_b1 for _, _, r in samples], **line)
        panels[3].plot(t, [1e3 * s.d_min for _, s, _ in samples], **line)
    panels[1].axhline(1.5 / 5, color=style.REFERENCE, linestyle="--", linewidth=0.9)
    labels = ("largest error\n[m, rad]", "largest torque\n[N m]", "$V_{b1}$", "$d_{min}$ [mm]")
    for panel, label in zip(panels, labels, strict=True):
        panel.set_ylabel(label)
    panels[0].legend(ncols=3)
    panels[-1].set_xlabel("$t$ [s]")
    return figure


def main() -> int:
    """Run all experiments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=60.0, help="of each run [s]")
    parser.add_argument("--out", type=Path, default=Path("out/torque_cases"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    found, drawn = {}, {}
    for case in (1, 2, 3):
        for hold_s, approach_s in ((0.0, 0.0), (1e-3, 0.0), (5e-3, 0.0), (1e-3, 10.0)):
            run = Run(case, hold_s, approach_s)
            start = time.perf_counter()
            samples = simulate(run, arguments.duration)
            found[run.title] = figures(samples)
            found[run.title]["computed_in_s"] = time.perf_counter() - start
            print(run.title, flush=True)
            for name, value in found[run.title].items():
                print(f"  {name:32}{value if value is None else format(value, '.4g')}")
            if hold_s == 1e-3 and not approach_s:
                drawn[case] = samples
    with context(style.RC):
        plot(drawn).savefig(arguments.out / "torque.png", dpi=100)
    (arguments.out / "torque_cases.json").write_text(json.dumps(found, indent=2) + "\n")
    print(f"written to {arguments.out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
