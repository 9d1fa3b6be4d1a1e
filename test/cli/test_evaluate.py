"""The command evaluate: valid JSON on stdout, or one line on stderr."""

from __future__ import annotations

import io
import json

import pytest

from snake_control.cli.evaluate import main
from snake_control.model.posture import Posture
from support.robots import CONFIG, PAPER, paper_states

FILE = str(CONFIG / "paper_robot.yaml")


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    code = main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def strict(text: str):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_a_list_in_is_a_list_out_each_with_its_own_case(tmp_path, capsys):
    states = paper_states()
    path = tmp_path / "q.json"
    path.write_text(
        json.dumps([{"q": states[0]["q"], "case": 2}, {"q": states[0]["q"], "case": 1}])
    )
    code, out, err = run(capsys, "--params-file", FILE, "--state", str(path))
    assert (code, err) == (0, "")
    case_2, case_1 = strict(out)
    assert case_2["u"] == pytest.approx(states[0]["u_case2_at_t"]["u"], rel=1e-6, abs=1e-9)
    assert case_1["phi_dot_bd"] == [0.0, 0.0, 0.0]


def test_one_state_from_standard_input_with_all_its_digits(monkeypatch, capsys):
    q = paper_states()[1]["q"]
    monkeypatch.setattr("sys.stdin", io.StringIO(json.dumps({"q": q})))
    code, out, _ = run(capsys, "--state", "-")
    assert code == 0
    found = strict(out)
    posture = Posture(PAPER, q)
    assert found["F_bar"] == posture.k.F_bar.tolist()
    assert (found["V_h"], found["V_b1"]) == (posture.V_h, posture.V_b1)


@pytest.mark.filterwarnings("error")
def test_what_overflows_is_null_and_nothing_is_said_of_it(tmp_path, capsys):
    path = tmp_path / "q.json"
    path.write_text(json.dumps({"q": paper_states()[0]["q"], "q_dot": [1e200] * 17}))
    code, out, err = run(capsys, "--state", str(path))
    assert (code, err) == (0, "")
    assert set(strict(out)["h_tilde"]) == {None}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"q": [1, 2]}', "state.q = '2 entries': give 17"),
        ("nonsense", "give valid JSON; line 1, column 1"),
        ('{"q": NaN}', "give a list of 17 numbers"),
        (f'{{"q": {[0.0] * 11 + [1e308] * 6}}}', "q[11] = 1e+308, q[12] = 1e+308"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_bad_input_is_one_line_and_code_2(text, message, tmp_path, capsys):
    path = tmp_path / "q.json"
    path.write_text(text)
    code, out, err = run(capsys, "--state", str(path))
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_files_that_are_not_there_or_wrong_are_named(tmp_path, capsys):
    code, _, err = run(capsys, "--state", str(tmp_path / "none.json"))
    assert code == 2
    assert "none.json" in err
    wrong = tmp_path / "robot.yaml"
    wrong.write_text("/**:\n  ros__parameters:\n    robot:\n      links: 3\n")
    code, _, err = run(capsys, "--params-file", str(wrong), "--state", "-")
    assert code == 2
    assert "robot.links = 3" in err
    assert err.count("\n") == 1
