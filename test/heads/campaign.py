"""Head trajectories in lockstep: those that the robot can do, and those that it must not do.

``python -m heads.campaign`` in ``test`` (``make heads``) tries 200 of the one and 100 of the other
kind and writes out/heads.md and out/heads.json.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from snake_control.config import Config
from snake_control.control.joint_motion import Phase
from snake_control.control.posture_motion import PostureMotion
from snake_control.control.posture_way import PostureWays
from snake_control.experiment.cases import load_case
from snake_control.experiment.guided import GuidedRobot, GuidedSample, limited
from snake_control.experiment.rehearsal import rehearse
from snake_control.model.bodies import Bodies
from snake_control.trajectory.approach import Approach
from snake_control.trajectory.hold import Hold
from support.head_trajectories import feasible, hostile

Array = NDArray[np.float64]

START = np.array([0.0, 0.0, 0.2, math.pi / 8, math.pi / 8, 0.0])
"""Where the head is before each: w_d(0) of Table 1."""

TRANSIENT_S = 2.0
TRACKED_M = 0.005
WITHIN_S = 5.0


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came of one.

    Attributes:
        name: of the trajectory.
        servos: ``perfect`` or ``limited``.
        accepted: whether the rehearsal let it pass; always of a hostile one, which is given anyway.
        refusal: why not.
        completed: whether it was done within 1.5 times its time; of a hostile reference, whether a
            feasible one was tracked again within 5 s after it.
        fell: whether the robot fell.
        took: time as a share of the nominal one; of a hostile one, until tracked again [s].
        error_m, error_rad: median error after the transient, or at the end.
        range_rad, speed_rad_s: how far joints were beyond their ranges and speed limits, at most.
        d_min_m: the smallest.
        floor_m: the least height of a body of the head part above the floor.
        reasons: limits that slowed it or that the robot had to get away from.
        command: what had to be called before a feasible reference was tracked again, if anything.
    """

    name: str
    servos: str
    accepted: bool
    refusal: str
    completed: bool
    fell: bool
    took: float
    error_m: float
    error_rad: float
    range_rad: float
    speed_rad_s: float
    d_min_m: float
    floor_m: float
    reasons: tuple[str, ...]
    command: str = ""


@functools.cache
def config() -> Config:
    """The paper's robot in Case 3."""
    return load_case((), 3)


@functools.cache
def _settled() -> tuple[Array, Array]:
    """Joint angles and head pose with the head at ``START``, each process's own."""
    robot = GuidedRobot(config())
    approach = Approach(Hold(START), robot.state.w, 0.0, 15.0)
    for _ in robot.follow(approach.sample, 20.0, 60.0):
        pass
    return robot.state.phi, robot.state.w


def _robot(servos: str) -> GuidedRobot:
    phi, w = _settled()
    made = limited(config()) if servos == "limited" else None
    return GuidedRobot(config(), made, phi, w)


def try_feasible(number: int, servos: str = "perfect") -> Outcome:
    """Rehearse one and do it."""
    one = feasible(number + 1)[number]
    robot = _robot(servos)
    seen = list(robot.follow(Approach(Hold(one.start), robot.state.w, 0.0, 8.0).sample, 10.0, 30.0))
    rehearsal = rehearse(
        config(), robot.state.phi, robot.state.w, one.made(0.0).sample, one.duration
    )
    begin = robot.t
    followed = list(robot.follow(one.made(0.0).sample, one.duration, 3.0 * one.duration))
    took = (robot.t - begin) / one.duration
    errors = np.array(
        [_error(s) for s in followed if s.t > begin + TRANSIENT_S] or [[math.nan, math.nan]]
    )
    position, rotation = np.median(errors, axis=0).tolist()
    return _outcome(
        one.name,
        servos,
        robot,
        seen + followed,
        accepted=rehearsal.possible,
        refusal=rehearsal.text,
        completed=took <= 1.5,
        took=took,
        error_m=position,
        error_rad=rotation,
    )


def try_hostile(number: int, servos: str = "perfect") -> Outcome:
    """Give one, whatever the robot makes of it; then a feasible one."""
    robot = _robot(servos)
    one = hostile(robot.state.w, number + 1)[number]
    seen = list(robot.insist(one.reference, one.duration))
    after, tracked_after = _back_to_the_usual(robot)
    seen += after
    command = ""
    if tracked_after > WITHIN_S:
        command = "go_to_posture start"
        _go_to_start(robot)
        after, tracked_after = _back_to_the_usual(robot)
        seen += after
    position, rotation = _error(after[-1])
    return _outcome(
        one.name,
        servos,
        robot,
        seen,
        accepted=True,
        refusal="",
        completed=tracked_after <= WITHIN_S and math.isfinite(position),
        took=tracked_after,
        error_m=position,
        error_rad=rotation,
        command=command,
    )


def _back_to_the_usual(robot: GuidedRobot) -> tuple[list[GuidedSample], float]:
    """Go to the usual height and attitude from where the head is.

    Returns:
        What was seen, and after how long the head was on its reference for good [s].
    """
    w = robot.state.w
    goal = np.array([*w[:2], *START[2:5], w[5]])
    # The reference is stopped before another one is started.
    robot.pause()
    begin = robot.t
    after = list(robot.follow(Approach(Hold(goal), w, 0.0, 8.0).sample, 8.0, 30.0))
    off = [s.t - begin for s in after if _error(s)[0] > TRACKED_M]
    dt = 1.0 / config().scp_controller.rate_hz
    return after, off[-1] + dt if off else 0.0


def _go_to_start(robot: GuidedRobot) -> None:
    """Do what the action ``go_to_posture`` does with the posture ``start``."""
    c = config()
    ways = PostureWays(c.robot, c.supervisor)
    found = ways.find(robot.measured(), c.postures.angles("posture", "start"))
    assert found.corners, found.text
    own = c.scp_controller
    motion = PostureMotion(c.robot, own, c.supervisor, found, own.posture_speed_rad_s, robot.t)
    deadline = robot.t + motion.duration + 5.0
    phase = Phase.MOVING
    while not phase.over and robot.t < deadline:
        step = motion.step(robot.measured(), robot.t)
        phase = step.motion.phase
        assert not robot.turn(step.u).fallen
    assert phase is Phase.ARRIVED


def _error(sample: GuidedSample) -> tuple[float, float]:
    error = sample.state.w - sample.reference.w_d
    turned = np.abs((error[3:] + math.pi) % math.tau - math.pi).max()
    return float(np.linalg.norm(error[:3])), float(turned)


def _outcome(
    name: str, servos: str, robot: GuidedRobot, seen: Sequence[GuidedSample], **more: object
) -> Outcome:
    r = config().robot
    bounds = np.array(r.joint_limits_rad).reshape(-1, 2)
    phi = np.array([s.state.phi for s in seen] + [robot.state.phi])
    beyond = np.maximum(phi - bounds[:, 1], bounds[:, 0] - phi).max()
    u = np.array([s.result.u for s in seen if s.result is not None])
    too_fast = (np.abs(u) - np.array(r.joint_speed_limits_rad_s)).max()
    reasons: dict[str, None] = {}
    for sample in seen:
        if sample.result is not None:
            if sample.result.bound is not None:
                reasons[sample.result.bound.limit.value] = None
            reasons.update((limit.value, None) for limit in sample.result.escaping)
    return Outcome(
        name=name,
        servos=servos,
        fell=robot.state.fallen,
        range_rad=float(beyond),
        speed_rad_s=float(too_fast),
        d_min_m=min([s.state.d_min for s in seen] + [robot.state.d_min]),
        floor_m=min(Bodies(r, joints).ground_clearance for joints in phi),
        reasons=tuple(reasons),
        **more,  # type: ignore[arg-type]
    )


def table(title: str, outcomes: Sequence[Outcome], took: str) -> str:
    """Return a table of outcomes; ``took`` heads the column of times."""
    lines = [
        f"## {title}",
        "",
        f"| trajectory | servos | result | {took} | error [mm] | [rad] | d_min [mm] "
        "| above the floor [mm] | limits |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for o in outcomes:
        result = "fell" if o.fell else "ok" if o.completed else "not done"
        if not o.accepted:
            result = f"refused ({o.refusal})"
        lines.append(
            f"| {o.name} | {o.servos} | {result} | {o.took:.2f} | {1e3 * o.error_m:.2f} | "
            f"{o.error_rad:.4f} | {1e3 * o.d_min_m:.1f} | {1e3 * o.floor_m:.1f} | "
            f"{', '.join(o.reasons)}{' (' + o.command + ')' if o.command else ''} |"
        )
    return "\n".join(lines) + "\n"


def summary(feasible: Sequence[Outcome], hostile: Sequence[Outcome]) -> dict[str, object]:
    """Return the figures that count."""
    accepted = [o for o in feasible if o.accepted]
    every = [*feasible, *hostile]
    return {
        "feasible": len(feasible),
        "accepted": len(accepted),
        "completed": sum(o.completed for o in accepted),
        "median_error_mm": 1e3 * float(np.median([o.error_m for o in accepted] or [math.nan])),
        "median_error_rad": float(np.median([o.error_rad for o in accepted] or [math.nan])),
        "hostile": len(hostile),
        "tracked_again": sum(o.completed for o in hostile),
        "of_these_after_a_command": sum(o.completed and bool(o.command) for o in hostile),
        "fell": sum(o.fell for o in every),
        "least_above_floor_mm": 1e3 * min((o.floor_m for o in every), default=math.nan),
        "beyond_range_rad": max((o.range_rad for o in every), default=math.nan),
        "beyond_speed_rad_s": max((o.speed_rad_s for o in every), default=math.nan),
    }


def _call(task: tuple[str, int, str]) -> Outcome:
    kind, number, servos = task
    return (try_feasible if kind == "feasible" else try_hostile)(number, servos)


def main(argv: Sequence[str] | None = None) -> int:
    """Run; return the exit code, 1 if the robot fell or left its limits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--feasible", type=int, default=200)
    parser.add_argument("--hostile", type=int, default=100)
    parser.add_argument("--servos", choices=("perfect", "limited"), default="perfect")
    parser.add_argument("--out", type=Path, default=Path("out"))
    given = parser.parse_args(argv)
    tasks = [("feasible", i, given.servos) for i in range(given.feasible)]
    tasks += [("hostile", i, given.servos) for i in range(given.hostile)]
    begin = time.monotonic()
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for outcome in pool.map(_call, tasks):
            outcomes.append(outcome)
            if len(outcomes) % 10 == 0 or len(outcomes) == len(tasks):
                elapsed = time.monotonic() - begin
                print(f"{len(outcomes)} of {len(tasks)}, {elapsed:.0f} s", flush=True)
    of_robot, of_others = outcomes[: given.feasible], outcomes[given.feasible :]
    figures = summary(of_robot, of_others)
    given.out.mkdir(parents=True, exist_ok=True)
    text = "# Head trajectories\n\n" + "\n".join(f"* {k}: {v}" for k, v in figures.items()) + "\n\n"
    text += table("Those that the robot can do", of_robot, "time / nominal") + "\n"
    text += table("Those that it cannot or must not do", of_others, "tracked again after [s]")
    (given.out / "heads.md").write_text(text)
    (given.out / "heads.json").write_text(
        json.dumps(
            {"summary": figures, "outcomes": [dataclasses.asdict(o) for o in outcomes]}, indent=1
        )
    )
    print("\n".join(f"{k:20} {v}" for k, v in figures.items()))
    for outcome in outcomes:
        if outcome.fell or not outcome.completed or not outcome.accepted:
            print(f"{outcome.name}: {_words(outcome)}")
    print(f"written to {given.out / 'heads.md'}")
    safe = not figures["fell"] and outcomes and max(o.range_rad for o in outcomes) <= 0.0
    safe = safe and min(o.floor_m for o in outcomes) >= 0.0
    return 0 if safe else 1


def _words(outcome: Outcome) -> str:
    if outcome.fell:
        return "the robot fell"
    if not outcome.accepted:
        return f"refused: {outcome.refusal}"
    return f"not done; took {outcome.took:.2f}"


if __name__ == "__main__":
    sys.exit(main())
