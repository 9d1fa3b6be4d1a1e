"""The recorder joins messages of a real graph into rows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from snake_interfaces.msg import BusState, ControllerState, PlantState, ServoState

from snake_control.config import RobotConfig
from snake_control.experiment.series import Series
from snake_control.nodes.recorder import Recorder
from snake_control.nodes.topics import BUS_STATE, CONTROLLER_STATE, PLANT_STATE
from support.graph import Graph

ROBOT = RobotConfig()
NAMES = list(ROBOT.joint_names)


def stamped(message, t_s: float):
    message.header.stamp.sec = 100 + int(t_s)
    message.header.stamp.nanosec = round((t_s - int(t_s)) * 1e9)
    return message


def controller_state(t_s: float, **changes) -> ControllerState:
    fields = {
        "status": ControllerState.STATUS_TRACKING,
        "experiment_case": 3,
        "w": [0.1] * 6,
        "w_d": [0.0] * 6,
        "error": [0.1] * 6,
        "name": NAMES,
        "phi": [0.5] * 11,
        "u_unlimited": [2.0] * 11,
        "u": [1.0] * 11,
        "scp_name": ["joint_3", "joint_6", "joint_8", "joint_10"],
        "phi_tilde_dot_d": [0.1, 0.2, 0.3, 0.4],
        "speed_scale": 0.5,
        "speed_limited": ["joint_11", "joint_2"],
        "range_limited": [],
        "v_h": 1e-7,
        "v_b1": 2e8,
        "d_min": 0.02,
        "damping": 0.25,
        "singular_nearness": 0.7,
        "singular_shape": "parallel",
    }
    return stamped(ControllerState(**(fields | changes)), t_s)


def plant_state(t_s: float, x: float, **changes) -> PlantState:
    fields = {
        "w": [x, 0.0, 0.2, 0.0, 0.0, 0.0],
        "name": NAMES,
        "phi": [10.0 * x] * 11,
        "effort": [0.1] * 11,
        "wheeled_link": list(ROBOT.wheeled_links),
        "slip": [0.001] * 4,
        "d_min": 0.03,
        "fallen_at": math.nan,
    }
    return stamped(PlantState(**(fields | changes)), t_s)


def bus_state(t_s: float, online: bool = True, misses: int = 0, cycles: int = 10) -> BusState:
    servos = [
        ServoState(joint=name, id=i, online=True, replies=100, retries=1)
        for i, name in enumerate(NAMES, start=1)
    ]
    servos[3].online = online
    servos[3].misses = misses
    return stamped(
        BusState(servos=servos, cycle_time=0.015, cycle_rate=50.0, cycles=cycles, late_cycles=2),
        t_s,
    )


class Wired:
    """A recorder on a graph, and publishers of all it hears."""

    def __init__(self, graph: Graph) -> None:
        self.series = Series(ROBOT)
        self.recorder = Recorder(graph.node, self.series)
        self._graph = graph
        self._publishers = {
            type(message): graph.publisher(topic, wait=True)
            for topic, message in (
                (CONTROLLER_STATE, ControllerState()),
                (PLANT_STATE, PlantState()),
                (BUS_STATE, BusState()),
            )
        }

    def send(self, message) -> None:
        self._publishers[type(message)].publish(message)

    def send_and_wait(self, message, condition, what: str) -> None:
        self.send(message)
        self._graph.wait_for(condition, 10.0, what)

    def wait_for_rows(self, count: int) -> None:
        self._graph.wait_for(lambda: len(self.series) >= count, 10.0, f"{count} rows")


@pytest.fixture
def wired():
    with Graph() as graph:
        yield Wired(graph)


def test_rows_start_with_the_first_step_that_follows(wired):
    recorder = wired.recorder
    wired.send_and_wait(controller_state(0.0), lambda: recorder.controller, "an early state")
    recorder.start()
    for t in (1.00, 1.02, 1.04, 1.06):
        status = ControllerState.STATUS_WAITING if t < 1.02 else ControllerState.STATUS_LIMITED
        wired.send(controller_state(t, status=status))
    wired.send(plant_state(1.1, 0.0))
    wired.wait_for_rows(3)
    assert wired.series.numbers("t_s") == pytest.approx([0.0, 0.02, 0.04])
    assert set(wired.series.texts("status")) == {"limited"}
    assert wired.series.joints("speed_limited") == [(11, 2)] * 3
    assert wired.series.numbers("phi_tilde_dot_d")[0] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert wired.series.numbers("damping") == pytest.approx([0.25] * 3)
    assert wired.series.numbers("singular_nearness") == pytest.approx([0.7] * 3)
    assert wired.series.texts("singular_shape") == ["parallel"] * 3


def test_ground_truth_is_that_of_the_control_steps_moment(wired):
    wired.recorder.start()
    wired.send(plant_state(1.000, 0.10))
    wired.send(plant_state(1.020, 0.12))
    wired.send(controller_state(1.025))
    wired.send(plant_state(1.040, 0.16, fallen=True))
    wired.wait_for_rows(1)
    series = wired.series
    assert series.w[0, 0] == pytest.approx(0.13)
    assert series.phi[0] == pytest.approx([1.3] * 11)
    assert series.numbers("error")[0, 0] == pytest.approx(0.13)
    assert series.numbers("w_measured")[0] == pytest.approx([0.1] * 6)
    assert series.numbers("fallen")[0] == 0.0  # the nearest truth came before the fall
    assert series.numbers("d_min_true")[0] == pytest.approx(0.03)
    assert series.numbers("effort")[0] == pytest.approx([0.1] * 11)


def test_step_without_ground_truth_is_kept(wired):
    wired.recorder.start()
    for t in (1.0, 1.3, 1.6):
        wired.send(controller_state(t))
    wired.wait_for_rows(1)  # after half a second without it, the truth is given up
    assert not wired.series.truth_known.any()
    assert np.isnan(wired.series.numbers("w")).all()
    wired.recorder.finish()
    assert wired.series.numbers("t_s") == pytest.approx([0.0, 0.3, 0.6])


def test_bus_totals_count_what_was_seen_while_recording(wired):
    recorder = wired.recorder
    assert recorder.bus_totals() is None
    wired.send_and_wait(bus_state(0.9, online=False), lambda: recorder.bus, "an early state")
    recorder.start()
    for i, online in enumerate((True, False, True)):
        message = bus_state(1.0 + 0.02 * i, online, misses=5 * i, cycles=11 + i)
        wired.send_and_wait(
            message, lambda i=i: recorder.bus.cycles == 11 + i, "the state just sent"
        )
    totals = recorder.bus_totals()
    assert totals.cycle_times_s == pytest.approx((0.015,) * 3)
    assert totals.duration_s == pytest.approx(0.04)
    assert (totals.replies, totals.misses, totals.retries) == (1100, 10, 11)
    assert (totals.cycles, totals.late_cycles) == (13, 2)
    assert totals.lost == (4,)
    assert totals.unheard == 0
    message = bus_state(1.2, cycles=17)
    wired.send_and_wait(message, lambda: recorder.bus.cycles == 17, "a state after a gap")
    assert recorder.bus_totals().unheard == 3
