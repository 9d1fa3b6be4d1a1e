"""Node ``bus_driver``: joint velocities to AX-12 servos, their state to the graph.

Lifecycle: configure opens the port and checks every servo, activate seeds and arms them, deactivate
lets them hold, cleanup takes the torque and closes the port; after an error the servos hold by
themselves and the port is closed. With ``autostart`` (default) configure and activate happen one
after the other as soon as the executor turns, while it answers already; a signal comes between
them, and a failure ends the process with one message.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from snake_interfaces.msg import JointVelocityCommand
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from snake_control.ax12.driven_joint import JointReading
from snake_control.ax12.health import HealthLog, Level, Thresholds, judge
from snake_control.errors import SnakeError
from snake_control.nodes import topics
from snake_control.nodes.bus_load import StaticLoad
from snake_control.nodes.bus_loop import BusLoop
from snake_control.nodes.bus_messages import (
    Health,
    InvalidCommandError,
    StateMessages,
    checked_velocities,
    diagnostics,
    no_diagnostics,
    time_message,
)
from snake_control.nodes.bus_requests import NotLoweredError
from snake_control.nodes.bus_snapshot import Snapshot, State
from snake_control.nodes.conversions import of_robot, stamp_ns
from snake_control.nodes.endpoints import Endpoints
from snake_control.nodes.managed import ManagedNode, logged
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.process import THREAD_SWITCH_S, run

_LOG_PERIOD_S = 1.0
_CHECK_PERIOD_S = 0.2
_START_PERIOD_S = 0.01
_NS = 1_000_000_000
_MOVING_RAD = 0.02


class BusDriver(ManagedNode):
    """The driver as a lifecycle node."""

    def __init__(self, **overrides: Any) -> None:
        """Declare parameters, topics and services; with ``autostart``, the executor starts it.

        Raises:
            ConfigError: a parameter.
        """
        super().__init__("bus_driver", **overrides)
        self._config = NodeParameters(self, "bus_driver").config
        driver, names = self._config.bus_driver, self._config.robot.joint_names
        self._messages = StateMessages(names, self._config.servos.ids)
        self._last: Snapshot | None = None
        self._health_log = HealthLog()
        self._health = Health()
        self._load = StaticLoad(self._config.robot, driver.torque_warn_n_m)
        self._thresholds = Thresholds(
            driver.temperature_warn_c,
            driver.voltage_low_warn_v,
            driver.voltage_high_warn_v,
            driver.feedback_timeout_s,
            driver.communication_error_warn,
            driver.load_warn,
            driver.torque_warn_n_m,
        )
        self._rehearsed: dict[str, float] = {}
        self._failure: SnakeError | None = None
        self._starting = driver.autostart
        self._joint_stamp_ns = 0
        self._ignored = 0
        self._ignored_logged_at = 0.0
        ends = Endpoints(self)
        self._joint_states = ends.publisher(topics.JOINT_STATES)
        self._bus_state = ends.publisher(topics.BUS_STATE)
        self._diagnostics = ends.publisher(topics.DIAGNOSTICS)
        self._emergency_active = ends.publisher(topics.EMERGENCY_STOP_ACTIVE)
        self._loop = BusLoop(self._config, self._publish, self._warn, self._complain)
        self._tell_emergency()
        ends.subscription(topics.JOINT_VELOCITY_COMMAND, self._take_command)
        self.serve_slowly(topics.SET_TORQUE, self._set_torque)
        self.serve_slowly(topics.RECOVER, self._recover)
        self._serve(topics.EMERGENCY_STOP, self._emergency_stop)
        self._serve(topics.RESET_EMERGENCY_STOP, self._reset_emergency_stop)
        # Not by the node's clock: with use_sim_time it may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(driver.diagnostics_period_s, self._publish_diagnostics, clock=steady)
        self.create_timer(_CHECK_PERIOD_S, self._loop.check, clock=steady)
        if driver.autostart:
            self._steps = iter((self.trigger_configure, self.trigger_activate))
            self._step: Future[TransitionCallbackReturn] | None = None
            self._starter = self.create_timer(_START_PERIOD_S, self._start_step, clock=steady)

    def close(self) -> None:
        """Hold, switch torque off if configured, close the port.

        A lowering before takes its time; an emergency stop ends it.
        """
        self.finish(self._loop.close)

    # Lifecycle.

    @logged
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the port and check all servos."""
        return self._attempt(self._open)

    def _open(self) -> None:
        found = self._loop.open()
        start = self._config.robot.start_joint_angles_rad
        for posture, angles in (("start posture", start), ("posture found", found)):
            heavy = self._load.too_much(angles)
            if heavy:
                self.get_logger().warning(f"in the {posture} {heavy}")

    @logged
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Seed goals, write RAM settings, switch torque on."""
        result = self._attempt(self._loop.activate)
        if result == TransitionCallbackReturn.SUCCESS:
            return super().on_activate(state)
        return result

    @logged
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Come to rest; the servos go on holding."""
        self._loop.deactivate()
        return super().on_deactivate(state)

    @logged
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take the torque, after a lowering if configured, and close the port.

        It fails if the robot could not be lowered: better held than dropped.
        """
        log = self.get_logger()
        try:
            if not self._config.bus_driver.dry_run:
                log.info(self._loop.release())
        except NotLoweredError as error:
            log.error(f"no cleanup: {error}")
            return TransitionCallbackReturn.FAILURE
        except SnakeError as error:
            # A port that is lost, or a servo that does not answer, must not bar the way out.
            log.warning(f"cleanup, torque is not known to be off: {error}")
        self._loop.close(torque_off=False)
        self._last = None
        return TransitionCallbackReturn.SUCCESS

    @logged
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Hold, take the torque if configured, close the port."""
        return self._end()

    @logged
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Hold and close the port, whatever went wrong in a transition; configure begins anew."""
        self.get_logger().error(
            f"a transition from {state.label!r} failed unexpectedly: the servos hold by themselves "
            "and the port is closed; configure the driver again"
        )
        self._loop.close(torque_off=False)
        self._last = None
        return TransitionCallbackReturn.SUCCESS

    def _end(self) -> TransitionCallbackReturn:
        self._loop.close()
        self._last = None
        return TransitionCallbackReturn.SUCCESS

    def _attempt(self, action) -> TransitionCallbackReturn:  # type: ignore[no-untyped-def]
        try:
            action()
        except SnakeError as error:
            self._failure = error
            if not self._starting:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def _start_step(self) -> None:
        """Configure, then activate, each in the thread for requests.

        Raises:
            BusError, ServoError: it failed; no servo was armed.
        """
        if self._step is not None:
            if not self._step.done():
                return
            if self._step.result() != TransitionCallbackReturn.SUCCESS:
                self._starter.cancel()
                assert self._failure is not None
                raise self._failure
        step = next(self._steps, None)
        if step is not None:
            self._step = self.begin(step)
            return
        self._starter.cancel()
        self._starting = False
        self.get_logger().info(
            f"{len(self._config.servos.ids)} servos on {self._config.bus_driver.port}, torque "
            + ("on" if self._config.bus_driver.torque_on_activate else "off")
        )

    # Topics in.

    def _take_command(self, message: JointVelocityCommand) -> None:
        try:
            velocities, age = checked_velocities(
                message,
                self._config.robot.joint_names,
                self.get_clock().now().nanoseconds,
                self._config.bus_driver.command_timeout_s,
            )
        except InvalidCommandError as error:
            self._ignore(str(error))
            return
        self._loop.command(velocities, age, stamp_ns(message))

    def _ignore(self, why: str) -> None:
        self._ignored += 1
        self._loop.refuse_command(f"{why} ({self._ignored} so far)")
        now = time.monotonic()
        if now - self._ignored_logged_at >= _LOG_PERIOD_S:
            self._ignored_logged_at = now
            self.get_logger().warning(f"command ignored: {why} ({self._ignored} so far)")

    # On lines of their own: rclpy ties one severity to each line that logs.

    def _warn(self, text: str) -> None:
        self.get_logger().warning(text)

    def _complain(self, text: str) -> None:
        self.get_logger().error(text)

    # Topics out.

    def _publish(self, snapshot: Snapshot) -> None:
        """Publish one cycle; called by a thread that has nothing else to do."""
        now, now_ns = time.monotonic(), self.get_clock().now().nanoseconds
        self._last = snapshot
        age = now - snapshot.oldest_at
        if age <= self._config.bus_driver.feedback_timeout_s:
            stamp_ns = now_ns - round(_NS * age)
            # A servo that missed its turn makes two messages with one oldest reading.
            if 0 <= self._joint_stamp_ns - stamp_ns < _NS:
                stamp_ns = self._joint_stamp_ns + 1
            self._joint_stamp_ns = stamp_ns
            stamp = time_message(stamp_ns)
            self._joint_states.publish(self._messages.joint_state(snapshot, stamp))

        def at(monotonic: float) -> Time:
            return time_message(now_ns - round(_NS * max(0.0, now - monotonic)))

        sent = None if snapshot.followed is None else at(snapshot.goals_sent_at)
        self._bus_state.publish(
            self._messages.bus_state(snapshot, self._health, at(snapshot.read_at), sent)
        )

    def _publish_diagnostics(self) -> None:
        snapshot, driver = self._last, self._config.bus_driver
        stamp = time_message(self.get_clock().now().nanoseconds)
        if snapshot is None:
            self._tell_health(no_diagnostics(driver.port, stamp))
            return
        torques = self._load.expected([reading.angle for reading in snapshot.readings])
        verdicts = tuple(
            judge(reading, self._thresholds, torque)
            for reading, torque in zip(snapshot.readings, torques, strict=True)
        )
        self._health = Health(verdicts, torques)
        self._log_changes(snapshot)
        self._log_rehearsal(snapshot)
        self._tell_health(diagnostics(snapshot, self._health, driver.port, stamp))

    def _tell_health(self, array: DiagnosticArray) -> None:
        self._diagnostics.publish(of_robot(array, self.get_namespace()))

    def _log_changes(self, snapshot: Snapshot) -> None:
        log = self.get_logger()
        for level, text in self._health_log.changes(snapshot.readings, self._health.verdicts):
            if level is Level.OK:
                log.info(text)
            elif level is Level.ERROR:
                log.error(text)
            else:
                log.warning(text)

    def _log_rehearsal(self, snapshot: Snapshot) -> None:
        """Say in a dry run what would be sent, when it is another motion than before."""
        motion: dict[str, float] = {}
        if snapshot.state is State.DRY_RUN:
            speeds = {
                reading.joint.name: _rehearsed_speed(reading) for reading in snapshot.readings
            }
            motion = {name: speed for name, speed in speeds.items() if speed}
        rounded = {name: round(speed, 1) for name, speed in motion.items()}
        if rounded == self._rehearsed:
            return
        self._rehearsed = rounded
        text = ", ".join(f"{name} {speed:+.3f} rad/s" for name, speed in motion.items())
        self.get_logger().info(f"dry run, not sent: {text or 'rest'}")

    # Services.

    def _set_torque(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        return self._answer(response, lambda: self._loop.set_torque(request.data))

    def _recover(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, self._loop.recover)

    def _emergency_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        def stop() -> str:
            self._loop.emergency_stop()
            self._tell_emergency()
            return "holding until reset"

        return self._answer(response, stop)

    def _reset_emergency_stop(
        self, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        def reset() -> str:
            self._loop.reset_emergency_stop()
            self._tell_emergency()
            return "commands are taken again, from a zero command on"

        return self._answer(response, reset)

    def _tell_emergency(self) -> None:
        self._emergency_active.publish(Bool(data=self._loop.emergency))

    def _answer(self, response, action: Callable[[], str]):  # type: ignore[no-untyped-def]
        try:
            done = action()
        except SnakeError as error:
            response.success, response.message = False, str(error)
            self.get_logger().error(str(error))
        else:
            response.success, response.message = True, done
            self.get_logger().info(done)
        return response

    def _serve(self, service: topics.Service, callback) -> None:  # type: ignore[no-untyped-def]
        self.create_service(service.type, service.name, callback)


def _rehearsed_speed(reading: JointReading) -> float:
    """Return the speed that was not sent [rad/s], 0 for a joint that would rest."""
    if math.isnan(reading.goal):
        # Wheel mode: its speed has a sign of its own. NaN before the first.
        return reading.goal_speed if abs(reading.goal_speed) > 0.0 else 0.0
    ahead = reading.goal - reading.angle
    return math.copysign(reading.goal_speed, ahead) if abs(ahead) > _MOVING_RAD else 0.0


def main() -> int:
    """Run the node; return the exit code."""
    sys.setswitchinterval(THREAD_SWITCH_S)
    return run(BusDriver, "bus_driver")


if __name__ == "__main__":
    sys.exit(main())
