"""What the driver does with a command, by its situation alone."""

from __future__ import annotations

import dataclasses

import pytest

from snake_control.ax12.joint import JointSetup
from snake_control.nodes.bus_command import CommandBuffer
from snake_control.nodes.bus_decision import Situation, decide
from snake_control.nodes.bus_snapshot import State

JOINT = JointSetup("joint_3", 3, 1, 0.0, "joint", -2.6, 2.6, 5.5, 1, 32, 32, 1.0)
DRIVEN = Situation(
    active=True,
    emergency=False,
    fault="",
    port="",
    dry_run=False,
    armed=True,
    torque_on=(JOINT,),
    joints=1,
    lowering="",
)
AHEAD = (0.5,)


def decided(**changes: object) -> tuple[State, str, tuple[float, ...] | None]:
    commands = CommandBuffer(0.1)
    commands.take(AHEAD, 0.0, 10.0)
    return decide(dataclasses.replace(DRIVEN, **changes), commands, 10.01)  # type: ignore[arg-type]


def test_a_fresh_command_moves_a_robot_that_is_well() -> None:
    assert decided() == (State.MOVING, "moving", AHEAD)


@pytest.mark.parametrize(
    ("changes", "state", "text"),
    [
        ({"active": False}, State.INACTIVE, "not activated"),
        (
            {"active": False, "emergency": True},
            State.INACTIVE,
            "not activated; emergency stop is latched",
        ),
        ({"emergency": True}, State.EMERGENCY_STOP, "needs ~/reset_emergency_stop"),
        ({"emergency": True, "fault": "servo 3 is hot"}, State.EMERGENCY_STOP, "servo 3 is hot"),
        ({"fault": "servo 3 is hot"}, State.STOPPED, "servo 3 is hot; needs ~/recover"),
        (
            {"fault": "gone", "port": "opening it again", "armed": False},
            State.STOPPED,
            "gone; opening it again; needs ~/recover",
        ),
        ({"armed": False, "torque_on": ()}, State.TORQUE_OFF, "torque is off"),
        ({"armed": False}, State.HOLDING, "torque is still on at joint_3"),
        ({"armed": False, "joints": 2}, State.TORQUE_OFF, "torque is still on at joint_3"),
        ({"lowering": "lowering: far"}, State.LOWERING, "lowering: far"),
    ],
)
def test_nothing_else_does(changes: dict[str, object], state: State, text: str) -> None:
    found, words, velocities = decided(**changes)
    assert (found, velocities) == (state, None)
    assert text in words


def test_a_dry_run_works_commands_out() -> None:
    assert decided(dry_run=True, armed=False, torque_on=()) == (
        State.DRY_RUN,
        "dry run: moving",
        AHEAD,
    )
    _, text, _ = decided(dry_run=True, port="opening it again")
    assert text == "dry run: opening it again; torque is on at joint_3 (servo id 3)"


def test_a_note_is_told_while_holding() -> None:
    situation = dataclasses.replace(DRIVEN, note="lowering ended")
    state, text, _ = decide(situation, CommandBuffer(0.1), 10.0)
    assert (state, text) == (State.HOLDING, "holding: no command yet; lowering ended")


def test_what_is_followed_is_known_by_its_stamp_and_by_how_long_it_waited() -> None:
    commands = CommandBuffer(0.1)
    assert commands.followed is None
    commands.take(AHEAD, 0.004, 10.0, stamp_ns=123)
    decide(DRIVEN, commands, 10.015)
    assert commands.followed is not None
    assert commands.followed.stamp_ns == 123
    assert commands.followed.waited == pytest.approx(0.015)
    decide(DRIVEN, commands, 10.2)
    assert commands.followed is None, "that one is too old"
