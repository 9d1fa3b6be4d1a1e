"""Motions of the head that are only to be shown: planned, rehearsed, never begun."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from concurrent.futures import Future

from rclpy.task import Future as RosFuture

from snake_control.control.reference import Reference
from snake_control.control.supervisor import NO_ANSWER
from snake_control.errors import SnakeError
from snake_control.experiment.rehearsal import Rehearsal
from snake_control.nodes.rehearsals import (
    Movable,
    Rehearsals,
    Surroundings,
    in_words,
    wait_for_inputs,
    what_is_missing,
)
from snake_control.trajectory.sequence import Outcome, ReferenceSequence


@dataclasses.dataclass(eq=False)
class _Preview:
    plan: Callable[[Reference], Movable]
    done: RosFuture
    since: float
    job: Future[tuple[Movable, Rehearsal]] | None = None


class HeadPreviews:
    """Answers requests for previews; ``step`` is called with every reference that is sent."""

    def __init__(
        self,
        rehearsals: Rehearsals,
        sequence: ReferenceSequence,
        on_path: Callable[[Movable], None],
    ) -> None:
        """Wait for requests.

        Args:
            rehearsals: try motions on the model.
            sequence: knows where the reference is.
            on_path: told of a motion that is to be shown.
        """
        self._rehearsals = rehearsals
        self._sequence = sequence
        self._on_path = on_path
        self._previews: list[_Preview] = []

    def ask(self, plan: Callable[[Reference], Movable], now: float) -> RosFuture:
        """Plan, rehearse and show a motion; the future's result is an ``Outcome``.

        Args:
            plan: makes it from where it would begin; another thread calls it. What is wrong with it
                is a ``SnakeError``.
            now: time of the steady clock [s].
        """
        preview = _Preview(plan, RosFuture(), now)
        self._previews.append(preview)
        return preview.done

    def step(self, around: Surroundings) -> None:
        """Go on with what was asked for."""
        for preview in list(self._previews):
            self._step_preview(preview, around)

    def _step_preview(self, preview: _Preview, around: Surroundings) -> None:
        if preview.job is None:
            if wait_for_inputs(preview.since, around, bold=False):
                return
            start = self._sequence.here(around.now, around.head)
            missing = what_is_missing(start, around, bold=False)
            if missing or start is None:
                self._answer(preview, Outcome(False, missing))
                return

            rehearsals = self._rehearsals

            def prepare() -> tuple[Movable, Rehearsal]:
                plan = preview.plan(start)
                return plan, rehearsals.rehearse(plan, around, lambda: False)

            preview.job = rehearsals.submit(prepare)
        elif preview.job.done():
            self._answer(preview, self._seen(preview.job))

    def _seen(self, job: Future[tuple[Movable, Rehearsal]]) -> Outcome:
        try:
            plan, found = job.result()
        except SnakeError as error:
            return Outcome(False, str(error))
        except NO_ANSWER as error:
            return Outcome(False, f"the rehearsal failed: {error}")
        self._on_path(plan)
        words = f"{plan.duration:.1f} s, {plan.length:.2f} m; "
        if not found.possible:
            return Outcome(False, words + in_words(plan, found))
        return Outcome(
            True,
            f"{words}the rehearsal came through in {found.took:.2f} of this time, with the head at "
            f"most {1e3 * found.error_m:.0f} mm and {found.error_rad:.2f} rad off",
        )

    def _answer(self, preview: _Preview, outcome: Outcome) -> None:
        self._previews.remove(preview)
        preview.done.set_result(outcome)
