"""A part of the campaign of head trajectories; ``make heads`` runs all of it."""

from __future__ import annotations

import pytest
from heads.campaign import config, try_feasible, try_hostile

from support.head_trajectories import HOSTILE_KINDS, feasible, hostile


@pytest.mark.parametrize("number", [0, 1, 4, 5])
def test_what_the_robot_can_do_is_accepted_and_done(number: int) -> None:
    outcome = try_feasible(number)
    assert outcome.accepted, outcome.refusal
    assert outcome.completed
    assert not outcome.fell
    assert outcome.range_rad <= 0.0
    assert outcome.speed_rad_s <= 1e-9
    assert outcome.error_m < 0.003
    assert outcome.error_rad < 0.01


LED_TO_THE_FLOOR = 37
LEFT_WITH_A_SINGULAR_HEAD = 92
STUCK_UNTIL_A_POSTURE = 80
"""This one depends on the last digit: another processor's rounding may let it come free."""


@pytest.mark.parametrize(
    "number",
    [
        *range(len(HOSTILE_KINDS)),
        LED_TO_THE_FLOOR,
        LEFT_WITH_A_SINGULAR_HEAD,
        STUCK_UNTIL_A_POSTURE,
    ],
    ids=[*HOSTILE_KINDS, "led_to_the_floor", "left_with_a_singular_head", "stuck_until_a_posture"],
)
def test_what_it_must_not_do_is_ridden_out(number: int) -> None:
    outcome = try_hostile(number)
    assert not outcome.fell
    assert outcome.d_min_m > 0.0
    assert outcome.range_rad <= 0.0
    assert outcome.speed_rad_s <= 1e-9
    assert outcome.floor_m > config().supervisor.floor_stop_m - 1e-4
    assert "the floor" in outcome.reasons or number != LED_TO_THE_FLOOR
    assert outcome.completed, f"tracked again after {outcome.took:.1f} s"
    assert not outcome.command or number == STUCK_UNTIL_A_POSTURE


def test_the_limited_servos_ride_it_out_too() -> None:
    outcome = try_hostile(HOSTILE_KINDS.index("jump"), "limited")
    assert not outcome.fell
    assert outcome.range_rad <= 0.0


def test_trajectories_do_not_depend_on_how_many_there_are() -> None:
    few, many = feasible(5), feasible(200)
    assert [f.name for f in few] == [f.name for f in many[:5]]
    assert [f.duration for f in few] == [f.duration for f in many[:5]]
    w = few[0].start
    assert hostile(w, 3)[2].name == hostile(w, 100)[2].name
