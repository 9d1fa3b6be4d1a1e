"""Node ``mock_bus``: simulated servos on a port, the body they move, and its motion capture."""

from __future__ import annotations

import math
import sys
import threading
import time
from array import array
from collections import deque
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.random import Generator, SeedSequence
from rclpy.node import Node
from snake_interfaces.msg import PlantState as PlantStateMessage
from snake_interfaces.srv import InjectFault
from std_srvs.srv import Trigger

from snake_control.config import Config, MockBusConfig
from snake_control.errors import BusError, ConfigError, SnakeError
from snake_control.mock.bus import Bus
from snake_control.mock.faults import Fault, FaultError
from snake_control.mock.mechanics import MotorParameters
from snake_control.mock.motion_capture import CapturedPose, MotionCapture, Noise
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.port import PtyPort
from snake_control.mock.pose_faults import POSE_KINDS, PoseFault
from snake_control.mock.scenario import load_scenario
from snake_control.mock.server import Server
from snake_control.mock.servo import Servo
from snake_control.mock.simulation import BodySimulation, Mounting, Snapshot
from snake_control.mock.units import in_sensor_range
from snake_control.model.rotation import quaternion_from_rpy
from snake_control.nodes import topics
from snake_control.nodes.conversions import header, point, quaternion
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.process import THREAD_SWITCH_S, run
from snake_control.plant.kinematic import KinematicPlant
from snake_control.plant.plant import PlantState

_GROUND_TRUTH_HZ = 50.0
# Snapshots come at multiples of the body's step, which no sum of floating point hits exactly.
_ROUNDING_S = 1e-6
_CHECK_PERIOD_S = 0.2
_ELSEWHERE = "elsewhere"


class MockBus(Node):
    """A robot without hardware: a port for the driver, ``mocap/pose`` for everybody else.

    The server's thread owns servos and body. A second thread reports: it reads the newest
    snapshot of the body, and publishes on time whatever the executor does.
    """

    def __init__(self, **overrides: Any) -> None:
        """Start everything.

        Raises:
            ConfigError: a parameter that is not allowed.
            BusError: the port's link cannot be put in place.
        """
        super().__init__("mock_bus", **overrides)
        config = NodeParameters(self, "mock_bus").config
        self._robot, self._own = config.robot, config.mock_bus
        *servo_rngs, mocap_rng = _generators(self._own.seed, config.robot.joints + 1)
        mountings = _mountings(config)
        servos = _servos(config, mountings, servo_rngs)
        body = KinematicPlant(config.robot)
        initial = body.reset(config.robot.start_joint_angles_rad)
        self._started_at = time.monotonic()
        self._changed = threading.Condition()
        self._stop = False
        self._captures: deque[Snapshot[PlantState]] = deque()
        self._truths: deque[Snapshot[PlantState]] = deque()
        self._capture_at = self._truth_at = self._started_at
        self._simulation = BodySimulation(
            servos,
            mountings,
            body,
            initial,
            1.0 / self._own.step_hz,
            self._started_at,
            steps_per_body_step=self._own.steps_per_body_step,
            held_until_torque_on=self._own.held_until_torque_on,
            on_snapshot=self._take_snapshot,
        )
        noise = Noise(self._own.mocap_position_noise_m, self._own.mocap_rotation_noise_rad)
        self._motion_capture = MotionCapture(noise, self._own.mocap_delay_s, mocap_rng)
        self._fallen_at = math.nan

        t = topics.MOCAP_POSE
        self._pose = self.create_publisher(t.type, t.name, t.qos)
        t = topics.PLANT_STATE
        self._plant_state = self.create_publisher(t.type, t.name, t.qos)
        self.create_timer(_CHECK_PERIOD_S, self._check)

        self._port = PtyPort(self._own.port)
        bus = Bus(servos, wire_time=self._own.wire_time)
        self._server = Server(
            self._port,
            bus,
            self._simulation,
            time.monotonic,
            seed=self._own.seed,
            log=self.get_logger().warning,
        )
        if self._own.scenario:
            self._server.schedule(load_scenario(self._own.scenario))
        for service, callback in (
            (topics.INJECT_FAULT, self._inject_fault),
            (topics.CLEAR_FAULTS, self._clear_faults),
        ):
            self.create_service(service.type, service.name, callback)
        self._reporter = threading.Thread(target=self._report, name="reporter", daemon=True)
        self._server.start()
        self._reporter.start()
        self.get_logger().info(
            f"{len(servos)} servos at {self._own.port} ({self._port.device}), "
            f"{self._own.baud_rate} bit/s"
        )

    def close(self) -> None:
        """End the threads and remove the port's link."""
        with self._changed:
            self._stop = True
            self._changed.notify()
        self._reporter.join()
        self._server.stop()
        self._port.close()

    def _inject_fault(
        self, request: InjectFault.Request, response: InjectFault.Response
    ) -> InjectFault.Response:
        fault: Fault | PoseFault
        try:
            if request.fault in POSE_KINDS:
                fault = self._begin_pose_fault(request)
            else:
                fault = Fault(
                    kind=request.fault,
                    ids=tuple(request.ids),
                    duration_s=request.duration,
                    value=request.value or None,
                    probability=request.probability,
                )
                self._server.inject(fault)
        except SnakeError as error:
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, str(fault)
        return response

    def _begin_pose_fault(self, request: InjectFault.Request) -> PoseFault:
        if request.ids:
            raise FaultError(
                "ids", list(request.ids), f"{request.fault} concerns the motion capture: give none"
            )
        fault = PoseFault(
            request.fault, request.duration, request.value or None, request.probability
        )
        self._motion_capture.faults.inject(fault, time.monotonic())
        self.get_logger().warning(f"fault: {fault}")
        return fault

    def _clear_faults(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            count = self._server.clear_faults() + self._motion_capture.faults.clear()
            response.message = f"{count} faults ended"
        except SnakeError as error:
            response.success, response.message = False, str(error)
        else:
            response.success = True
        return response

    def _check(self) -> None:
        self._server.check()
        if not self._reporter.is_alive():
            raise BusError("the thread that publishes the motion capture has died")

    def _take_snapshot(self, snapshot: Snapshot[PlantState]) -> None:
        """Hand the reporter what is due; called by the server's thread."""
        capture = snapshot.time >= self._capture_at - _ROUNDING_S
        truth = snapshot.time >= self._truth_at - _ROUNDING_S
        if not (capture or truth):
            return
        with self._changed:
            if capture:
                self._capture_at = _next(self._capture_at, self._own.mocap_rate_hz, snapshot.time)
                self._captures.append(snapshot)
            if truth:
                self._truth_at = _next(self._truth_at, _GROUND_TRUTH_HZ, snapshot.time)
                self._truths.append(snapshot)
            self._changed.notify()

    def _report(self) -> None:
        """Publish what was taken, poses after their delay."""
        while True:
            with self._changed:
                while not (self._captures or self._truths or self._stop):
                    left = self._motion_capture.next_report_at - time.monotonic()
                    if left <= 0:
                        break
                    self._changed.wait(left if math.isfinite(left) else None)
                if self._stop:
                    return
                captures, self._captures = self._captures, deque()
                truths, self._truths = self._truths, deque()
            for snapshot in captures:
                w = snapshot.state.w
                self._motion_capture.capture(snapshot.time, w[:3], quaternion_from_rpy(w[3:]))
            for pose in self._motion_capture.report(time.monotonic()):
                self._pose.publish(self._pose_message(pose))
            for snapshot in truths:
                self._plant_state.publish(self._plant_state_message(snapshot))

    def _stamp_ns(self, monotonic: float) -> int:
        """Time of the node's clock at a monotonic time."""
        age_ns = round((time.monotonic() - monotonic) * 1e9)
        return self.get_clock().now().nanoseconds - age_ns

    def _pose_message(self, pose: CapturedPose) -> PoseStamped:
        frame_id = _ELSEWHERE if pose.elsewhere else self._own.frame_id
        message = PoseStamped(header=header(self._stamp_ns(pose.time), frame_id))
        message.pose.position = point(pose.position)
        message.pose.orientation = quaternion(pose.quaternion)
        return message

    def _plant_state_message(self, snapshot: Snapshot[PlantState]) -> PlantStateMessage:
        state = snapshot.state
        if state.fallen and math.isnan(self._fallen_at):
            self._fallen_at = snapshot.time - self._started_at
            self.get_logger().error(f"the robot fell {self._fallen_at:.2f} s after the start")
        return PlantStateMessage(
            header=header(self._stamp_ns(snapshot.time), self._own.frame_id),
            w=state.w,
            name=list(self._robot.joint_names),
            # Of an array the message checks the type once, of a list every element.
            phi=array("d", state.phi),
            phi_dot=array("d", state.phi_dot),
            effort=array("d", state.effort),
            wheeled_link=array("H", self._robot.wheeled_links),
            slip=array("d", state.slip),
            d_min=float(state.d_min),
            fallen=bool(state.fallen),
            fallen_at=self._fallen_at,
        )


def _next(due: float, rate_hz: float, now: float) -> float:
    """Return when the next sample is due; those missed in a stall are left out."""
    return max(due + 1.0 / rate_hz, now)


def _generators(seed: int, count: int) -> list[Generator]:
    """Independent random numbers for each user, the same ones for the same seed."""
    return [np.random.default_rng(s) for s in SeedSequence(seed).spawn(count)]


def _mountings(config: Config) -> list[Mounting]:
    return [
        Mounting(direction, offset)
        for direction, offset in zip(
            config.servos.directions, config.servos.zero_offsets_rad, strict=True
        )
    ]


def _servos(config: Config, mountings: list[Mounting], rngs: list[Generator]) -> list[Servo]:
    own = config.mock_bus
    parameters = _servo_parameters(own)
    eeprom = {
        "baud_rate": round(2_000_000 / own.baud_rate) - 1,
        "return_delay_time": own.return_delay_raw,
    }
    servos = []
    starts = config.robot.start_joint_angles_rad
    for i, (servo_id, mounting, rng) in enumerate(
        zip(config.servos.ids, mountings, rngs, strict=True)
    ):
        angle = mounting.servo_angle(starts[i])
        # A whole turn away the sensor would see the servo, but at another joint angle.
        if abs(angle) > math.pi or not in_sensor_range(angle):
            raise ConfigError(
                f"robot.start_joint_angles_rad[{i}]",
                starts[i],
                f"servo {servo_id} would start at {angle:.3g} rad, beyond its sensor's +-2.62",
            )
        # A robot's servos have been set up for the mode that its configuration says.
        wheel = config.servos.velocity_modes[i] == "wheel"
        limits = {"cw_angle_limit": 0, "ccw_angle_limit": 0} if wheel else {}
        servos.append(Servo(servo_id, parameters, angle_rad=angle, eeprom=eeprom | limits, rng=rng))
    return servos


def _servo_parameters(own: MockBusConfig) -> ServoParameters:
    return ServoParameters(
        motor=MotorParameters(
            stall_torque_nm=own.stall_torque_nm,
            no_load_speed_rad_s=own.no_load_speed_rad_s,
            acceleration_rad_s2=own.acceleration_rad_s2,
            friction_torque_nm=own.friction_torque_nm,
        ),
        supply_voltage_v=own.supply_voltage_v,
    )


def main() -> int:
    """Run the node."""
    sys.setswitchinterval(THREAD_SWITCH_S)
    return run(MockBus, "mock_bus")


if __name__ == "__main__":
    sys.exit(main())
