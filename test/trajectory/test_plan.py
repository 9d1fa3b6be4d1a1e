"""From wanted poses to a motion that begins where the head is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.control.reference import Reference
from snake_control.errors import TrajectoryError
from snake_control.trajectory.plan import Plan

CONFIG = TrajectoryGeneratorConfig()
HEAD = np.array([0.1, -0.2, 0.2, 0.3, 0.4, 0.5])
REST = Reference(HEAD, np.zeros(6))


def ahead(*ways: float) -> np.ndarray:
    poses = np.tile(HEAD, (len(ways), 1))
    poses[:, 0] += ways
    return poses


def test_it_begins_where_the_head_is_and_takes_the_usual_speed() -> None:
    plan = Plan(CONFIG, REST, ahead(0.05, 0.1))
    assert plan.duration == pytest.approx(0.1 / CONFIG.speed_m_s)
    motion = plan.made()(7.0)
    np.testing.assert_allclose(motion.sample(7.0).w_d, HEAD, atol=1e-12)
    np.testing.assert_allclose(motion.sample(7.0).w_d_dot, 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.sample(12.0).w_d[0], HEAD[0] + 0.05, atol=1e-9)
    np.testing.assert_allclose(motion.sample(17.0).w_d[0], HEAD[0] + 0.1, atol=1e-9)


def test_it_takes_over_from_a_motion_without_a_jump() -> None:
    moving = Reference(HEAD, np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.1]), time_scale=0.5)
    first = Plan(CONFIG, moving, ahead(0.05), times=[4.0]).made()(0.0).sample(0.0)
    np.testing.assert_allclose(first.w_d, HEAD, atol=1e-12)
    np.testing.assert_allclose(first.w_d_dot, 0.5 * moving.w_d_dot, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"poses": np.empty((0, 6))}, "no poses"),
        ({"poses": ahead(0.1, 0.2), "times": [1.0]}, "1 times for 2 poses"),
        ({"poses": ahead(0.1), "times": [0.0]}, "pose 0 is to be reached at 0.0 s"),
        ({"poses": ahead(0.1, 0.2), "times": [9.0, 8.0]}, "pose 2 comes at 8 s"),
        ({"poses": ahead(math.nan)}, "pose 1 is not finite"),
        ({"poses": ahead(0.1), "speed": -1.0}, "speed is -1.0"),
        ({"poses": ahead(0.1), "speed": math.nan}, "speed is nan"),
        ({"poses": ahead(0.1), "times": [1.0]}, "move at 0.15 m/s, allowed: max_linear_speed"),
        ({"poses": HEAD + [[0, 0, 0, 0, 0, 2.0]], "times": [5.0]}, "turn at 0.6 rad/s, allowed"),
        ({"poses": HEAD + [[0, 0, 0, 0, 1.1, 0]]}, "pitch 1.5 rad"),
    ],
)
def test_what_cannot_be_is_refused_with_what_and_where(given: dict, words: str) -> None:
    with pytest.raises(TrajectoryError, match=words):
        Plan(CONFIG, REST, **given)
