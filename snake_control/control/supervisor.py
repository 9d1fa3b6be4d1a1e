"""Keeps the robot under the law (22) away from its limits, and says what it did and why.

In this order, each only as far as the one before does not suffice:

1. the SCPs work to get away from a limit that is near, and the sub-tasks fade (``escape``);
2. the reference is slowed: its rate, not the correction of the error, so that the head stays on
   its path (whoever sends the reference reads ``reference_scale`` and slows down with it);
3. the correction of the error is slowed, then the motion of the SCPs: at last the robot holds.

A reference that leads away from a limit is followed at once: what is remembered from step to step
only smooths the motion (the last command, the pace of the reference and of the sub-tasks), names
what lasts (dangers, holding), and lets a motion that begins in a singular posture lead out of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import ControllerConfig, RobotConfig, SupervisorConfig
from snake_control.control.barriers import Barriers, BarriersAt, Bound, Limit
from snake_control.control.escape import Escape
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ControlResult, ScpController
from snake_control.errors import SnakeError
from snake_control.model.geometry import checked_posture
from snake_control.model.posture import Posture
from snake_control.model.structure import structure

Array = NDArray[np.float64]

NO_ANSWER = (SnakeError, ArithmeticError, np.linalg.LinAlgError)
"""What a step raises where a posture, or a sub-task of somebody else's, has no answer."""

HOLDING_BELOW = 0.05
"""Share of the wanted motion of the head below which the robot counts as holding."""
HOLDING_AFTER_S = 0.5

SUB_TASK_SHARE = 0.5
"""Share of the joints' speed limits that the sub-tasks may use with the head at rest."""

_NEVER_LIFTED = (Limit.FALL, Limit.FLOOR)
_CALMEST = 0.01
_REGAINED = 0.5
_PLAIN = dataclasses.fields(ControlResult)


@dataclasses.dataclass(frozen=True, eq=False)
class SupervisedResult(ControlResult):
    """A control step and what the supervisor made of it.

    Attributes:
        reference_scale: how fast the reference may go on, 0..1.
        feedback_scale: share of the correction of the error, 0..1.
        scp_scale: share of the motion of the SCPs, 0..1.
        bound: the limit that slowed the motion; ``None`` if nothing did.
        escaping: limits that the SCPs work to get away from, with the danger 0..1.
        accelerating: whether the acceleration limit bit.
        holding: whether the head has been kept at rest for a while though it should move.
    """

    reference_scale: float = 1.0
    feedback_scale: float = 1.0
    scp_scale: float = 1.0
    bound: Bound | None = None
    escaping: dict[Limit, float] = dataclasses.field(default_factory=dict)
    accelerating: bool = False
    holding: bool = False


@dataclasses.dataclass(frozen=True)
class _Scaled:
    u: Array
    reference: float
    feedback: float
    scps: float
    bound: Bound | None


class Supervisor:
    """``ScpController`` within limits."""

    def __init__(
        self,
        robot: RobotConfig,
        controller: ControllerConfig,
        supervisor: SupervisorConfig,
        period_s: float,
    ) -> None:
        """Prepare for a robot.

        Args:
            robot, controller, supervisor: the configuration.
            period_s: time between two steps [s].

        Raises:
            ConfigError: a sub-task cannot be made.
        """
        self._robot = robot
        self._structure = structure(robot)
        self._law = ScpController(robot, controller)
        self._config = supervisor
        self._period_s = period_s
        self._barriers = Barriers(robot, supervisor)
        self._escape = Escape(robot, supervisor, self._barriers)
        self._at_rest = np.zeros(robot.joints)
        self._sub_task_speeds = SUB_TASK_SHARE * np.array(robot.joint_speed_limits_rad_s)
        self._still = [0.0] * len(robot.controlled)
        self._no_scps = np.zeros(len(robot.scp_joints))
        self._prepared: tuple[Posture, BarriersAt] | None = None
        self.rest()

    def rest(self) -> None:
        """Note that the joints are commanded to rest: the next motion begins there."""
        self._u = self._at_rest
        self._reference_scale = 1.0
        self._held_since: float | None = None
        self._bound: Bound | None = None
        self._sub_task_motion = self._at_rest
        self._calm = 1.0
        self._dangers: dict[Limit, float] = {}
        self._lifted: set[Limit] = set()
        self._begins = True

    def go_on_from(self, before: Supervisor) -> None:
        """Take over a motion under way: parameters have changed, the robot has not."""
        self._u = before._u
        self._reference_scale = before._reference_scale
        self._begins = False

    def prepare(self, phi: Array, w: Array | None = None) -> None:
        """Work out what the step will ask of a posture, for whoever has time before it.

        Args:
            phi: joint angles, (n-1,) [rad]; a step with others works out everything itself.
            w: pose of the head, (6,) [m, rad], if that is known as well; a step with another takes
                over what the joints alone decide. The posture in the result of a step with this one
                is the one that was prepared, and serves further steps: it must not be changed.

        Raises:
            ModelError: not finite, or the wrong shape.
        """
        if not self._config.enabled:
            return
        posture, limits = self._known(phi)
        if w is not None:
            posture = posture.moved(w)
        self._law.prepare(posture)
        self._prepared = posture, limits

    def _known(self, phi: Array) -> tuple[Posture, BarriersAt]:
        """Return a posture with these joint angles, and the limits as they are seen from there."""
        if self._prepared is not None and np.array_equal(self._prepared[0].g.q[6:], phi):
            return self._prepared
        on_floor = self._barriers.on_floor(phi)
        return Posture.of(self._robot, on_floor), self._barriers.at(on_floor.q[6:], on_floor)

    def step(
        self, q: ArrayLike, q_dot: ArrayLike | None, reference: Reference, t: float
    ) -> SupervisedResult:
        """Return joint velocities for one moment.

        Args:
            q: [w, phi], (n+5,) [m, rad].
            q_dot: its rate; not used.
            reference: wanted head pose and rate, at ``reference.time_scale`` of its speed. SCP
                velocities that it gives take the place of sub-tasks and escape, and are slowed
                with its rate.
            t: time of a steady clock [s].

        Raises:
            ModelError: q has the wrong shape or is not finite.
        """
        if not self._config.enabled:
            plain = self._law.step(q, q_dot, reference, t)
            self._u = plain.u
            return SupervisedResult(**{f.name: getattr(plain, f.name) for f in _PLAIN})
        q = checked_posture(self._structure, q)
        phi = q[6:]
        known, at = self._known(phi)
        posture, error = self._law.look(q, reference, known)
        self._lift(at)
        # Whoever gives the velocities of the SCPs has decided what they are used for.
        given_scps = reference.phi_tilde_dot_d
        dangers = {} if given_scps is not None else self._escape.dangers(at, phi, self._dangers)
        self._dangers = dangers
        fade = 1.0 - max(dangers.values(), default=0.0)
        away = self._escape.velocities(posture, dangers) if dangers else 0.0

        back = self._law.feedback(posture, error)
        forward = self._law.feedforward(reference, error)

        if given_scps is None:
            resting_scps = self._law.sub_tasks(posture, self._still)
            sub_tasks = fade * self._sub_task_share(posture, resting_scps) * resting_scps
            given_scps = self._no_scps
        else:
            resting_scps = sub_tasks = self._no_scps

        def motion(w_dot: list[float], given: Array) -> tuple[Array, Array]:
            scps = sub_tasks + away + given
            if self._law.scps_follow_head and reference.phi_tilde_dot_d is None:
                scps = scps + self._law.sub_tasks(posture, w_dot) - resting_scps
            return scps, posture.k.joint_velocities(w_dot, scps.tolist())

        scale = reference.time_scale
        full = [scale * f + b for f, b in zip(forward, back, strict=True)]
        phi_tilde_dot_d, wanted = motion(full, given_scps)
        scaled = self._scaled(
            at, wanted, lambda w_dot: motion(w_dot, self._no_scps)[1], back, scale
        )
        u, accelerating = self._accelerated(at, scaled.u)
        self._u = u
        self._let_reference_go(scaled.reference)
        # What head and SCPs were given of what they should do.
        onward = any(forward) or bool(given_scps.any())
        given = scaled.reference / scale if scale > 0.0 and onward else scaled.feedback
        pace = self._reference_scale if onward else scaled.feedback
        holding = self._holds(pace, onward or any(back), t)
        self._bound = scaled.bound or (self._bound if holding else None)
        return SupervisedResult(
            posture=posture,
            w_d=reference.w_d,
            w_d_dot=reference.w_d_dot,
            error=np.array(error),
            phi_tilde_dot_d=phi_tilde_dot_d,
            u_unlimited=wanted,
            u=u,
            speed_scale=min(1.0, given),
            speed_limited=_joints(self._bound, Limit.JOINT_SPEED),
            range_limited=_joints(self._bound, Limit.JOINT_RANGE),
            reference_scale=self._reference_scale,
            feedback_scale=scaled.feedback,
            scp_scale=scaled.scps,
            bound=self._bound,
            escaping=dangers,
            accelerating=accelerating,
            holding=holding,
        )

    def _lift(self, at: BarriersAt) -> None:
        """Let a motion that begins in a singular posture lead out of it by whatever way.

        Singular postures are no danger as long as joint speeds are limited, but where the way out
        makes one worse at first, the robot would stand there for ever.
        """
        widths = self._barriers.widths
        near: set[Limit] = {
            limit
            for limit, margin in at.margins.items()
            if limit not in _NEVER_LIFTED and margin < _REGAINED * widths[limit]
        }
        self._lifted = near if self._begins else self._lifted & near
        self._begins = False
        at.lifted = frozenset(self._lifted)

    def _sub_task_share(self, posture: Posture, scps: Array) -> float:
        """Return the share of the sub-tasks' own motion that leaves the head its joint speeds.

        A gradient can ask for any speed; along the body it grows by orders of magnitude. Steps
        against the one before are too long for the gradient that they follow: the share is halved
        as long as they come, and grows again after them.
        """
        motion = posture.k.joint_velocities(self._still, scps.tolist())
        turned = float(motion.dot(self._sub_task_motion)) < 0.0
        self._calm = max(0.5 * self._calm, _CALMEST) if turned else min(1.1 * self._calm, 1.0)
        self._sub_task_motion = motion
        excess = float((np.abs(motion) / self._sub_task_speeds).max(initial=0.0))
        return self._calm / max(excess, 1.0)

    def _scaled(
        self,
        at: BarriersAt,
        wanted: Array,
        motion: Callable[[list[float]], Array],
        back: list[float],
        scale: float,
    ) -> _Scaled:
        """Return the largest allowed part of a motion.

        Args:
            at: what is allowed.
            wanted: joint velocities, (n-1,) [rad/s].
            motion: gives those for a velocity of the head.
            back: velocity of the head that corrects the error.
            scale: pace of the reference in ``wanted``.
        """
        if at.allows(wanted):
            return _Scaled(wanted, 1.0, 1.0, 1.0, None)
        resting, correcting = motion(self._still), motion(back)
        share, bound = at.largest_share(correcting, wanted - correcting)
        if share >= 0.0:
            u = correcting + share * (wanted - correcting)
            return _Scaled(u, share * scale, 1.0, 1.0, bound)
        share, bound = at.largest_share(resting, correcting - resting)
        if share >= 0.0:
            return _Scaled(resting + share * (correcting - resting), 0.0, share, 1.0, bound)
        share, bound = at.largest_share(self._at_rest, resting)
        share = max(share, 0.0)
        return _Scaled(share * resting, 0.0, 0.0, share, bound)

    def _accelerated(self, at: BarriersAt, u: Array) -> tuple[Array, bool]:
        """Return the command nearest to ``u`` that the acceleration limit allows.

        All joints change by the same share, so that the wheels go on rolling.
        """
        limit = self._config.acceleration_limit_rad_s2 * self._period_s
        change = u - self._u
        largest = float(np.abs(change).max(initial=0.0))
        if limit == 0.0 or largest <= limit:
            return u, False
        slower = self._u + (limit / largest) * change
        # To keep away from a limit a joint may brake as hard as it can.
        return (slower, True) if at.allows(slower) else (u, False)

    def _let_reference_go(self, allowed: float) -> None:
        rise = self._config.scale_rise_per_s * self._period_s
        self._reference_scale = min(allowed, self._reference_scale + rise)

    def _holds(self, pace: float, asked: bool, t: float) -> bool:
        """Return whether the head has been given next to nothing of its motion for a while."""
        if not asked or pace > HOLDING_BELOW:
            self._held_since = None
            return False
        if self._held_since is None:
            self._held_since = t
        return t - self._held_since >= HOLDING_AFTER_S


def _joints(bound: Bound | None, limit: Limit) -> tuple[int, ...]:
    return bound.joints if bound is not None and bound.limit is limit else ()
