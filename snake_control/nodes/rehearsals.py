"""Motions of the head tried on the model before they begin, in a thread of their own."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from snake_interfaces.msg import ControllerState

from snake_control.config import Config
from snake_control.control.reference import Reference
from snake_control.experiment.rehearsal import Rehearsal, rehearse
from snake_control.trajectory.head_trajectory import HeadTrajectory

Array = NDArray[np.float64]
Made = TypeVar("Made")

NO_HEAD = "no fresh head/odometry"
INPUT_WAIT_S = 1.0
"""How long a request waits for head pose and joint states that have just gone stale."""
_REHEARSAL_HZ = 25.0


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What the node knows at one moment.

    Attributes:
        now: time of the steady clock [s].
        head: w of the head, (6,); ``None`` if it is not known.
        phi: joint angles, (n-1,); ``None`` if they are not known.
        controller: its newest state, if it is heard.
    """

    now: float
    head: Array | None
    phi: Array | None
    controller: ControllerState | None


class Movable(Protocol):
    """What can be rehearsed and shown: a plan.

    Attributes:
        duration: [s].
        length: [m].
    """

    duration: float
    length: float

    def made(self) -> Callable[[float], HeadTrajectory]:
        """Return what makes the motion for the time at which it starts [s]."""

    def where(self, t: float) -> str:
        """Return the name of its part at time ``t`` since its start [s]."""


class Rehearsals:
    """Plans and tries one motion after the other."""

    def __init__(self, config: Config) -> None:
        """Begin; ``config`` has robot, controller and supervisor."""
        quick = dataclasses.replace(config.scp_controller, rate_hz=_REHEARSAL_HZ)
        self._config = dataclasses.replace(config, scp_controller=quick)
        self._ending = threading.Event()
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="rehearsal")

    def close(self) -> None:
        """Take no more; a rehearsal ends at once."""
        self._ending.set()
        self._worker.shutdown(wait=False, cancel_futures=True)

    def submit(self, prepare: Callable[[], Made]) -> Future[Made]:
        """Have something prepared in the other thread."""
        return self._worker.submit(prepare)

    def rehearse(self, plan: Movable, around: Surroundings, over: Callable[[], bool]) -> Rehearsal:
        """Try a motion from where the robot is; for the other thread.

        Args:
            plan: the motion.
            around: with head pose and joint angles.
            over: asked in every cycle; ends it.
        """
        assert around.phi is not None
        assert around.head is not None
        return rehearse(
            self._config,
            around.phi,
            around.head,
            plan.made()(0.0).sample,
            plan.duration,
            lambda: over() or self._ending.is_set(),
        )


def wait_for_inputs(since: float, around: Surroundings, bold: bool) -> bool:
    """Return whether a request of the time ``since`` [s] should wait for what is missing."""
    missing = around.head is None or (around.phi is None and not bold)
    return missing and around.now - since < INPUT_WAIT_S


def what_is_missing(start: Reference | None, around: Surroundings, bold: bool) -> str:
    """Return what must be known and is not, empty if nothing."""
    if start is None:
        return NO_HEAD
    if bold or (around.head is not None and around.phi is not None):
        return ""
    what = "head/odometry" if around.head is None else "joint_states"
    return f"cannot be rehearsed: no fresh {what}"


def in_words(plan: Movable, found: Rehearsal) -> str:
    """Return why a motion is not possible, and in which of its parts."""
    where = "" if found.at is None else plan.where(found.at)
    return f"{where}: {found.text}" if where else found.text
