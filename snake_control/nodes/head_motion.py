"""Motions of the head that somebody asked for: from the request to its end.

A request is planned and rehearsed while whatever went on before goes on. When it begins, it takes
over from where the reference is, with its rate; when it is refused, nothing has changed. A newer
request takes the place of one that has not begun.
"""

from __future__ import annotations

import dataclasses
import math
import threading
from collections.abc import Callable
from concurrent.futures import Future

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.task import Future as RosFuture
from snake_interfaces.msg import ControllerState, HeadTrajectoryStatus

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.control.supervisor import NO_ANSWER
from snake_control.errors import SnakeError
from snake_control.experiment.rehearsal import Rehearsal
from snake_control.model.rotation import wrap
from snake_control.nodes import topics
from snake_control.nodes.conversions import header
from snake_control.nodes.endpoints import Endpoints
from snake_control.nodes.rehearsals import (
    INPUT_WAIT_S,
    NO_HEAD,
    Movable,
    Rehearsals,
    Surroundings,
    in_words,
    wait_for_inputs,
    what_is_missing,
)
from snake_control.trajectory.plan import Course, Plan
from snake_control.trajectory.segments import line_to
from snake_control.trajectory.sequence import Outcome, ReferenceSequence

Array = NDArray[np.float64]
Status = HeadTrajectoryStatus

_STATUS_PERIOD_S = 0.1
_STOPPED_AFTER_S = 1.0
_STOPS = (
    ControllerState.STATUS_DISABLED,
    ControllerState.STATUS_STALE,
    ControllerState.STATUS_INVALID,
    ControllerState.STATUS_FAULT,
    ControllerState.STATUS_ERROR_TOO_LARGE,
    ControllerState.STATUS_STOPPED,
    ControllerState.STATUS_POSTURE,
    ControllerState.STATUS_RESHAPING,
)
_REFUSALS = (Status.INVALID, Status.NO_HEAD, Status.UNREACHABLE)


@dataclasses.dataclass(frozen=True)
class Request:
    """What somebody asks for.

    Attributes:
        source: who, for texts.
        course: makes the course for the time at which it begins [s, steady clock]; another thread
            calls it. What is wrong with it is a ``SnakeError``.
        is_dated: whether the course depends on that time.
        skip_rehearsal: do not try it on the model first.
        begins_at: not before this time [s, steady clock].
        goes_back: whether it is a way back.
        on_status: told of every change, ten times a second meanwhile, and of the end.
        is_canceled: whether it shall end.
    """

    source: str
    course: Callable[[float], Course]
    is_dated: bool = False
    skip_rehearsal: bool = False
    begins_at: float = -math.inf
    goes_back: bool = False
    on_status: Callable[[Status], None] = lambda status: None
    is_canceled: Callable[[], bool] = lambda: False


@dataclasses.dataclass(frozen=True)
class _Prepared:
    course: Course
    start: Reference
    plan: Plan
    found: Rehearsal | None


@dataclasses.dataclass(eq=False)
class _Run:
    id: int
    request: Request
    since: float
    begun: RosFuture = dataclasses.field(default_factory=RosFuture)
    over: threading.Event = dataclasses.field(default_factory=threading.Event)
    job: Future[_Prepared] | None = None
    plan: Plan | None = None
    phase: str = ""
    headless_since: float | None = None
    began: float | None = None
    arriving_since: float | None = None
    stopped_since: float | None = None
    stopping: bool = False
    told_at: float = -math.inf


class HeadMotion:
    """Carries out requests; ``step`` is called with every reference that is sent."""

    def __init__(
        self,
        node: Node,
        ends: Endpoints,
        own: TrajectoryGeneratorConfig,
        rehearsals: Rehearsals,
        sequence: ReferenceSequence,
        on_path: Callable[[Movable], None],
    ) -> None:
        """Wait for requests.

        Args:
            node, ends: where.
            own: the generator's own group.
            rehearsals: try motions on the model.
            sequence: what sends references.
            on_path: told of a motion that begins.
        """
        self._node = node
        self._own = own
        self._sequence = sequence
        self._on_path = on_path
        self._count = 0
        self._now: _Run | None = None
        self._next: _Run | None = None
        self._last_begin: Array | None = None
        self._rehearsals = rehearsals
        self._status = ends.publisher(topics.HEAD_TRAJECTORY_STATUS)

    def ask(self, request: Request, now: float) -> RosFuture:
        """Take a request; the future's result is an ``Outcome``: whether it began, or why not."""
        if self._next is not None:
            self._end(self._next, Status.PREEMPTED, "a newer request took its place")
        self._count += 1
        self._next = _Run(self._count, request, now)
        return self._next.begun

    def go_back(self, now: float) -> RosFuture | None:
        """Ask for the way back to where the last motion began; ``None`` if there was none."""
        begin = self._last_begin
        if begin is None:
            return None
        back = Course((line_to(begin),), names=("the way back",))
        return self.ask(Request("~/return", lambda _: back, goes_back=True), now)

    def note_begin(self, pose: Array) -> None:
        """Remember where a motion begins that nobody asked for here."""
        self._last_begin = pose

    def take_over(self, by: str) -> None:
        """End all requests because something else gives the reference from now on."""
        for run in (self._next, self._now):
            if run is not None:
                self._end(run, Status.PREEMPTED, f"{by} took over")

    def let_stop(self) -> None:
        """End a motion when the head has come to rest: ``~/stop`` was called."""
        if self._next is not None:
            self._end(self._next, Status.CANCELED, "canceled")
        if self._now is not None:
            self._now.stopping = True

    def step(self, around: Surroundings) -> None:
        """Go on with what was asked for."""
        if self._next is not None:
            self._step_next(self._next, around)
        if self._now is not None:
            self._step_now(self._now, around)

    # Before it begins.

    def _step_next(self, run: _Run, around: Surroundings) -> None:
        if run.request.is_canceled():
            self._end(run, Status.CANCELED, "canceled", around)
        elif run.job is None:
            self._submit(run, around)
        elif not run.job.done():
            self._tell(run, around, "rehearsing")
        elif around.now < run.request.begins_at:
            if self._prepared(run, run.job, around) is not None:
                self._tell(run, around, "waiting")
        else:
            self._begin(run, run.job, around)

    def _submit(self, run: _Run, around: Surroundings) -> None:
        bold = run.request.skip_rehearsal
        if wait_for_inputs(run.since, around, bold):
            return
        start = self._sequence.here(around.now, around.head)
        missing = what_is_missing(start, around, bold)
        if missing or start is None:
            self._end(run, Status.NO_HEAD, missing, around)
            return
        # What it needs, for the other thread.
        course, own, now, over = run.request.course, self._own, around.now, run.over.is_set
        rehearsals = self._rehearsals

        def prepare() -> _Prepared:
            made = course(now)
            plan = Plan(own, made, start)
            found = None if bold else rehearsals.rehearse(plan, around, over)
            return _Prepared(made, start, plan, found)

        run.job = rehearsals.submit(prepare)

    def _prepared(
        self, run: _Run, job: Future[_Prepared], around: Surroundings
    ) -> _Prepared | None:
        """Return what was prepared; ``None`` if the run has ended because it cannot be."""
        try:
            prepared = job.result()
        except SnakeError as error:
            self._end(run, Status.INVALID, str(error), around)
            return None
        except NO_ANSWER as error:
            self._end(run, Status.UNREACHABLE, f"the rehearsal failed: {error}", around)
            return None
        found = prepared.found
        if found is not None and not found.possible:
            self._end(run, Status.UNREACHABLE, in_words(prepared.plan, found), around)
            return None
        return prepared

    def _begin(self, run: _Run, job: Future[_Prepared], around: Surroundings) -> None:
        prepared = self._prepared(run, job, around)
        if prepared is None:
            return
        start = self._sequence.here(around.now, around.head)
        if start is None:
            # A rehearsal can keep a busy computer from hearing the head just when it ends.
            since = run.headless_since = run.headless_since or around.now
            if around.now - since < INPUT_WAIT_S:
                self._tell(run, around, "waiting")
            else:
                self._end(run, Status.NO_HEAD, NO_HEAD, around)
            return
        plan = prepared.plan
        # Preparing has taken a moment, in which the reference may have gone on.
        if run.request.is_dated or not _is_same(start, prepared.start):
            try:
                course = prepared.course
                if run.request.is_dated:
                    course = run.request.course(around.now)
                plan = Plan(self._own, course, start)
            except SnakeError as error:
                self._end(run, Status.INVALID, str(error), around)
                return
        if self._now is not None:
            self._end(self._now, Status.PREEMPTED, f"{run.request.source} took over", around)
        self._next, self._now = None, run
        run.plan, run.began = plan, self._sequence.motion_time(around.now)
        if not run.request.goes_back:
            self._last_begin = plan.begin
        self._sequence.follow(plan.made(), around.now)
        self._on_path(plan)
        words = f"following {run.request.source}: {plan.duration:.1f} s, {plan.length:.2f} m"
        self._node.get_logger().info(words)
        run.begun.set_result(Outcome(True, words))

    # When it has begun.

    def _step_now(self, run: _Run, around: Surroundings) -> None:
        if run.request.is_canceled() and not run.stopping:
            run.stopping = True
            self._sequence.stop(around.now)
        if run.stopping:
            self._tell(run, around, "stopping")
            if self._sequence.idle:
                self._end(run, Status.CANCELED, "canceled", around)
        else:
            self._watch(run, around)

    def _watch(self, run: _Run, around: Surroundings) -> None:
        assert run.plan is not None
        assert run.began is not None
        controller = around.controller
        if controller is not None and controller.status in _STOPS:
            since = run.stopped_since = run.stopped_since or around.now
            if around.now - since > _STOPPED_AFTER_S:
                self._sequence.stop(around.now)
                self._end(run, Status.STOPPED, f"the controller: {controller.text}", around)
                return
        else:
            run.stopped_since = None
        if self._sequence.motion_time(around.now) < run.began + run.plan.duration:
            self._tell(run, around, "moving")
            return
        since = run.arriving_since = run.arriving_since or around.now
        self._tell(run, around, "arriving")
        position, rotation = self._error(around)
        if position <= self._own.arrival_position_m and rotation <= self._own.arrival_rotation_rad:
            run.told_at = -math.inf
            self._tell(run, around, "arriving")
            self._end(run, Status.NONE, "arrived", around)
        elif around.now - since > self._own.arrival_timeout_s:
            text = f"the head is still {1e3 * position:.0f} mm and {rotation:.2f} rad away"
            if controller is not None:
                text += f"; the controller: {controller.text}"
            self._end(run, Status.STOPPED, text, around)

    def _error(self, around: Surroundings) -> tuple[float, float]:
        here = self._sequence.here(around.now, None)
        if here is None or around.head is None:
            return math.nan, math.nan
        off = around.head - here.w_d
        return float(np.linalg.norm(off[:3])), float(np.abs(wrap(off[3:])).max())

    # What others are told.

    def _tell(self, run: _Run, around: Surroundings, phase: str) -> None:
        if phase == run.phase and around.now - run.told_at < _STATUS_PERIOD_S:
            return
        run.phase, run.told_at = phase, around.now
        status = self._status_of(run, around)
        self._status.publish(status)
        run.request.on_status(status)

    def _status_of(self, run: _Run, around: Surroundings | None) -> Status:
        status = Status(source=run.request.source, id=run.id, phase=run.phase)
        now = self._node.get_clock().now().nanoseconds
        status.header = header(now, self._own.frame_id)
        status.time_scale = self._sequence.time_scale
        status.position_error = status.rotation_error = math.nan
        if around is None:
            return status
        if run.began is not None and run.plan is not None:
            elapsed = self._sequence.motion_time(around.now) - run.began
            status.progress = min(1.0, elapsed / run.plan.duration)
            status.time_left = max(0.0, run.plan.duration - elapsed)
        if around.controller is not None:
            status.controller = around.controller.text
        status.position_error, status.rotation_error = self._error(around)
        return status

    def _end(self, run: _Run, code: int, text: str, around: Surroundings | None = None) -> None:
        run.over.set()
        if self._next is run:
            self._next = None
        if self._now is run:
            self._now = None
        run.phase = "ended"
        status = self._status_of(run, around)
        status.code, status.text = code, text
        self._status.publish(status)
        words = f"{run.request.source} ended: {text}"
        if code in _REFUSALS:
            self._node.get_logger().warning(words)
        else:
            self._node.get_logger().info(words)
        if not run.begun.done():
            run.begun.set_result(Outcome(False, text))
        run.request.on_status(status)


def _is_same(a: Reference, b: Reference) -> bool:
    return bool(
        np.allclose(a.w_d, b.w_d, rtol=0.0, atol=1e-6)
        and np.allclose(a.w_d_dot, b.w_d_dot, rtol=0.0, atol=1e-9)
    )
