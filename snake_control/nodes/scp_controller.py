"""Node ``scp_controller``: head pose, joint states and reference in, joint velocities out.

Every step sends a command, zeros unless the reference is tracked, so that the bus driver knows that
the controller is alive; and a ``controller_state`` with a status that names what is in the way.
Stamps are judged by ROS time; timers run on a steady clock, also under ``use_sim_time``.
"""

from __future__ import annotations

import contextlib
import time
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import JointState
from snake_interfaces.msg import BusState, ControllerState
from std_srvs.srv import SetBool

from snake_control.config import Config
from snake_control.control.reference import Reference
from snake_control.control.supervisor import NO_ANSWER, Supervisor
from snake_control.model.rotation import unwrap_near
from snake_control.nodes import topics
from snake_control.nodes.controller_messages import ControllerMessages, Step, judge, too_far
from snake_control.nodes.conversions import head_motion, joint_motion, reference_from
from snake_control.nodes.endpoints import Endpoints
from snake_control.nodes.inputs import Fault, Input, Problem
from snake_control.nodes.joint_action import Surroundings
from snake_control.nodes.markers import RobotMarkers
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.posture_action import PostureAction
from snake_control.nodes.process import run
from snake_control.nodes.reshape_action import ReshapeAction

Array = NDArray[np.float64]

_MARKERS_PERIOD_S = 0.1
_ACKNOWLEDGED_WITHIN = Duration(seconds=0.2)

_STATUS_OF_FAULT = {
    Fault.WAITING: ControllerState.STATUS_WAITING,
    Fault.STALE: ControllerState.STATUS_STALE,
    Fault.INVALID: ControllerState.STATUS_INVALID,
}

_REASON_OF_FAULT = {
    Fault.WAITING: ControllerState.REASON_NO_INPUT,
    Fault.STALE: ControllerState.REASON_STALE_INPUT,
    Fault.INVALID: ControllerState.REASON_INVALID_INPUT,
}
_GOOD = (
    ControllerState.STATUS_TRACKING,
    ControllerState.STATUS_LIMITED,
    ControllerState.STATUS_RECOVERING,
    ControllerState.STATUS_POSTURE,
    ControllerState.STATUS_RESHAPING,
)
# What a driver does that takes commands; a dry run takes them for show.
_TAKES = (BusState.STATE_MOVING, BusState.STATE_DRY_RUN)
# A driver that says nothing for so long is not heard; its joint states are old then, too.
_BUS_SILENT_NS = 1_000_000_000


class ScpControllerNode(Node):
    """Runs ``Supervisor`` at a fixed rate on the newest inputs."""

    def __init__(self, **overrides: Any) -> None:
        super().__init__("scp_controller", **overrides)
        self._configured = NodeParameters(
            self,
            "scp_controller",
            self._on_parameters,
            _supervisor,
        )
        config = self._configured.config
        self._robot = config.robot
        self._own = own = config.scp_controller
        self._gains = config.controller
        self._controller: Supervisor = self._configured.prepared
        self._enabled = own.enabled
        self._status: int | None = None
        self._bus: tuple[int, BusState] | None = None
        self._stopped = ""
        self._overtaken = ""
        self._messages = ControllerMessages(config.robot, own.frame_id)
        self._drawn = RobotMarkers(config.robot, own.frame_id)
        self._latest = Step.at(0, config.robot)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._origin_ns = self._steady.now().nanoseconds
        self._phi: Array | None = None
        self._w: Array | None = None
        self._rpy_d = np.zeros(3)

        self._joint_states = Input(
            topics.JOINT_STATES.name,
            own.joint_states_timeout_s,
            self._joint_motion,
        )
        self._head = Input(
            topics.HEAD_ODOMETRY.name,
            own.head_timeout_s,
            self._head_motion,
        )
        self._reference = Input(
            topics.HEAD_REFERENCE.name,
            own.reference_timeout_s,
            lambda message: reference_from(message, own.frame_id),
        )
        ends = Endpoints(self)
        for topic, source in (
            (topics.JOINT_STATES, self._joint_states),
            (topics.HEAD_ODOMETRY, self._head),
            (topics.HEAD_REFERENCE, self._reference),
        ):
            ends.subscription(topic, source.receive, topic.newest_only)

        t = topics.BUS_STATE
        ends.subscription(t, self._hear_bus, t.newest_only)
        ends.subscription(topics.HEAD_PLANNED_PATH, self._drawn.follow)

        self._command = ends.publisher(topics.JOINT_VELOCITY_COMMAND)
        self._state = ends.publisher(topics.CONTROLLER_STATE)
        self._markers = ends.publisher(topics.MARKERS)
        self.create_service(topics.ENABLE.type, topics.ENABLE.name, self._on_enable)
        self._actions = (
            PostureAction(self, lambda: self._configured.config, self._busy),
            ReshapeAction(self, lambda: self._configured.config, self._busy, self._control),
        )
        self.create_timer(1.0 / own.rate_hz, self._on_timer, clock=self._steady)
        self.create_timer(_MARKERS_PERIOD_S, self._publish_markers, clock=self._steady)

    def _joint_motion(self, message: JointState) -> tuple[Array, Array]:
        phi, phi_dot = joint_motion(message, self._robot.joint_names)
        self._phi = phi
        self._prepare()
        return phi, phi_dot

    def _head_motion(self, message: Odometry) -> tuple[Array, Array]:
        w, w_dot = head_motion(message, self._own.frame_id)
        if self._w is not None:
            # Roll, pitch and yaw go on without jumps by whole turns.
            w[3:] = unwrap_near(w[3:], self._w[3:])
        self._w = w
        self._prepare()
        return w, w_dot

    def _prepare(self) -> None:
        """Work out now, while there is time, what would delay the command at the tick."""
        if self._phi is None or self._w is None:
            return
        # The step will say what fails.
        with contextlib.suppress(*NO_ANSWER):
            self._controller.prepare(self._phi, self._w)

    def _hear_bus(self, message: BusState) -> None:
        self._bus = (self._steady.now().nanoseconds, message)

    def _busy(self) -> str:
        """Return which action has a goal; empty if none has."""
        return next((action.name for action in self._actions if action.active), "")

    def _on_parameters(self, config: Config) -> None:
        self._gains = config.controller
        before, self._controller = self._controller, self._configured.prepared
        self._controller.go_on_from(before)
        self._messages.parameter_changes += 1
        self.get_logger().info(f"parameters changed: {config.controller}, {config.supervisor}")

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._enabled = request.data
        self._stopped = self._overtaken = ""
        response.success = True
        response.message = "enabled" if self._enabled else "disabled: zero velocity"
        self.get_logger().info(response.message)
        return response

    def _on_timer(self) -> None:
        started = time.perf_counter()
        step = self._step(self.get_clock().now().nanoseconds)
        self._command.publish(self._messages.command(step))
        elapsed = time.perf_counter() - started
        try:
            state = self._messages.state(step, self._gains, elapsed)
        except NO_ANSWER as error:
            # The state asks more of the posture than the command, which has gone: take it back.
            _give_up(step, error)
            self._command.publish(self._messages.command(step))
            state = self._messages.state(step, self._gains, elapsed)
        self._state.publish(state)
        self._latest = step
        if step.result is None:
            self._controller.rest()
        if step.status != self._status:
            self._status = step.status
            # On lines of their own: rclpy ties one severity to each line that logs.
            if step.status in _GOOD:
                self.get_logger().info(step.text)
            else:
                self.get_logger().warning(step.text)

    def _step(self, now: int) -> Step:
        step = Step.at(now, self._robot)
        step.joint_states_age = self._joint_states.age(now)
        step.head_age = self._head.age(now)
        step.head_waited = self._head.waited()
        step.reference_age = self._reference.age(now)
        problems: list[Problem] = []
        w_dot = phi_dot = np.zeros(0)
        if problem := self._head.problem(now):
            problems.append(problem)
        else:
            step.w, w_dot = self._head.value
        if problem := self._joint_states.problem(now):
            problems.append(problem)
        else:
            step.phi, phi_dot = self._joint_states.value
        others = list(problems)
        if problem := self._reference.problem(now):
            problems.append(problem)
        else:
            reference = self._reference.value
            self._rpy_d = unwrap_near(reference.w_d[3:], self._rpy_d)
            step.w_d = np.concatenate([reference.w_d[:3], self._rpy_d])
            step.w_d_dot = reference.w_d_dot

        referenced = len(problems) == len(others)
        bus = self._heed_bus(referenced)
        if not self._enabled:
            step.status = ControllerState.STATUS_DISABLED
            step.text = f"disabled by ~/{topics.ENABLE.name[2:]}"
            step.reasons = (ControllerState.REASON_DISABLED,)
        elif bus is not None:
            step.status, step.text = bus
            step.reasons = (ControllerState.REASON_BUS,)
        rests = step.text
        if self._act(step, rests, others, referenced) or rests:
            return step
        if problems:
            step.status = _STATUS_OF_FAULT[max(problem.fault for problem in problems)]
            step.text = "; ".join(problem.text for problem in problems)
            faults = sorted({problem.fault for problem in problems}, reverse=True)
            step.reasons = tuple(_REASON_OF_FAULT[fault] for fault in faults)
            # Nothing but the reference is missing: it may begin.
            step.reference_scale = 0.0 if others else 1.0
        elif text := too_far(
            step, self._own.max_position_error_m, self._own.max_rotation_error_rad
        ):
            step.status = ControllerState.STATUS_ERROR_TOO_LARGE
            step.text = text
            step.reasons = (ControllerState.REASON_ERROR_TOO_LARGE,)
        else:
            given = self._reference.value
            reference = Reference(step.w_d, step.w_d_dot, time_scale=given.time_scale)
            self._control(step, step.phi, np.concatenate([w_dot, phi_dot]), reference)
        return step

    def _act(self, step: Step, rests: str, problems: list[Problem], referenced: bool) -> bool:
        """Let an action move the joints; return whether it, or what it leaves, decides the step.

        A reference that came meanwhile is not followed afterwards, either: it has to begin anew.

        Args:
            step: the step so far.
            rests: why the joints have to rest, empty if they have not.
            problems: of head pose and joint states.
            referenced: whether there is a reference.
        """
        around = Surroundings(
            t=self._seconds(),
            missing={problem.topic: problem.text for problem in problems},
            hindrance=rests,
            bus_waits=self._bus_waits(),
            referenced=referenced,
        )
        acted = any(action.step(step, around) for action in self._actions)
        if referenced and any(action.moving for action in self._actions):
            self._overtaken = self._busy()
        if acted:
            return True
        if not referenced:
            self._overtaken = ""
        if not self._overtaken or rests:
            return False
        step.status = ControllerState.STATUS_STOPPED
        step.text = (
            f"the reference came while {self._overtaken} moved the joints: stop it and start it "
            "again"
        )
        step.reasons = (ControllerState.REASON_JOINT_MOTION,)
        return True

    def _seconds(self) -> float:
        return (self._steady.now().nanoseconds - self._origin_ns) * 1e-9

    def _bus_waits(self) -> str:
        """Return what a driver that is heard waits for before it takes motion, empty for none."""
        if self._bus is None:
            return ""
        heard_ns, state = self._bus
        if self._steady.now().nanoseconds - heard_ns > _BUS_SILENT_NS or state.state in _TAKES:
            return ""
        return f"bus_driver: {state.text}"

    def _heed_bus(self, referenced: bool) -> tuple[int, str] | None:
        """Return status and text if the bus driver does not do what it is told.

        After it was stopped the joints rest until the reference has ceased: who went on asking for
        motion all the time must not get it all at once. A driver that was never heard may be
        somebody else's.

        Args:
            referenced: whether there is a reference.
        """
        if self._bus is None:
            return None
        heard_ns, state = self._bus
        if self._steady.now().nanoseconds - heard_ns > _BUS_SILENT_NS:
            return None
        if state.state in (*_TAKES, BusState.STATE_HOLDING):
            if self._stopped and referenced:
                return (
                    ControllerState.STATUS_STOPPED,
                    f"was stopped ({self._stopped}): stop the reference and start it again",
                )
            self._stopped = ""
            if state.state in _TAKES or not referenced:
                return None
            # It wants a zero command first, which every step sends that does not track.
            return ControllerState.STATUS_WAITING, f"bus_driver: {state.text}"
        self._stopped = f"bus_driver: {state.text}"
        return ControllerState.STATUS_STOPPED, self._stopped

    def _control(self, step: Step, phi: Array, q_dot: Array | None, reference: Reference) -> None:
        """Let the supervised law decide a step, at the measured head pose and angles ``phi``."""
        q = np.concatenate([step.w, phi])
        try:
            result = self._controller.step(q, q_dot, reference, self._seconds())
        except NO_ANSWER as error:
            _give_up(step, error)
            return
        if not np.isfinite(result.u).all():
            bad = [
                name
                for name, u in zip(self._robot.joint_names, result.u, strict=True)
                if not np.isfinite(u)
            ]
            step.status = ControllerState.STATUS_FAULT
            step.text = f"the control law gave no finite velocity for {', '.join(bad)}"
            step.reasons = (ControllerState.REASON_NO_ANSWER,)
            return
        judge(step, result, self._robot)

    def _publish_markers(self) -> None:
        if self._markers.get_subscription_count() == 0:
            return
        now = self.get_clock().now().nanoseconds
        q = w_d = None
        if not self._head.problem(now) and not self._joint_states.problem(now):
            q = np.concatenate([self._head.value[0], self._joint_states.value[0]])
        if not self._reference.problem(now):
            w_d = self._reference.value.w_d
        self._markers.publish(self._drawn.draw(now, q, w_d, self._latest))

    def close(self) -> None:
        """Leave the joints with a command to rest."""
        for action in self._actions:
            action.close()
        now = self.get_clock().now().nanoseconds
        self._command.publish(self._messages.command(Step.at(now, self._robot)))
        # A publisher that is destroyed may take what it has just sent along.
        self._command.wait_for_all_acked(_ACKNOWLEDGED_WITHIN)


def _give_up(step: Step, error: Exception) -> None:
    """Leave the joints at rest, with the reason."""
    step.result = None
    step.status = ControllerState.STATUS_FAULT
    step.text = f"the control law has no answer: {error}"
    step.reasons = (ControllerState.REASON_NO_ANSWER,)
    step.reference_scale = 0.0


def _supervisor(config: Config) -> Supervisor:
    period_s = 1.0 / config.scp_controller.rate_hz
    return Supervisor(config.robot, config.controller, config.supervisor, period_s)


def main() -> int:
    """Run the node."""
    return run(ScpControllerNode, "scp_controller")


if __name__ == "__main__":
    raise SystemExit(main())
