"""What keys mean."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.trajectory.keys import HELP, Keys

KEYS = "wasdrfqetg"


def keys() -> Keys:
    return Keys(speed=0.02, turning_speed=0.1, hold_s=0.6)


@pytest.mark.parametrize(("one", "other"), ["ws", "ad", "rf", "qe", "tg"])
def test_opposite_keys_do_the_opposite(one: str, other: str) -> None:
    found = []
    for key in (one, other.upper()):
        pressed = keys()
        assert pressed.press(key, 10.0)
        command = pressed.command(10.1)
        assert command.in_heading_frame
        found.append(np.concatenate((command.linear, command.angular)))
    np.testing.assert_array_equal(found[0], -found[1])
    assert np.abs(found[0][:3]).max() in (0.0, 0.02)
    assert np.abs(found[0][3:]).max() in (0.0, 0.1)
    assert np.count_nonzero(found[0]) == 1


def test_the_head_stops_shortly_after_the_last_key() -> None:
    pressed = keys()
    assert pressed.command(0.0).is_zero
    pressed.press("w", 10.0)
    assert not pressed.command(10.6).is_zero
    assert pressed.command(10.61).is_zero
    pressed.press("w", 20.0)
    pressed.press(" ", 20.1)
    assert pressed.command(20.1).is_zero


def test_scale_changes_both_speeds_within_bounds() -> None:
    pressed = keys()
    for _ in range(30):
        assert pressed.press("u", 10.0)
    pressed.press("w", 10.0)
    assert pressed.command(10.0).linear[0] == pytest.approx(0.08)
    for _ in range(30):
        pressed.press("j", 10.0)
    pressed.press("q", 10.0)
    assert pressed.command(10.0).angular[2] == pytest.approx(0.01)


def test_other_keys_mean_nothing() -> None:
    pressed = keys()
    pressed.press("w", 10.0)
    assert not pressed.press("z", 10.1)
    assert not pressed.command(10.1).is_zero


def test_the_help_names_every_key() -> None:
    words = HELP.format(hold_s=0.6).split()
    assert set(KEYS) | {"u", "j", "space", "x"} <= set(words)
