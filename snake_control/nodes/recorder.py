"""Joins what the nodes publish into one row for each control step."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from snake_interfaces.msg import BusState, ControllerState, PlantState, PoseStatus

from snake_control.experiment.series import Series, Step, pose_error
from snake_control.experiment.summary import BusTotals
from snake_control.nodes.topics import BUS_STATE, CONTROLLER_STATE, HEAD_STATUS, PLANT_STATE

Array = NDArray[np.float64]

STATUS_WORDS = {
    ControllerState.STATUS_DISABLED: "disabled",
    ControllerState.STATUS_WAITING: "waiting",
    ControllerState.STATUS_TRACKING: "tracking",
    ControllerState.STATUS_LIMITED: "limited",
    ControllerState.STATUS_STALE: "stale",
    ControllerState.STATUS_INVALID: "invalid",
    ControllerState.STATUS_FAULT: "fault",
    ControllerState.STATUS_ERROR_TOO_LARGE: "error too large",
    ControllerState.STATUS_RECOVERING: "recovering",
    ControllerState.STATUS_HOLDING: "holding",
    ControllerState.STATUS_STOPPED: "stopped",
    ControllerState.STATUS_POSTURE: "to posture",
    ControllerState.STATUS_RESHAPING: "reshaping",
}
FOLLOWING = (
    ControllerState.STATUS_TRACKING,
    ControllerState.STATUS_LIMITED,
    ControllerState.STATUS_RECOVERING,
)

_GROUND_TRUTH_WAIT_NS = 500_000_000
_GROUND_TRUTH_KEPT = 100
_QUEUE = 200


class Recorder:
    """Subscribes to a robot's state topics and fills a ``Series``.

    Each control step gets the ground truth at its stamp and the latest bus cycle before it.
    Time zero is the first step that follows a reference after ``start``. Runs in the executor of
    the node it was given; not thread-safe.

    Attributes:
        received: how many messages have arrived.
        bus: latest bus state, ``None`` before the first.
        head: latest status of the head pose, ``None`` before the first.
        controller: latest controller state, ``None`` before the first.
        latest: newest row of the series, ``None`` before the first.
        fell_at_s: time of the first row in which the robot had fallen [s], ``None`` before.
    """

    def __init__(self, node: Node, series: Series) -> None:
        """Subscribe; rows are appended to ``series`` once ``start`` was called."""
        self.received = 0
        self.bus: BusState | None = None
        self.head: PoseStatus | None = None
        self.controller: ControllerState | None = None
        self.latest: Step | None = None
        self.fell_at_s: float | None = None
        self._series = series
        self._recording = False
        self._zero_ns: int | None = None
        self._waiting: deque[tuple[int, ControllerState, BusState | None]] = deque()
        self._truth: deque[tuple[int, PlantState]] = deque(maxlen=_GROUND_TRUTH_KEPT)
        self._cycle_times_s: list[float] = []
        self._first_bus_ns: int | None = None
        self._first_cycle = 0
        self._last_bus_ns = 0
        self._lost: set[int] = set()
        for topic, callback in (
            (BUS_STATE, self._take_bus),
            (HEAD_STATUS, self._take_head),
            (CONTROLLER_STATE, self._take_controller),
            (PLANT_STATE, self._take_truth),
        ):
            node.create_subscription(topic.type, topic.name, callback, _patient(topic.qos))

    def start(self) -> None:
        """Record from the next control step that follows a reference."""
        self._recording = True

    def finish(self) -> None:
        """Stop recording; steps still waiting for their ground truth get the latest there is."""
        self._join(everything=True)
        self._recording = False

    def bus_totals(self) -> BusTotals | None:
        """Return what the bus did while recording; ``None`` if it was never heard."""
        if self.bus is None:
            return None
        servos = self.bus.servos
        started_ns = self._last_bus_ns if self._first_bus_ns is None else self._first_bus_ns
        heard = len(self._cycle_times_s)
        ran = self.bus.cycles - self._first_cycle + 1 if heard else 0
        return BusTotals(
            cycle_times_s=tuple(self._cycle_times_s),
            cycles=self.bus.cycles,
            late_cycles=self.bus.late_cycles,
            replies=sum(servo.replies for servo in servos),
            misses=sum(servo.misses for servo in servos),
            retries=sum(servo.retries for servo in servos),
            corrupt_replies=sum(servo.corrupt_replies for servo in servos),
            invalid_values=sum(servo.invalid_values for servo in servos),
            lost=tuple(sorted(self._lost)),
            duration_s=(self._last_bus_ns - started_ns) * 1e-9,
            unheard=max(0, ran - heard),
        )

    def _take_bus(self, message: BusState) -> None:
        self.received += 1
        self.bus = message
        if not self._recording:
            return
        self._last_bus_ns = _nanoseconds(message)
        if self._first_bus_ns is None:
            self._first_bus_ns = self._last_bus_ns
            self._first_cycle = message.cycles
        self._cycle_times_s.append(message.cycle_time)
        self._lost |= {_joint(servo.joint) for servo in message.servos if not servo.online}

    def _take_head(self, message: PoseStatus) -> None:
        self.received += 1
        self.head = message

    def _take_controller(self, message: ControllerState) -> None:
        self.received += 1
        self.controller = message
        if not self._recording:
            return
        stamp = _nanoseconds(message)
        if self._zero_ns is None:
            if message.status not in FOLLOWING:
                return
            self._zero_ns = stamp
        self._waiting.append((stamp, message, self.bus))
        self._join()

    def _take_truth(self, message: PlantState) -> None:
        self.received += 1
        self._truth.append((_nanoseconds(message), message))
        self._join()

    def _join(self, everything: bool = False) -> None:
        while self._waiting:
            stamp, controller, bus = self._waiting[0]
            known_until = self._truth[-1][0] if self._truth else 0
            overdue = self._waiting[-1][0] - stamp > _GROUND_TRUTH_WAIT_NS
            if known_until < stamp and not overdue and not everything:
                return
            self._waiting.popleft()
            assert self._zero_ns is not None
            t_s = (stamp - self._zero_ns) * 1e-9
            self.latest = _step(t_s, controller, bus, _truth_at(stamp, self._truth))
            self._series.append(self.latest)
            if self.latest.fallen and self.fell_at_s is None:
                self.fell_at_s = t_s


@dataclasses.dataclass(frozen=True)
class _Truth:
    w: Array
    phi: Array
    nearest: PlantState


def _truth_at(stamp: int, states: Sequence[tuple[int, PlantState]]) -> _Truth | None:
    """Pose and angles between the two ground truths around a stamp, the rest from the nearest."""
    after = next((i for i, (at, _) in enumerate(states) if at >= stamp), len(states))
    around = [states[i] for i in (after - 1, after) if 0 <= i < len(states)]
    around = [entry for entry in around if abs(entry[0] - stamp) <= _GROUND_TRUTH_WAIT_NS]
    if not around:
        return None
    nearest = min(around, key=lambda entry: abs(entry[0] - stamp))[1]
    (t0, first), (t1, last) = around[0], around[-1]
    share = (stamp - t0) / (t1 - t0) if t1 > t0 else 0.0
    w = np.array(first.w) + share * pose_error(last.w, first.w)
    phi = np.array(first.phi) + share * (np.array(last.phi) - np.array(first.phi))
    return _Truth(w, phi, nearest)


def _step(
    t_s: float, controller: ControllerState, bus: BusState | None, truth: _Truth | None
) -> Step:
    return Step(
        t_s=t_s,
        status=STATUS_WORDS[controller.status],
        w_measured=controller.w,
        w_d=controller.w_d,
        phi_measured=controller.phi,
        u_unlimited=controller.u_unlimited,
        u=controller.u,
        phi_tilde_dot_d=controller.phi_tilde_dot_d,
        speed_scale=controller.speed_scale,
        speed_limited=tuple(map(_joint, controller.speed_limited)),
        range_limited=tuple(map(_joint, controller.range_limited)),
        V_h=controller.v_h,
        V_b1=controller.v_b1,
        d_min=controller.d_min,
        sigma_min_B_tilde=controller.sigma_min_b_tilde,
        sigma_min_A_hat=controller.sigma_min_a_hat,
        damping=controller.damping,
        singular_nearness=controller.singular_nearness,
        singular_shape=controller.singular_shape,
        w=None if truth is None else truth.w,
        phi=None if truth is None else truth.phi,
        d_min_true=math.nan if truth is None else truth.nearest.d_min,
        fallen=truth is not None and truth.nearest.fallen,
        slip=None if truth is None else truth.nearest.slip,
        effort=None if truth is None else truth.nearest.effort,
        step_time_s=controller.step_time,
        bus_cycle_time_s=math.nan if bus is None else bus.cycle_time,
        bus_rate_hz=math.nan if bus is None else bus.cycle_rate,
    )


def _patient(qos: QoSProfile) -> QoSProfile:
    """Return a profile with a queue that outlasts a stall of this process."""
    return QoSProfile(
        history=qos.history,
        depth=_QUEUE,
        reliability=qos.reliability,
        durability=qos.durability,
    )


def _nanoseconds(message: object) -> int:
    stamp = message.header.stamp  # type: ignore[attr-defined]
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _joint(name: str) -> int:
    return int(name.rpartition("_")[2])
