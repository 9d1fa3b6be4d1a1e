"""The trajectory that a configuration asks for."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.trajectory.configured import configured_trajectory, needs_head

HEAD = np.array([1.0, 2.0, 0.3, 0.1, 0.2, 0.4])


def test_default_is_table_1():
    trajectory = configured_trajectory(TrajectoryGeneratorConfig(), None)
    at = trajectory.sample(7.0)
    np.testing.assert_allclose(at.w_d, [0.07, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0])
    np.testing.assert_array_equal(at.w_d_dot, [0.01, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_line_from_the_head_starts_there_at_its_time():
    config = TrajectoryGeneratorConfig(start_from="head")
    trajectory = configured_trajectory(config, HEAD, start=3.0)
    np.testing.assert_array_equal(trajectory.sample(3.0).w_d, HEAD)
    assert trajectory.sample(4.0).w_d[0] == pytest.approx(1.01)


def test_hold_stays_at_the_head():
    trajectory = configured_trajectory(TrajectoryGeneratorConfig(trajectory="hold"), HEAD)
    np.testing.assert_array_equal(trajectory.sample(9.0).w_d, HEAD)
    np.testing.assert_array_equal(trajectory.sample(9.0).w_d_dot, np.zeros(6))


@pytest.mark.parametrize("how", [{"trajectory": "hold"}, {"start_from": "head"}])
def test_what_begins_at_the_head_needs_it(how):
    config = TrajectoryGeneratorConfig(**how)
    assert needs_head(config)
    with pytest.raises(ValueError, match="head"):
        configured_trajectory(config, None)
