"""F_bar and V_b1 of long robots against the same with 60 digits."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.posture import Posture
from support.robots import PAPER

mp = pytest.importorskip("mpmath").mp
exact = pytest.importorskip("support.exact")


def long_robot(n, wheelless_links):
    return RobotConfig(
        links=n,
        wheelless_links=wheelless_links,
        joint_axes=PAPER.joint_axes[:5] + ("yaw",) * (n - 6),
        start_joint_angles_rad=(
            *PAPER.start_joint_angles_rad,
            *(0.3 * np.sin(0.7 * np.arange(12, n))),
        ),
    )


ROBOTS = {
    "96 links": long_robot(96, (7, 9, 11)),
    "24 links, every second wheelless": long_robot(24, tuple(range(7, 24, 2))),
}


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_against_60_digits(robot):
    phi = np.array(robot.start_joint_angles_rad)
    q = np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi))
    # Not level either.
    q[3:5] += 0.01
    posture = Posture(robot, q)
    with mp.workdps(60):
        exactly = [mp.mpf(value) for value in q]
        F_bar = np.array(exact.F_bar(robot, exactly).tolist(), dtype=float)
        log_V_b1 = exact.log_V_b1(robot, exactly)
        # Relative error of V_b1 is the absolute one of its logarithm.
        assert abs(float(log_V_b1 - posture.log_V_b1)) < 1e-10
        scale = np.abs(F_bar).max(axis=0)
        # 1e-11 with some BLAS kernels, a little more with others.
        assert (np.abs(posture.k.F_bar - F_bar) / scale).max() < 5e-11
        largest = np.abs(posture.log_V_b1_gradient).max()
        h = mp.mpf(10) ** -20
        for component in (3, 4, 7, 10, 11, 16, robot.links + 4):
            there = list(exactly)
            there[component] += h
            rate = (exact.log_V_b1(robot, there) - log_V_b1) / h
            found = posture.log_V_b1_gradient[component]
            assert float(rate) == pytest.approx(found, abs=1e-9 * largest)
