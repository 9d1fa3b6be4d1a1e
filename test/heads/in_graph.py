"""The campaign of head trajectories through all nodes, bytes and the mock robot.

``python -m heads.in_graph`` in ``test`` (``make heads GRAPH=1``) does part of what
``heads.campaign`` does, by the wall clock, and writes out/heads_in_graph.md. The robot goes on from
where it is: each trajectory is moved to the place and heading that the head has by then.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration
from heads.campaign import START, TRACKED_M, TRANSIENT_S, WITHIN_S, Outcome, config, table
from numpy.typing import NDArray
from snake_interfaces.action import FollowHeadTrajectory, GoToPosture
from snake_interfaces.msg import BusState, ControllerState, HeadReference
from std_srvs.srv import Trigger

from snake_control.ax12.units import RAD_PER_TICK
from snake_control.control.reference import Reference
from snake_control.model.bodies import Bodies
from snake_control.nodes import topics
from snake_control.nodes.conversions import pose_array, pose_message, reference_message, stamp_ns
from support.action_client import Goals
from support.head_client import HeadClient
from support.head_trajectories import HOSTILE_KINDS, KINDS, feasible, hostile
from support.whole_graph import WholeGraph

Array = NDArray[np.float64]
Result = FollowHeadTrajectory.Result

_EVERY_S = 0.5
_PUBLISH_S = 0.02
_APPROACH_M_S = 0.02
_LONGEST_APPROACH_S = 30.0
_TRIES = 5
_WHILE_S = 2.0
_SPEED_ROUNDING = 1e-9
_LIMITS = {
    getattr(ControllerState, name): name.removeprefix("REASON_").lower()
    for name in dir(ControllerState)
    if name.startswith("REASON_")
}


class _Again(NamedTuple):
    """How a feasible goal was followed after a hostile reference.

    Attributes:
        tracked_after: how long it took until the head was on its reference [s].
        arrived: what the action says.
        error_m, error_rad: at the end.
    """

    tracked_after: float
    arrived: bool
    error_m: float
    error_rad: float

    @property
    def good(self) -> bool:
        return self.arrived and self.tracked_after <= WITHIN_S


class Campaign:
    """Tries trajectories one after the other on one robot."""

    def __init__(self, robot: WholeGraph) -> None:
        """Take over a robot that waits for a reference."""
        self._robot, self._graph = robot, robot.graph
        self._client = HeadClient(robot)
        self._postures = Goals(robot.graph, topics.GO_TO_POSTURE)
        self._reference: Callable[[float], Reference] | None = None
        self._since = 0
        t = topics.HEAD_REFERENCE
        self._insisting = self._graph.publisher(t)
        self._graph.every(_PUBLISH_S, self._insist)

    def try_feasible(self, number: int) -> Outcome:
        """Go to its start; send it as a goal."""
        self._begin()
        one = feasible(number + 1)[number]
        place = _place(one.start, self._robot.w)
        self._go_to(place(one.start))
        self._forget()
        begin = self._graph.now_ns()
        motion = one.made(0.0)
        times = np.append(
            np.arange(_EVERY_S, one.duration - 0.5 * _EVERY_S, _EVERY_S), one.duration
        )
        poses = [pose_message(place(motion.sample(t).w_d)) for t in times.tolist()]
        stamps = [Duration(sec=int(t), nanosec=round((t % 1.0) * 1e9)) for t in times.tolist()]
        self._client.send(poses, time_from_start=stamps)
        _, result = self._client.result(3.0 * one.duration + 30.0)
        moving = [f for f in self._client.feedback if f.phase == "moving"]
        pursued = self._pursued(begin, TRANSIENT_S)
        took = 0.1 * len(moving) / one.duration
        position, rotation = np.median(pursued[:, 1:], axis=0).tolist()
        return self._outcome(
            one.name,
            begin,
            accepted=result.code != Result.UNREACHABLE,
            refusal=result.text if result.code == Result.UNREACHABLE else "",
            completed=result.code == Result.NONE and took <= 1.5,
            took=took,
            error_m=position,
            error_rad=rotation,
        )

    def try_hostile(self, number: int) -> Outcome:
        """Send its reference, whatever the controller says; then a feasible goal."""
        self._begin()
        self._go_to(_usual(self._robot.w))
        self._client.stop()
        self._forget()
        begin = self._graph.now_ns()
        one = hostile(self._robot.w, number + 1)[number]
        self._since, self._reference = begin, one.reference
        self._graph.wait_for(
            lambda: self._graph.now_ns() - begin > one.duration * 1e9, one.duration + 20.0, one.name
        )
        self._reference = None
        self._graph.wait_for(
            lambda: self._robot.states.last.reference_age > 0.25, 10.0, "the reference to cease"
        )
        commands = self._recover()
        again = self._back_to_the_usual()
        if not again.good:
            commands += [*self._recover(), *self._go_to_start()]
            again = self._back_to_the_usual()
        return self._outcome(
            one.name,
            begin,
            accepted=True,
            refusal="",
            completed=again.good,
            took=again.tracked_after,
            error_m=again.error_m,
            error_rad=again.error_rad,
            command=", ".join(commands),
        )

    def _begin(self) -> None:
        self._recover()
        self._go_to_start()

    def _back_to_the_usual(self) -> _Again:
        """Go to the usual height and attitude from where the head is."""
        begin = self._graph.now_ns()
        self._client.feedback.clear()
        self._client.send(
            [pose_message(_usual(self._robot.w))], speed=_APPROACH_M_S, skip_rehearsal=True
        )
        arrived = self._client.end(_LONGEST_APPROACH_S) and self._client.result()[1].code == 0
        pursued = self._pursued(begin, 0.0)
        if not len(pursued):
            return _Again(math.inf, arrived, math.nan, math.nan)
        return _Again(_tracked_after(pursued), arrived, *pursued[-1, 1:].tolist())

    def _recover(self) -> list[str]:
        """Have a driver that stopped go on, as docs/recovery.md says; return what was called."""
        if self._robot.bus.last.state != BusState.STATE_STOPPED:
            return []
        why = self._robot.bus.last.text
        self._graph.wait_for(
            lambda: self._graph.call("bus_driver", topics.RECOVER, Trigger.Request()).success,
            20.0,
            f"a recovery that succeeds, after {why}",
        )
        self._graph.wait_for(
            lambda: self._robot.bus.last.state == BusState.STATE_MOVING, 20.0, "the driver to move"
        )
        return [f"recover ({why})"]

    def _go_to_start(self) -> list[str]:
        """Go to the posture of Table 1; return what was called."""
        self._client.stop()
        _, result = self._postures.do(120.0, posture="start")
        assert result.code == GoToPosture.Result.NONE, result.text
        return ["go_to_posture start"]

    def _go_to(self, w: Array) -> None:
        self._client.feedback.clear()
        for _ in range(_TRIES):
            self._client.send([pose_message(w)], speed=_APPROACH_M_S, skip_rehearsal=True)
            _, result = self._client.result(120.0)
            # The nodes may have just been started.
            if result.code != Result.NO_HEAD:
                break
        assert result.code == Result.NONE, result.text
        self._client.feedback.clear()

    def _forget(self) -> None:
        for recorder in (
            self._robot.truth,
            self._robot.commands,
            self._robot.references,
            self._robot.states,
        ):
            recorder.clear()
        self._graph.wait_for(lambda: self._robot.truth.last, 10.0, "ground truth")

    def _insist(self) -> None:
        if self._reference is not None:
            now = self._graph.now_ns()
            reference = self._reference((now - self._since) * 1e-9)
            # Of angles that are not finite no quaternion can be made.
            w_d = np.where(np.isfinite(reference.w_d), reference.w_d, math.nan)
            reference = Reference(w_d, reference.w_d_dot)
            self._insisting.publish(reference_message(reference, now, "world"))

    def _pursued(self, begin: int, after_s: float) -> Array:
        """Return time [s] and true error of the head [m, rad] at every reference, (k, 3)."""
        truth = self._robot.truth.messages
        t = np.array([stamp_ns(m) - begin for m in truth]) * 1e-9
        w = np.unwrap(np.array([m.w for m in truth]), axis=0, period=math.tau)
        rows = []
        references: list[HeadReference] = self._robot.references.messages
        for message in references:
            now = (stamp_ns(message) - begin) * 1e-9
            if after_s <= now <= t[-1]:
                true = np.array([np.interp(now, t, w[:, i]) for i in range(6)])
                error = true - pose_array(message.pose)
                turned = np.abs((error[3:] + math.pi) % math.tau - math.pi).max()
                rows.append((now, float(np.linalg.norm(error[:3])), float(turned)))
        return np.array(rows)

    def _outcome(self, name: str, begin: int, **more: object) -> Outcome:
        r = config().robot
        truth = self._robot.truth_after(begin)
        bounds = np.array(r.joint_limits_rad).reshape(-1, 2)
        phi = np.array([m.phi for m in truth])
        u = np.array([m.velocity for m in self._robot.commands.messages])
        reasons = {
            _LIMITS[reason]: None
            for state in self._robot.states.messages
            for reason in state.reasons
            if stamp_ns(state) > begin
        }
        return Outcome(
            name=name,
            servos="mock",
            fell=any(m.fallen for m in truth),
            range_rad=float(np.maximum(phi - bounds[:, 1], bounds[:, 0] - phi).max()),
            speed_rad_s=float((np.abs(u) - np.array(r.joint_speed_limits_rad_s)).max()),
            d_min_m=min(m.d_min for m in truth),
            floor_m=min(Bodies(r, joints).ground_clearance for joints in phi),
            reasons=tuple(reasons),
            **more,  # type: ignore[arg-type]
        )


def _tracked_after(pursued: Array) -> float:
    """Return after how long the head is on its reference, for ``_WHILE_S`` or to the end [s].

    Not for good: at any later time a servo may stick and slip, or the computer pause.
    """
    t = pursued[:, 0] - pursued[0, 0]
    since = 0.0
    on_it = False
    for now, error in zip(t.tolist(), pursued[:, 1].tolist(), strict=True):
        on_it = error <= TRACKED_M
        if not on_it:
            since = now
        elif now - since >= _WHILE_S:
            break
    return since if on_it else math.inf


def _place(start: Array, w: Array) -> Callable[[Array], Array]:
    """Return what moves poses on the floor so that ``start`` comes to where ``w`` is."""
    turn = w[5] - start[5]
    c, s = math.cos(turn), math.sin(turn)

    def placed(pose: Array) -> Array:
        x, y = pose[:2] - start[:2]
        return np.array([w[0] + c * x - s * y, w[1] + s * x + c * y, *pose[2:5], pose[5] + turn])

    return placed


def _usual(w: Array) -> Array:
    """Return the usual height and attitude at the place and heading of ``w``."""
    return np.array([*w[:2], *START[2:5], w[5]])


def main(argv: Sequence[str] | None = None) -> int:
    """Run; return the exit code, 1 if the robot fell, left its limits, or was not done."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--feasible", type=int, default=2, help="so many of each kind")
    parser.add_argument("--hostile", type=int, default=len(HOSTILE_KINDS))
    parser.add_argument("--out", type=Path, default=Path("out"))
    given = parser.parse_args(argv)
    of_robot, of_others = [], []
    with tempfile.TemporaryDirectory() as directory, WholeGraph(Path(directory)) as robot:
        campaign = Campaign(robot)
        for number in shortest(given.feasible):
            of_robot.append(campaign.try_feasible(number))
            print(_line(of_robot[-1]), flush=True)
        for number in range(given.hostile):
            of_others.append(campaign.try_hostile(number))
            print(_line(of_others[-1]), flush=True)
    given.out.mkdir(parents=True, exist_ok=True)
    text = "# Head trajectories through all nodes\n\n"
    text += table("Those that the robot can do", of_robot, "time / nominal") + "\n"
    text += table("Those that it cannot or must not do", of_others, "tracked again after [s]")
    (given.out / "heads_in_graph.md").write_text(text)
    print(f"written to {given.out / 'heads_in_graph.md'}")
    return 0 if all(holds(o) for o in (*of_robot, *of_others)) else 1


def shortest(of_each_kind: int) -> list[int]:
    """Return the numbers of the shortest feasible trajectories of each kind, shortest first."""
    seconds = [one.duration for one in feasible()]
    by_kind = (range(kind, len(seconds), len(KINDS)) for kind in range(len(KINDS)))
    chosen = (sorted(kind, key=seconds.__getitem__)[:of_each_kind] for kind in by_kind)
    return sorted(itertools.chain.from_iterable(chosen), key=seconds.__getitem__)


def give_rad() -> float:
    """Return how far a load may push a joint beyond its range: by its compliance [rad]."""
    servos = config().servos
    margins, slopes = servos.compliance_margin_ticks, servos.compliance_slope
    return RAD_PER_TICK * max(m + s for m, s in zip(margins, slopes, strict=True))


def holds(outcome: Outcome) -> bool:
    """Return whether it went as it should."""
    safe = (
        not outcome.fell
        and outcome.range_rad <= give_rad()
        and outcome.speed_rad_s <= _SPEED_ROUNDING
    )
    return safe and (outcome.completed or not outcome.accepted)


def _line(o: Outcome) -> str:
    what = "fell" if o.fell else "ok" if holds(o) else "NOT DONE"
    return (
        f"{o.name:28} {what:9} {o.refusal or ''} took {o.took:.2f}  {1e3 * o.error_m:.2f} mm "
        f"{o.error_rad:.4f} rad  d_min {1e3 * o.d_min_m:.1f} mm  "
        f"above floor {1e3 * o.floor_m:.1f} mm  range {o.range_rad:+.3f} rad  "
        f"{', '.join(o.reasons)}  {o.command}"
    )


if __name__ == "__main__":
    sys.exit(main())
