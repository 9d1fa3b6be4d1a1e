"""Whether the robot can do a motion of the head: it is tried on the model before it starts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import Config
from snake_control.control.barriers import Limit
from snake_control.control.reference import Reference
from snake_control.experiment.guided import GuidedRobot, GuidedSample

Array = NDArray[np.float64]

SLOWEST = 1.5
"""A motion that takes more than so many times as long as planned is not what was asked for."""

_FAR_M, _FAR_RAD = 0.03, 0.2
_STUCK_S = 15.0
"""A motion that has stood still for so long is not waited for any more."""
_STANDS_STILL = 0.01


@dataclasses.dataclass(frozen=True)
class Rehearsal:
    """What came of it.

    Attributes:
        possible: whether the robot can do it.
        text: if not, what is in the way, when and where.
        took: time that it took, as a share of the planned one.
        error_m, error_rad: largest error of the head after a third of the time.
        at: if not possible, the motion's own time at which it was held up [s], where that is known.
    """

    possible: bool
    text: str
    took: float
    error_m: float
    error_rad: float
    at: float | None = None


def rehearse(
    config: Config,
    phi: ArrayLike,
    w: ArrayLike,
    reference: Callable[[float], Reference],
    duration: float,
    given_up: Callable[[], bool] = lambda: False,
) -> Rehearsal:
    """Try a motion in lockstep with perfect servos, from where the robot stands.

    Args:
        config: robot, controller and supervisor.
        phi: joint angles, (n-1,) [rad].
        w: head pose, (6,) [m, rad]: its x, y and Y count, the floor decides the rest.
        reference: wanted pose by time since the start [s].
        duration: planned length [s].
        given_up: asked in every cycle; ends it.
    """
    robot = GuidedRobot(config, phi=phi, w=w)
    slowed: dict[Limit, float] = {}
    worst: dict[Limit, GuidedSample] = {}
    error_m = error_rad = 0.0
    late: GuidedSample | None = None
    moved_at, moved_own = 0.0, 0.0
    sample = None
    for sample in robot.follow(reference, duration, SLOWEST * duration):
        if given_up():
            return Rehearsal(False, "given up", 0.0, 0.0, 0.0)
        if sample.own_t > moved_own + _STANDS_STILL * (sample.t - moved_at):
            moved_at, moved_own = sample.t, sample.own_t
        elif sample.t - moved_at > _STUCK_S:
            break
        result = sample.result
        if result is None:
            where = _where(sample, duration)
            words = f"its reference is not finite {where}"
            return Rehearsal(False, words, 0.0, 0.0, 0.0, sample.own_t)
        if result.bound is not None:
            limit = result.bound.limit
            slowed[limit] = slowed.get(limit, 0.0) + 1.0 - result.reference_scale
            if limit not in worst or result.speed_scale < worst[limit].result.speed_scale:  # type: ignore[union-attr]
                worst[limit] = sample
        if sample.own_t > duration / 3.0:
            error_m = max(error_m, float(np.linalg.norm(result.error[:3])))
            error_rad = max(error_rad, float(np.abs(result.error[3:]).max()))
            if late is None and (error_m > _FAR_M or error_rad > _FAR_RAD):
                late = sample
    assert sample is not None
    took = robot.t / duration
    done = sample.own_t + 1.5 / config.scp_controller.rate_hz >= duration
    if robot.state.fallen:
        return Rehearsal(False, "the robot would fall", took, error_m, error_rad, sample.own_t)
    if not done:
        what, at = "it would take too long", sample.own_t
        if slowed:
            first = worst[max(slowed, key=slowed.__getitem__)]
            what, at = f"{_words(first)} would hold it up {_where(first, duration)}", first.own_t
        return Rehearsal(False, what, took, error_m, error_rad, at)
    if late is not None:
        words = f"the head would be {1e3 * error_m:.0f} mm and {error_rad:.2f} rad off"
        words = f"{words}, first {_where(late, duration)}"
        return Rehearsal(False, words, took, error_m, error_rad, late.own_t)
    return Rehearsal(True, "", took, error_m, error_rad)


def _words(sample: GuidedSample) -> str:
    assert sample.result is not None
    assert sample.result.bound is not None
    bound = sample.result.bound
    joints = ", ".join(f"joint_{joint}" for joint in bound.joints)
    return f"{bound.limit.value} of {joints}" if joints else bound.limit.value


def _where(sample: GuidedSample, duration: float) -> str:
    x, y, z = sample.reference.w_d[:3]
    at = f"{sample.own_t:.1f} of {duration:.1f} s"
    if not all(map(math.isfinite, (x, y, z))):
        return f"after {at}"
    return f"after {at}, at x = {x:.3f}, y = {y:.3f}, z = {z:.3f} m"
