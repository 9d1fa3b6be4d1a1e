"""Cases 1 to 3 on a plant that follows exactly: what the independent implementation shows."""

from __future__ import annotations

import dataclasses
import functools
import json

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.experiment.lockstep import LockstepSample, lockstep
from snake_control.model.singular_shape import SINGULAR_ABOVE, ShapeKind
from snake_control.plant.kinematic import KinematicPlant
from support.robots import PAPER, REFERENCE

UNLIMITED = dataclasses.replace(PAPER, joint_limits_rad=(60.0,), joint_speed_limits_rad_s=(99.0,))


def table_1(t: float) -> Reference:
    w_d = np.array([0.01 * t, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0])
    return Reference(w_d, np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]))


@functools.cache
def run(case: int) -> list[LockstepSample]:
    dt = 0.005 if case == 2 else 0.01
    plant = KinematicPlant(UNLIMITED)
    state = plant.reset(UNLIMITED.start_joint_angles_rad)
    controller = ScpController(UNLIMITED, ControllerConfig(case=case))
    return list(lockstep(plant, state, controller, table_1, 60.0, dt))


def late(case: int) -> list[LockstepSample]:
    return [sample for sample in run(case) if sample.t >= 25.0]


def peak_to_peak(case: int, joint: int) -> float:
    return float(np.ptp([sample.state.phi[joint - 1] for sample in late(case)]))


def test_head_series_of_case_2():
    for expected in json.loads((REFERENCE / "head_series_case2.json").read_text()):
        sample = run(2)[round(expected["t"] / 0.005)]
        np.testing.assert_allclose(sample.state.phi[:5], expected["phi_head"], atol=1e-3)
        assert sample.result.V_h == pytest.approx(expected["V_h"], rel=1e-3)


@pytest.mark.parametrize("case", [1, 2, 3])
def test_wheels_do_not_slip_and_error_decays(case):
    K = np.array(ControllerConfig().K)
    first = run(case)[0].result.error
    for sample in run(case)[:: len(run(case)) // 20]:
        np.testing.assert_allclose(sample.result.error, first * np.exp(-K * sample.t), atol=2e-3)
    # What is left comes from holding velocities over a step.
    assert max(np.abs(sample.state.slip).max() for sample in run(case)) < 5e-3


def test_case_1_turns_singular():
    start = run(1)[0].result.V_b1
    assert np.median([s.result.V_b1 for s in late(1)]) < 0.01 * start
    assert max(abs(s.state.phi[10]) for s in run(1)) > 6.0
    np.testing.assert_array_equal(run(1)[-1].result.phi_tilde_dot_d, 0.0)


def test_the_nearness_of_a_singular_shape_tells_the_cases_apart():
    nearness = {c: np.array([s.result.singular_shape.nearness for s in run(c)]) for c in (1, 2, 3)}
    assert nearness[1].max() > 0.99
    assert run(1)[-1].result.singular_shape.kind is ShapeKind.PARALLEL
    # The paper's robot turned singular by 24.8 s.
    assert run(1)[np.argmax(nearness[1] > SINGULAR_ABOVE)].t == pytest.approx(24.8, abs=2.0)
    for case in (2, 3):
        assert nearness[case].max() < 0.92
        assert max(s.result.singular_shape.nearness for s in late(case)) < 0.8


def test_cases_2_and_3_stay_away_from_singularity():
    for case in (2, 3):
        assert min(s.result.V_b1 for s in late(case)) > 2e7
        assert np.median([s.result.V_b1 for s in late(case)]) > 3e8


def test_case_2_waves_grow_towards_the_tail():
    assert peak_to_peak(2, 7) == pytest.approx(1.40, abs=0.15)
    assert peak_to_peak(2, 7) < peak_to_peak(2, 9) < peak_to_peak(2, 11)


def test_case_3_stands_more_safely_than_case_2():
    margin = {c: [s.state.d_min for s in late(c)] for c in (2, 3)}
    assert np.median(margin[3]) > np.median(margin[2]) + 0.002
    assert np.percentile(margin[3], 10) > np.percentile(margin[2], 10) + 0.002
    assert not run(3)[-1].state.fallen
    assert not run(2)[-1].state.fallen
