"""Model quantities at a state: the reference's numbers, shapes for other robots, bad input."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.errors import ConfigError
from snake_control.experiment.cases import load_case
from snake_control.experiment.evaluation import State, evaluate, read_states
from snake_control.model.structure import structure
from support.robots import PAPER, ROBOTS, paper_states, random_q

STATES = paper_states()
GOOD = {"q": [0.0] * 17, "q_dot": [0.0] * 17, "t": 1.5, "case": 3}
DEFAULTS = load_case((), None)


def configured(robot, case: int = 2):
    gains = ControllerConfig.for_scps(ControllerConfig(case=case), len(robot.scp_joints))
    return dataclasses.replace(DEFAULTS, robot=robot, controller=gains)


@pytest.mark.parametrize("expected", STATES)
@pytest.mark.parametrize("case", [2, 3])
def test_reference_states(expected, case):
    t = expected["u_case2_at_t"]["t"]
    found = evaluate(
        load_case((), case), State(np.array(expected["q"]), np.zeros(17), t=t, case=case)
    )
    F_bar = np.array(expected["F_bar"])
    np.testing.assert_allclose(found["F_bar"], F_bar, rtol=1e-9, atol=1e-9 * np.abs(F_bar).max())
    for name in ("V_h", "V_b1", "d_min"):
        assert found[name] == pytest.approx(expected[name], rel=1e-9)
    np.testing.assert_allclose(found["phi_dot_hd"], expected["phi_dot_hd"], rtol=1e-6)
    np.testing.assert_allclose(found["phi_dot_bd"], expected[f"phi_dot_bd_case{case}"], rtol=1e-6)
    singular_values = np.linalg.svd(found["E_tilde"], compute_uv=False)
    np.testing.assert_allclose(singular_values, expected["E_tilde_singular_values"], rtol=1e-9)
    np.testing.assert_allclose(
        np.linalg.solve(found["B_tilde"], found["A_tilde"]), F_bar, atol=1e-9 * np.abs(F_bar).max()
    )
    if case == 2:
        np.testing.assert_allclose(found["u"], expected["u_case2_at_t"]["u"], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ROBOTS)
def test_keys_and_shapes_follow_the_robot(name):
    robot = ROBOTS[name]
    s = structure(robot)
    found = evaluate(configured(robot), State(random_q(robot, 3), np.zeros(robot.links + 5)))
    w, rows, joints = len(s.w), len(s.wheeled) + 3 * (s.n_h > 0), robot.joints
    shapes = {
        "A_bar": (rows, w),
        "B_bar": (rows, joints),
        "A_tilde": (rows, w + s.m),
        "B_tilde": (rows, joints - s.m),
        "F_bar": (joints - s.m, w + s.m),
        "E_tilde": (w + s.m, joints),
        "V_h": (),
        "V_b1": (),
        "d_min": (),
        "M_tilde": (w + s.m, w + s.m),
        "h_tilde": (w + s.m,),
        "phi_dot_hd": (s.m_h,),
        "phi_dot_bd": (s.m_b,),
        "u": (joints,),
    }
    assert {key: np.shape(found[key]) for key in shapes} == shapes
    text = json.dumps(found, allow_nan=False)
    assert json.loads(text) == found


def test_what_does_not_exist_is_null():
    # A straight neck: the head block has no inverse.
    found = evaluate(configured(PAPER), State(np.zeros(17), np.zeros(17)))
    assert found["V_h"] == pytest.approx(0.0, abs=1e-20)
    assert np.shape(found["B_bar"]) == (7, 11)
    json.dumps(found, allow_nan=False)


def test_a_list_stays_a_list():
    states, is_list = read_states([GOOD, {"q": GOOD["q"]}], PAPER)
    assert is_list
    assert [(state.t, state.case) for state in states] == [(1.5, 3), (0.0, None)]
    np.testing.assert_array_equal(states[1].q_dot, np.zeros(17))
    assert read_states(GOOD, PAPER)[1] is False
    assert read_states([], PAPER) == ([], True)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (3, "state = 3: give an object"),
        ({}, "state.q = None: give the 17 numbers"),
        (GOOD | {"q": [0.0] * 16}, "state.q = '16 entries': give 17"),
        (GOOD | {"q": "17"}, "state.q = '17': give a list of 17 numbers"),
        (GOOD | {"q": [True] + [0.0] * 16}, r"state.q\[0\] = True: give a number"),
        (GOOD | {"q_dot": [0.0] * 16 + [math.inf]}, r"state.q_dot\[16\] = inf: give a finite"),
        (GOOD | {"q": [10**400] + [0.0] * 16}, r"state.q\[0\] = 1.*: give a finite"),
        (GOOD | {"t": "now"}, "state.t = 'now': give a number"),
        (GOOD | {"case": 4}, "state.case = 4: allowed: 1, 2, 3"),
        (GOOD | {"case": True}, "state.case = True: allowed: 1, 2, 3"),
        (GOOD | {"Q": 1}, "state.Q = 1: allowed: q, q_dot, t, case"),
        ([GOOD, 3], r"state\[1\] = 3: give an object"),
    ],
)
def test_bad_states_name_field_value_and_what_is_allowed(document, message):
    with pytest.raises(ConfigError, match=message):
        read_states(document, PAPER)
