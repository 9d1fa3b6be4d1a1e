"""Follows the line of Table 1, scaled to their size, with robots that are not the paper's.

    python -m benchmarks.other_robots

Each robot gets the gains of the preset ``scale_free`` as they are, then those of ``paper``.
Controller and kinematic plant run in lockstep, the controller limits joint speeds and ranges. A
table and a figure go to ``out/other_robots.md`` and ``out/other_robots.png``.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.style import context
from tqdm import tqdm

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.errors import ModelError
from snake_control.experiment import style
from snake_control.experiment.lockstep import LockstepSample, lockstep
from snake_control.model.singular_shape import SINGULAR_ABOVE
from snake_control.plant.kinematic import KinematicPlant

PAPER = RobotConfig()
RATE_HZ = 50.0
_HEADS = {
    0: ((), (0,), ()),
    4: (("yaw", "pitch", "yaw", "pitch"), (0,), (0.1, 0.2, -0.1, 1.0)),
    5: (PAPER.joint_axes[:5], (3,), PAPER.start_joint_angles_rad[:5]),
    6: (
        ("pitch", "yaw", "pitch", "yaw", "pitch", "pitch"),
        (1, 3),
        (-0.11, 0.0, 0.0, 0.0, 0.5, 0.6),
    ),
}


def robot(
    links: int,
    head_links: int,
    wheelless: Sequence[int],
    size: float = 1.0,
    head_mass_kg: float = 0.1,
) -> RobotConfig:
    """Return a robot of the paper's kind; its base starts as in Table 1, continued by a wave.

    Args:
        links, head_links, wheelless: structure.
        size: of all lengths, in the paper's.
        head_mass_kg: of each head link; base links have 0.1 kg.
    """
    axes, scps, angles = _HEADS[head_links]
    base = links - 1 - head_links
    wave = 0.3 * np.sin(0.7 * np.arange(12, links + 6))
    return RobotConfig(
        links=links,
        head_links=head_links,
        wheelless_links=tuple(wheelless),
        head_scp_joints=scps,
        joint_axes=axes + ("yaw",) * base,
        half_length_m=size * PAPER.half_length_m,
        wheel_offset_m=size * PAPER.wheel_offset_m,
        wheel_radius_m=size * PAPER.wheel_radius_m,
        link_mass_kg=(head_mass_kg,) * head_links + (0.1,) * (links - head_links),
        start_joint_angles_rad=angles + (PAPER.start_joint_angles_rad[5:] + tuple(wave))[:base],
    )


# A short base cannot carry a head as heavy as itself: the light ones have 30 g a link.
ROBOTS = {
    "planar, 8 links": robot(8, 0, (1, 3, 5)),
    "9 links": robot(9, 4, (6,), head_mass_kg=0.03),
    "10 links": robot(10, 5, (8,), head_mass_kg=0.03),
    "the paper's": PAPER,
    "the paper's, 3 times as large": robot(12, 5, (7, 9, 11), size=3.0),
    "Fig. 2": robot(12, 5, (7, 9, 10)),
    "14 links, short head": robot(14, 4, (6, 8, 10, 12)),
    "16 links, long head": robot(16, 6, (8, 10, 12, 14)),
    "16 links, tail wheelless": robot(16, 5, (11, 13, 15)),
    "24 links": robot(24, 5, (7, 9, 11)),
    "24 links, every second": robot(24, 5, tuple(range(7, 24, 2))),
    "36 links, long head": robot(36, 6, (8, 12, 16, 20, 24)),
    "48 links": robot(48, 5, (7, 9, 11)),
    "48 links, every second": robot(48, 5, tuple(range(7, 48, 2))),
}


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What a robot did.

    Attributes:
        t: times of the steps [s].
        error: distance of the head from its reference, in half lengths of a link.
        nearness: of a singular shape, 0..1.
        d_min: in half lengths of a link.
        speed: largest joint speed [rad/s].
        scaled: steps in which joint speeds were scaled down.
        at_range_end: steps in which a joint was at an end of its range.
        off_exponential_mm, off_exponential_rad: largest distance of the error of position and
            attitude from exp(-K t) of its start.
        fell_at_s: ``None`` if it stood.
        ended: why it ended early, empty if it did not.
    """

    t: np.ndarray
    error: np.ndarray
    nearness: np.ndarray
    d_min: np.ndarray
    speed: np.ndarray
    scaled: int
    at_range_end: int
    off_exponential_mm: float
    off_exponential_rad: float
    fell_at_s: float | None
    ended: str


def follow(robot: RobotConfig, controller: ControllerConfig, duration_s: float) -> Outcome:
    """Run a robot along its line, until it falls or has no answer."""
    samples: list[LockstepSample] = []
    ended = ""
    try:
        for sample in _samples(robot, controller, duration_s):
            samples.append(sample)
            if sample.state.fallen:
                break
    except ModelError as error:
        ended = str(error)
    half = robot.half_length_m
    t = np.array([s.t for s in samples])
    errors = np.array([s.result.error for s in samples])
    off = np.abs(errors - errors[0] * np.exp(-np.outer(t, controller.K)))
    fallen = samples[-1].state.fallen
    return Outcome(
        t=t,
        error=np.linalg.norm(errors[:, :3], axis=1) / half,
        nearness=np.array([s.result.singular_shape.nearness for s in samples]),
        d_min=np.array([s.state.d_min for s in samples]) / half,
        speed=np.array([np.abs(s.result.u).max() for s in samples]),
        scaled=sum(s.result.speed_scale < 1.0 for s in samples),
        at_range_end=sum(bool(s.result.range_limited) for s in samples),
        off_exponential_mm=1e3 * float(off[:, :3].max()),
        off_exponential_rad=float(off[:, 3:].max()),
        fell_at_s=float(t[-1]) if fallen else None,
        ended=ended,
    )


def _samples(
    robot: RobotConfig, controller: ControllerConfig, duration_s: float
) -> Iterator[LockstepSample]:
    plant = KinematicPlant(robot)
    state = plant.reset(robot.start_joint_angles_rad)
    size = robot.half_length_m / PAPER.half_length_m
    # Four head joints hold just one pose of the head; that of Table 1 is out of their reach.
    roll, pitch = (0.2, -0.3) if robot.head_links == 4 else (math.pi / 8, math.pi / 8)
    start = np.array([0.0, 0.0, 0.626 * state.w[2], roll, pitch, 0.0])
    velocity = np.array([0.01 * size, 0.0, 0.0, 0.0, 0.0, 0.0])
    return lockstep(
        plant,
        state,
        ScpController(robot, controller),
        lambda t: Reference(start + velocity * t, velocity),
        duration_s,
        1.0 / RATE_HZ,
    )


def row(name: str, robot: RobotConfig, free: Outcome, paper: Outcome) -> str:
    """Return a robot's line of the table."""
    cells = [
        name,
        f"{robot.links}",
        f"{robot.head_links}",
        _links(robot.wheelless_links),
        f"{free.nearness.max():.2f}",
        "-" if robot.planar else f"{free.d_min.min():.2f}",
        f"{free.speed.max():.1f}, {free.speed[len(free.speed) // 2 :].max():.2f}",
        f"{free.scaled}, {free.at_range_end}",
        f"{free.off_exponential_mm:.1f}, {free.off_exponential_rad:.3f}",
        _verdict(free, robot),
        _verdict(paper, robot),
    ]
    return "| " + " | ".join(cells) + " |"


HEADER = (
    "| robot | n | n_h | wheelless | nearness, most | d_min / l, least | speed, most; late [rad/s] "
    "| steps scaled; at range end | off exp(-K t) [mm; rad] | `scale_free` | `paper` |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|"
)


def _links(links: Sequence[int]) -> str:
    if len(links) > 5:
        return f"{links[0]}, {links[1]} .. {links[-1]}"
    return ", ".join(map(str, links))


def _verdict(outcome: Outcome, robot: RobotConfig) -> str:
    found = []
    if outcome.fell_at_s is not None and not robot.planar:
        found.append(f"fell at {outcome.fell_at_s:.0f} s")
    if outcome.nearness.max() > SINGULAR_ABOVE:
        at = outcome.t[np.argmax(outcome.nearness > SINGULAR_ABOVE)]
        found.append(f"singular at {at:.0f} s")
    share = outcome.scaled / len(outcome.t)
    if share > 0.05:
        found.append(f"speeds scaled in {share:.0%} of the steps")
    return "; ".join(found) or outcome.ended or "follows"


def figure(outcomes: dict[str, Outcome]) -> Figure:
    """Draw error, nearness and d_min of all robots over time."""
    drawn = Figure(figsize=(9.0, 7.5))
    drawn.suptitle("Preset scale_free: one set of gains for all")
    error, nearness, d_min = drawn.subplots(3, 1, sharex=True)
    for (name, outcome), color in zip(
        outcomes.items(), style.line_colors(len(outcomes)), strict=True
    ):
        error.semilogy(outcome.t, outcome.error, color=color, linewidth=1.1)
        nearness.plot(outcome.t, outcome.nearness, color=color, linewidth=1.1, label=name)
        d_min.plot(outcome.t, outcome.d_min, color=color, linewidth=1.1)
    error.set_ylabel("position error / $l$")
    nearness.axhline(SINGULAR_ABOVE, color=style.FALL, linewidth=0.9)
    nearness.set_ylim(0.0, 1.02)
    nearness.set_ylabel("nearness of a\nsingular shape")
    d_min.axhline(0.0, color=style.FALL, linewidth=0.9)
    d_min.set_ylabel("$d_{min}$ / $l$")
    d_min.set_xlabel("$t$ [s]")
    drawn.legend(loc="outside right upper", fontsize=8)
    return drawn


def main() -> int:
    """Run all robots with both presets."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--duration", type=float, default=60.0, metavar="S")
    arguments = parser.parse_args()
    free, lines = {}, [HEADER]
    for name, each in tqdm(ROBOTS.items()):
        free[name] = follow(each, ControllerConfig(preset="scale_free"), arguments.duration)
        paper = follow(each, ControllerConfig(), arguments.duration)
        lines.append(row(name, each, free[name], paper))
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "other_robots.md").write_text("\n".join(lines) + "\n")
    with context(style.RC):
        figure(free).savefig(arguments.out / "other_robots.png")
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
