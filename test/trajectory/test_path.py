"""Curves by their length, and the motion along them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from snake_control.trajectory.path import Along, Circle, FigureEight, Path

START = np.array([0.3, -0.2, 0.19, 0.4, 0.3, 0.5])
PATHS = {
    "left circle": Circle(START, 0.4),
    "right arc": Circle(START, -0.25, 0.3),
    "eight": FigureEight(START, 0.4),
    "other eight": FigureEight(START, -0.3, 0.5),
}


@pytest.fixture(params=PATHS.values(), ids=PATHS.keys())
def path(request) -> Path:
    return request.param


def test_it_starts_at_the_pose_and_leaves_it_along_its_yaw(path: Path) -> None:
    point = path.at(0.0)
    np.testing.assert_allclose(point.w, START, atol=1e-12)
    np.testing.assert_allclose(point.by_s[:2], [math.cos(0.5), math.sin(0.5)], atol=1e-12)


def test_s_is_the_length_and_the_head_looks_ahead(path: Path) -> None:
    for s in np.linspace(0.0, path.length, 17):
        point = path.at(float(s))
        assert np.linalg.norm(point.by_s[:3]) == pytest.approx(1.0)
        assert math.atan2(point.by_s[1], point.by_s[0]) == pytest.approx(
            math.remainder(point.w[5], math.tau), abs=1e-9
        )
        np.testing.assert_array_equal(point.w[2:5], START[2:5])


def test_derivatives_are_those_of_the_curve(path: Path) -> None:
    h = 1e-4
    for s in np.linspace(2 * h, path.length - 2 * h, 9):
        before, at, after = (path.at(float(s + k * h)) for k in (-1, 0, 1))
        np.testing.assert_allclose((after.w - before.w) / (2 * h), at.by_s, atol=1e-5)
        np.testing.assert_allclose((after.by_s - before.by_s) / (2 * h), at.by_s2, atol=1e-4)


def test_a_circle_and_an_eight_come_back() -> None:
    for whole in (Circle(START, 0.4), FigureEight(START, 0.4)):
        end = whole.at(whole.length).w
        np.testing.assert_allclose(end[:2], START[:2], atol=1e-9)
    half = FigureEight(START, 0.4)
    np.testing.assert_allclose(half.at(half.length / 2).w[:2], START[:2], atol=1e-9)


def test_no_curve_of_an_eight_is_sharper_than_its_radius() -> None:
    eight = FigureEight(START, 0.4)
    turns = [abs(eight.at(s).by_s[5]) for s in np.linspace(0.0, eight.length, 401)]
    assert max(turns) == pytest.approx(1.0 / 0.4, rel=1e-4)


@pytest.mark.parametrize(("speed", "acceleration"), [(0.02, 0.02), (0.05, 0.01), (5.0, 0.1)])
def test_motion_along_a_path_is_smooth_and_ends_at_rest(
    path: Path, speed: float, acceleration: float
) -> None:
    motion = Along(path, speed, acceleration, start=2.0)
    t = np.linspace(2.0, 2.0 + motion.duration, 2001)
    seen = [motion.sample(float(x)) for x in t]
    np.testing.assert_allclose(seen[0].w_d, START, atol=1e-12)
    np.testing.assert_allclose(seen[-1].w_d, path.at(path.length).w, atol=1e-9)
    assert not seen[0].w_d_dot.any()
    assert not seen[-1].w_d_dot.any()
    speeds = [float(np.linalg.norm(s.w_d_dot[:3])) for s in seen]
    assert max(speeds) <= speed * (1 + 1e-9)
    dt = float(t[1] - t[0])
    assert np.abs(np.diff(speeds)).max() <= acceleration * dt * (1 + 1e-6)
    w = np.array([s.w_d for s in seen])
    rates = np.array([s.w_d_dot for s in seen])
    np.testing.assert_allclose(np.diff(w, axis=0) / dt, (rates[1:] + rates[:-1]) / 2, atol=2e-4)
    changes = np.array([s.w_d_ddot for s in seen])
    np.testing.assert_allclose(
        np.diff(rates, axis=0)[1:-1] / dt, (changes[1:] + changes[:-1])[1:-1] / 2, atol=2e-3
    )
    np.testing.assert_array_equal(motion.sample(0.0).w_d, START)
    assert not motion.sample(1e3).w_d_dot.any()
