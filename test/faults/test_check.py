"""The campaign's judge finds every violation in records that are made up."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from faults.check import Record, judge, look_ahead_bound, timeouts
from faults.scenario import Expect, Scenario, load
from snake_control.config import load as load_config
from snake_control.mock.fault_kinds import KINDS
from support.graph import CONFIG

ROBOT = load_config(CONFIG / "paper_robot.yaml")
SPEED = np.array([0.0] * 7 + [0.4, 0.0, 0.0, 0.0])
HOLDING, MOVING, STOPPED = 1, 2, 4
STOPS = Scenario("x", "motion", Expect.STOPS, timeout="feedback", reported="servo id 8")


def record(rest_after: float = 0.5, stopped_at: float = 0.5, text: str = "servo id 8") -> Record:
    """Joint 8 moves at 0.4 rad/s from 1 s before the fault on until ``rest_after``."""
    time = np.arange(-1.0, 2.0, 0.02) + 100.0
    phi = np.zeros((len(time), 11))
    phi_dot = np.zeros((len(time), 11))
    moving = time <= 100.0 + rest_after
    phi_dot[moving, 7] = 0.4
    phi[:, 7] = 0.4 * np.minimum(time - 99.0, 1.0 + rest_after)
    states = [
        (t, STOPPED, text) if t >= 100.0 + stopped_at else (t, MOVING, "moving") for t in time
    ]
    return Record(100.0, 102.0, time, phi, phi_dot, states, SPEED)


def test_a_stop_in_time_holds() -> None:
    outcome = judge(STOPS, record(), ROBOT)
    assert outcome.violations == []
    assert outcome.stop_s == pytest.approx(0.5, abs=0.03)
    assert outcome.did == "servo id 8"


def test_a_late_stop_is_found() -> None:
    (wrong,) = judge(STOPS, record(rest_after=0.8), ROBOT).violations
    assert wrong.startswith("rest after 0.80 s")


def test_a_robot_that_does_not_stop_is_found() -> None:
    outcome = judge(STOPS, record(rest_after=5.0, stopped_at=9.0), ROBOT)
    assert "did not stop" in outcome.violations
    assert "never came to rest" in outcome.violations


def test_a_fault_that_nobody_reports_is_found() -> None:
    (wrong,) = judge(STOPS, record(text="something else"), ROBOT).violations
    assert wrong.startswith("not reported")


def test_a_stop_without_need_is_found() -> None:
    goes_on = dataclasses.replace(STOPS, expect=Expect.GOES_ON)
    found = judge(goes_on, record(), ROBOT).violations
    assert found[0] == "stopped: servo id 8"


def test_a_robot_that_should_go_on_and_does_not_is_found() -> None:
    goes_on = dataclasses.replace(STOPS, expect=Expect.GOES_ON, reported="")
    moving = record(rest_after=5.0, stopped_at=9.0)
    assert judge(goes_on, moving, ROBOT).violations == []
    held = dataclasses.replace(
        moving,
        states=[(t, HOLDING if t > 100.5 else state, text) for t, state, text in moving.states],
    )
    assert judge(goes_on, held, ROBOT).violations == ["does not go on: moving"]
    still = record(rest_after=1.0, stopped_at=9.0)
    assert judge(goes_on, still, ROBOT).violations == ["joint_8 does not go on"]


def test_a_dead_process_is_found() -> None:
    dead = dataclasses.replace(record(), died=["bus_driver"])
    assert judge(STOPS, dead, ROBOT).violations == ["bus_driver died"]


def test_a_joint_out_of_its_range_is_found_unless_it_is_limp() -> None:
    out = record()
    out.phi[60, 3] = 2.7
    assert "joint_4 left its range" in judge(STOPS, out, ROBOT).violations[0]
    limp = dataclasses.replace(STOPS, limp=(4,))
    assert judge(limp, out, ROBOT).violations == []


@pytest.mark.parametrize(("rest_after", "holds"), [(0.55, True), (0.75, False)])
def test_the_look_ahead_bound_is_what_holds_without_a_bus(rest_after: float, holds: bool) -> None:
    dead = dataclasses.replace(STOPS, line_dead=True)
    found = judge(dead, record(rest_after=rest_after, stopped_at=0.5), ROBOT)
    assert found.travel == pytest.approx(0.4 * rest_after, abs=0.02)
    assert (found.violations == []) is holds, found.violations
    assert look_ahead_bound(ROBOT, SPEED)[7] == pytest.approx(0.29, abs=0.02)


def test_a_joint_that_goes_on_after_the_stop_is_found() -> None:
    found = judge(STOPS, record(rest_after=1.6, stopped_at=0.5), ROBOT)
    assert any(wrong.startswith("joint_8 went") for wrong in found.violations)


def test_a_record_in_which_time_stood_still_is_known() -> None:
    whole = record()
    assert judge(STOPS, whole, ROBOT).stalled_s == pytest.approx(0.02, abs=0.011)
    kept = (whole.time < 100.2) | (whole.time > 100.6)
    gap = dataclasses.replace(
        whole, time=whole.time[kept], phi=whole.phi[kept], phi_dot=whole.phi_dot[kept]
    )
    assert judge(STOPS, gap, ROBOT).stalled_s == pytest.approx(0.44, abs=0.03)
    early = whole.time < 101.0
    cut = dataclasses.replace(
        whole, time=whole.time[early], phi=whole.phi[early], phi_dot=whole.phi_dot[early]
    )
    assert judge(STOPS, cut, ROBOT).stalled_s == pytest.approx(1.0, abs=0.03)


def test_a_violation_comes_with_what_was_heard() -> None:
    shown = str(judge(STOPS, record(text="something else"), ROBOT))
    assert "not reported" in shown
    assert "+0.500 s driver: 4 something else" in shown
    assert "+0.500 s joint_8 moved last" in shown


def test_the_campaign_has_every_fault_and_every_process() -> None:
    scenarios = load()
    assert len(scenarios) >= 40
    assert {fault.fault for s in scenarios for fault in s.inject} == set(KINDS)
    killed = {s.process for s in scenarios if s.signal == "KILL"}
    frozen = {s.process for s in scenarios if s.signal == "STOP"}
    nodes = {"mock_bus", "bus_driver", "scp_controller", "pose_input", "trajectory_generator"}
    assert killed == frozen == nodes
    known = timeouts(ROBOT)
    needed = [s for s in scenarios if s.expect in (Expect.STOPS, Expect.RESTS)]
    assert all(s.timeout in known for s in needed)


def test_a_field_that_there_is_not_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scenarios.yaml"
    path.write_text("scenarios: [{name: a, situation: motion, expect: stops, speed: 3}]")
    with pytest.raises(ValueError, match="unknown fields"):
        load(path)
    path.write_text("scenarios: [{name: a, situation: idle, expect: stops}]")
    with pytest.raises(ValueError, match="idle"):
        load(path)
