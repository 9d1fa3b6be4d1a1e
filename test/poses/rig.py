"""The whole graph with its head on a line, on which one fault after the other is tried."""

from __future__ import annotations

import dataclasses
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from snake_interfaces.msg import ControllerState, PlantState, PoseStatus
from std_srvs.srv import Trigger

from poses.rows import Row
from snake_control.config import load
from snake_control.nodes import topics
from snake_control.nodes.conversions import array, stamp_ns
from snake_control.nodes.recorder import FOLLOWING
from support.graph import CONFIG
from support.whole_graph import WholeGraph

VELOCITY_M_S = 0.02
_BEFORE_S = 1.0
_AFTER_S = 1.5
_LONGEST_S = 30.0
_NEAR_M = 0.02
_NEWEST = 100
_TRIES = 4
_STALL_S = 0.05
"""Half of the time for which an input counts as fresh: lateness adds up on the way to the bus."""
_STATUS_PERIOD_S, _TRUTH_PERIOD_S = 0.1, 0.02

_CONTROLLER = {
    getattr(ControllerState, name): name.removeprefix("STATUS_")
    for name in dir(ControllerState)
    if name.startswith("STATUS_")
}


@dataclasses.dataclass
class Outcome:
    """What a fault led to.

    Attributes:
        states: of the controller, in the order in which each came first.
        texts: those of the head pose that were heard first, by status and reason.
        stop_s: from the last pose that was believed to the first command to rest [s].
        error_m, error_after_m: largest distance of the head from its reference, by the ground
            truth, while the fault lasted and from then on [m].
        error_before_m: the same before.
        back_s: from the end of the fault until the reference was followed [s]; 0 if always.
        stalled_s: by how much the nodes were later than their periods at worst, all together [s].
        violations: what must not be, but for what keeps nodes waiting.
        dangers: what must not be in any case.
        tries: how often it was tried.
    """

    states: list[str] = dataclasses.field(default_factory=list)
    texts: list[str] = dataclasses.field(default_factory=list)
    stop_s: float = math.nan
    error_before_m: float = math.nan
    error_m: float = math.nan
    error_after_m: float = math.nan
    back_s: float = math.nan
    stalled_s: float = 0.0
    violations: list[str] = dataclasses.field(default_factory=list)
    dangers: list[str] = dataclasses.field(default_factory=list)
    tries: int = 1

    @property
    def failures(self) -> list[str]:
        return [*self.dangers, *self.violations]


class Rig:
    """The graph, started when it is needed, and anew after a run that left it unfit."""

    def __init__(self) -> None:
        self._config = load(CONFIG / "paper_robot.yaml")
        self._directory: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop()

    def run(self, row: Row) -> Outcome:
        """Let a fault happen and judge what becomes of it.

        Once more where the machine kept nodes waiting, for that shows nothing, unless the robot
        was in danger: that must not be on any machine.

        Raises:
            AssertionError: the robot did not get as far.
        """
        for tries in range(1, _TRIES + 1):
            try:
                outcome = self._run(row)
            except BaseException:
                self._stop()
                raise
            outcome.tries = tries
            if not outcome.failures:
                break
            self._stop()
            if outcome.dangers or outcome.stalled_s < _STALL_S:
                break
            late = f"nodes were {outcome.stalled_s:.2f} s late"
            print(f"  {row.name}, {late}: {'; '.join(outcome.violations)}", flush=True)
        return outcome

    def _start(self) -> None:
        """Start the graph and the head on its endless line along x."""
        if self._directory is not None:
            return
        directory = tempfile.TemporaryDirectory(prefix="poses_")
        line = {"start_from": "head", "velocity": [VELOCITY_M_S, 0.0, 0.0, 0.0, 0.0, 0.0]}
        self._robot = WholeGraph(Path(directory.name), trajectory_generator=line)
        try:
            self._robot.__enter__()
        except BaseException:
            directory.cleanup()
            raise
        self._directory = directory
        self._head = self._robot.graph.subscribe(topics.HEAD_STATUS)
        self._odometry = self._robot.graph.subscribe(topics.HEAD_ODOMETRY)

        def started() -> bool:
            """Without a fresh pose at this moment, on a busy machine, it does not start."""
            call = self._robot.graph.call
            return call("trajectory_generator", topics.START, Trigger.Request()).success

        self._robot.graph.wait_for(started, _LONGEST_S, "the start of the line")

    def _stop(self) -> None:
        if self._directory is not None:
            self._robot.__exit__(None, None, None)
            self._directory.cleanup()
        self._directory = None

    def _run(self, row: Row) -> Outcome:
        self._start()
        robot, graph = self._robot, self._robot.graph
        self._wait_until_steady()
        for recorder in (robot.truth, robot.commands, robot.references, robot.states):
            recorder.clear()
        self._head.clear()
        self._odometry.clear()
        self._pass(graph.now_ns(), _BEFORE_S)
        request = topics.INJECT_FAULT.type.Request(
            fault=row.fault.kind,
            duration=row.fault.duration_s,
            value=row.fault.value or 0.0,
            probability=row.fault.probability,
        )
        asked_ns = graph.now_ns()
        response = graph.call("mock_bus", topics.INJECT_FAULT, request)
        assert response.success, response.message
        # It is over no later than this.
        end_ns = graph.now_ns() + round(row.fault.duration_s * 1e9)
        self._pass(end_ns, 0.0)
        graph.wait_for(
            lambda: self._followed_since(end_ns) is not None, _LONGEST_S, "the reference followed"
        )
        self._pass(self._followed_since(end_ns) or end_ns, _AFTER_S)
        return self._judge(row, asked_ns, end_ns)

    def _wait_until_steady(self) -> None:
        """Wait until the head has followed for a while, with a valid pose."""
        since_ns = self._robot.graph.now_ns()

        def steady() -> bool:
            now_ns = self._robot.graph.now_ns()
            bad = [
                stamp_ns(state)
                for state in self._robot.states.messages[-_NEWEST:]
                if state.status not in FOLLOWING
            ]
            newest = max([since_ns, *bad])
            head = self._head.last
            return (
                now_ns - newest > 5e8
                and head is not None
                and head.status == PoseStatus.STATUS_VALID
                and self._largest_error(self._robot.truth.messages[-1:], 0, math.inf, _NEWEST)
                < _NEAR_M
            )

        self._robot.graph.wait_for(steady, _LONGEST_S, "a head that follows steadily")

    def _pass(self, since_ns: int, seconds: float) -> None:
        until_ns = since_ns + round(seconds * 1e9)
        self._robot.graph.wait_for(
            lambda: self._robot.truth.last and stamp_ns(self._robot.truth.last) > until_ns,
            seconds + _LONGEST_S,
            "time to pass",
        )

    def _followed_since(self, end_ns: int) -> int | None:
        """Stamp of the state with which the reference was followed again, and still is."""
        states = [s for s in self._robot.states.messages if stamp_ns(s) > end_ns]
        if not states or states[-1].status not in FOLLOWING:
            return None
        bad = [k for k, state in enumerate(states) if _stopped_by_pose(state)]
        return stamp_ns(states[bad[-1] + 1 if bad else 0])

    def _judge(self, row: Row, asked_ns: int, end_ns: int) -> Outcome:
        robot, found = self._robot, Outcome()
        truth = robot.truth.messages
        during = [s for s in robot.states.messages if stamp_ns(s) >= asked_ns]
        for state in during:
            name = _CONTROLLER[state.status]
            ours = state.status in FOLLOWING or _stopped_by_pose(state)
            if ours and name not in found.states:
                found.states.append(name)
        heard = [s for s in self._head.messages if stamp_ns(s) >= asked_ns]
        kinds: set[tuple[int, int, bool]] = set()
        for status in heard:
            kind = (status.status, status.reason, ";" in status.text)
            if kind not in kinds and status.text != "valid":
                kinds.add(kind)
                found.texts.append(status.text)
        followed_ns = self._followed_since(end_ns) or end_ns
        stopped_after = any(_stopped_by_pose(s) for s in during if stamp_ns(s) > end_ns)
        found.back_s = (followed_ns - end_ns) * 1e-9 if stopped_after else 0.0
        found.error_before_m = self._largest_error(truth, 0, asked_ns)
        found.error_m = self._largest_error(truth, asked_ns, end_ns)
        found.error_after_m = self._largest_error(truth, end_ns, math.inf)
        found.stalled_s = self._stalled_s(asked_ns)
        self._judge_stop(row, asked_ns, end_ns, found)
        self._judge_safety(truth, found)
        if row.says and not any(row.says in status.text for status in heard):
            found.violations.append(f"nothing said of '{row.says}'")
        if found.back_s > row.back_within_s:
            found.violations.append(
                f"followed {found.back_s:.2f} s after it (limit {row.back_within_s:g} s)"
            )
        return found

    def _judge_stop(self, row: Row, asked_ns: int, end_ns: int, found: Outcome) -> None:
        own = self._config.scp_controller
        commands = [c for c in self._robot.commands.messages if stamp_ns(c) >= asked_ns]
        # Short faults are over before they are noticed.
        until_ns = max(end_ns, asked_ns + round(2e8))
        states = [s for s in self._robot.states.messages if asked_ns <= stamp_ns(s) < until_ns]
        rest_ns = next((stamp_ns(s) for s in states if _stopped_by_pose(s)), None)
        if rest_ns is None:
            if row.stops:
                found.violations.append("the robot was not stopped")
            return
        if any(np.any(c.velocity) for c in commands if stamp_ns(c) == rest_ns):
            found.dangers.append("a command to move although the controller says it stopped")
        if row.stops is False:
            texts = {s.text: None for s in states if _stopped_by_pose(s)}
            found.violations.append(f"the robot was stopped: {'; '.join(texts)}")
        stamps = [stamp_ns(m) for m in self._odometry.messages]
        believed_ns = max((s for s in stamps if s <= rest_ns), default=rest_ns)
        found.stop_s = (rest_ns - believed_ns) * 1e-9
        # Only what it waits for, and two steps to notice.
        limit_s = own.head_timeout_s + 2.0 / own.rate_hz
        if found.stop_s > limit_s:
            found.violations.append(f"rest only {found.stop_s:.3f} s after the last good pose")
        if not row.rests:
            return
        # It was asked for, so it is surely over this much before `end_ns`; begins within that.
        sure_ns = asked_ns + round(row.fault.duration_s * 1e9)
        # A stall while the joints bridge the gap may stop it, too; what counts is the end of that.
        last_ns = max((s for s in stamps if s < sure_ns), default=rest_ns)
        from_ns = max(rest_ns, last_ns + round(limit_s * 1e9))
        moved = [c for c in commands if from_ns < stamp_ns(c) < sure_ns and np.any(c.velocity)]
        if moved:
            found.violations.append(f"{len(moved)} commands to move while it lasted")

    def _stalled_s(self, since_ns: int) -> float:
        """Sum over mock, pose input and controller of how late each was at worst [s].

        From what each of them says at its own pace, whatever becomes of the poses.
        """
        late = 0.0
        for recorder, period_s in (
            (self._robot.truth, _TRUTH_PERIOD_S),
            (self._head, _STATUS_PERIOD_S),
            (self._robot.states, 1.0 / self._config.scp_controller.rate_hz),
        ):
            stamps = [stamp_ns(m) for m in recorder.messages if stamp_ns(m) >= since_ns]
            late += max(0.0, np.max(np.diff(stamps), initial=0) * 1e-9 - period_s)
        return late

    def _judge_safety(self, truth: list[PlantState], found: Outcome) -> None:
        if truth[-1].fallen:
            found.dangers.append("the robot fell")
        robot = self._config.robot
        phi = np.array([state.phi for state in truth])
        for i, name in enumerate(robot.joint_names):
            lower, upper = robot.joint_range(i + 1)
            if phi[:, i].min() < lower or phi[:, i].max() > upper:
                found.dangers.append(f"{name} left its range")

    def _largest_error(
        self, truth: list[PlantState], begin_ns: float, end_ns: float, newest: int = 0
    ) -> float:
        """Largest distance of the true head from its reference between two times [m].

        ``newest``: look for it among so many references only, for who asks often; 0: all.
        """
        references: list[Any] = self._robot.references.messages[-newest:]
        times = np.array([stamp_ns(m) for m in references])
        places = np.array([array(m.pose.position) for m in references])
        largest = math.nan
        for state in truth:
            time_ns = stamp_ns(state)
            k = int(np.searchsorted(times, time_ns)) - 1
            if begin_ns <= time_ns < end_ns and k >= 0:
                error = float(np.linalg.norm(np.array(state.w[:3]) - places[k]))
                largest = error if math.isnan(largest) else max(largest, error)
        return largest


def _stopped_by_pose(state: ControllerState) -> bool:
    """Whether a state is at rest for another reason than what a busy machine does to the bus."""
    ours = state.text.startswith(("joint_states", "bus_driver"))
    return state.status not in FOLLOWING and not ours
