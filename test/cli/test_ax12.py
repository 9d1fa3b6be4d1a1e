"""The bring-up tool against mock servos: their real bytes, the real SDK."""

from __future__ import annotations

import io
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from snake_control.ax12.scan import Found
from snake_control.cli.ax12 import set_id
from snake_control.cli.ax12.__main__ import main
from snake_control.mock.bus import Bus as MockBus
from snake_control.mock.port import PtyPort
from snake_control.mock.server import Server
from snake_control.mock.servo import Servo
from snake_control.mock.simulation import Simulation
from support.graph import CONFIG
from support.mock_process import ROOT, Mock

PAPER = str(CONFIG / "paper_robot.yaml")


@pytest.fixture
def mock(tmp_path: Path) -> Iterator[Callable[..., Mock]]:
    """Start mock servos; the port's path is ``.link``."""
    started = []

    def start(*arguments: str) -> Mock:
        made = Mock(tmp_path / f"bus{len(started)}", *arguments)
        started.append(made)
        return made

    yield start
    for made in started:
        if made.process.poll() is None:
            made.process.kill()
            made.process.communicate()


@pytest.fixture
def ax12(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a sub-command; return exit code, standard output and standard error."""

    def run(*arguments: str) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return run


def test_scan_finds_servos_of_two_rates(mock, ax12):
    link = mock("--ids", "3,7").link
    code, out, _ = ax12("scan", "--port", link, "--ids", "1-10")
    assert code == 0
    assert [line.split()[:2] for line in out.splitlines()[1:]] == [
        ["3", "1000000"],
        ["7", "1000000"],
    ]
    slow = mock("--ids", "5", "--baud", "57600", "--model", "AX-12W", "--wheel").link
    code, out, _ = ax12("scan", "--port", slow, "--ids", "4-6", "--json")
    assert code == 0
    (found,) = json.loads(out)
    assert (found["servo_id"], found["baud_rate"], found["model"]) == (5, 57600, 300)
    assert (found["mode"], found["return_delay_us"], found["legible"]) == ("wheel", 500, True)


def test_scan_suspects_two_servos_with_one_id(mock, ax12):
    link = mock("--ids", "3,3", "--degrees=-40,55").link
    code, out, _ = ax12("scan", "--port", link, "--baud", "1000000", "--ids", "3")
    assert code == 1
    assert "two servos share this id" in out


def test_scan_of_nothing_is_no_success(mock, ax12):
    link = mock("--ids", "9").link
    code, out, _ = ax12("scan", "--port", link, "--baud", "1000000", "--ids", "1-3")
    assert code == 1
    assert "Nothing answers" in out


def test_check_of_a_robot_that_is_ready(mock, ax12):
    link = mock().link
    code, out, _ = ax12("check", "--params-file", PAPER, "--port", link)
    assert code == 0, out
    assert out.splitlines()[-1] == f"11 of 11 servos answer on {link}: ready to drive"
    assert "joint_5: carries 0.38 N m in the start posture" in out
    code, out, _ = ax12("check", "--params-file", PAPER, "--port", link, "--json")
    document = json.loads(out)
    assert (code, document["ok"]) == (0, True)
    assert {finding["level"] for finding in document["findings"]} <= {"warning", "advice"}


def test_check_goes_on_whatever_it_finds(mock, ax12):
    link = mock("--ids", "1-10", "--wheel", "--volt", "8.9").link
    code, out, _ = ax12("check", "--params-file", PAPER, "--port", link)
    assert code == 1
    assert "joint_11 (servo id 11): does not answer" in out
    assert "joint_3 (servo id 3): is in wheel mode but configured as joint" in out
    assert "joint_3 (servo id 3): 8.9 V, wanted are 9.5 to 12.6 V" in out
    assert "not ready to drive" in out


def test_check_at_a_wrong_rate_advises_a_scan(mock, ax12):
    link = mock("--baud", "57600").link
    code, out, _ = ax12("check", "--params-file", PAPER, "--port", link)
    assert code == 1
    assert "none of the servos answers" in out
    assert f"`ax12 scan --port {link}` tries all rates" in out


def test_a_port_that_cannot_be_opened_is_one_line(ax12, tmp_path):
    code, out, err = ax12("check", "--params-file", PAPER, "--port", tmp_path / "none")
    assert (code, out) == (2, "")
    assert "no such port" in err
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("/**:\n  ros__parameters:\n    robot:\n      links: 3\n")
    code, _, err = ax12("check", "--params-file", wrong, "--port", tmp_path / "none")
    assert code == 2
    assert "robot.links = 3" in err


def test_monitor_shows_what_the_servos_report(mock, ax12):
    link = mock("--ids", "1-2", "--degrees=0,45").link
    code, out, _ = ax12("monitor", "--port", link, "--ids", "1-2", "--count", "1", "--json")
    assert code == 0
    one, two = json.loads(out)["servos"]
    assert (one["id"], one["torque"], one["voltage_v"], one["errors"]) == (1, "off", 11.1, [])
    assert two["angle_rad"] == pytest.approx(0.785, abs=0.01)
    code, out, _ = ax12("monitor", "--port", link, "--ids", "1,4", "--count", "2", "--rate", "50")
    assert code == 1, "servo 4 is silent"
    assert "\x1b" not in out
    assert [line.split()[0] for line in out.splitlines() if line] == ["id", "1", "4"] * 2
    assert "silent" in out


def fresh(mock, tmp_path, *arguments):
    """A servo for joint 4 that is set up otherwise, and its robot's parameters."""
    return mock("--ids", "4", "--wheel", *arguments).link


def test_configure_shows_asks_writes_and_is_done_then(mock, ax12, tmp_path):
    link = fresh(mock, tmp_path)
    common = ("configure", "--params-file", PAPER, "--port", link, "--ids", "4")
    code, out, _ = ax12(*common, "--dry-run")
    assert code == 0
    assert "CCW Angle Limit (8)  0    1023" in out
    code, out, err = ax12(*common)
    assert code == 3, "nobody is there to say yes"
    assert "no terminal" in err
    code, out, _ = ax12(*common, "--dry-run", "--json")
    assert [c["register"] for c in json.loads(out)] == ["CCW Angle Limit"], "nothing was written"
    code, out, _ = ax12(*common, "--yes", "--return-delay", "0", "--limit-range")
    assert code == 0
    assert "joint_4 (servo id 4): 3 registers written and read back" in out
    code, out, _ = ax12(*common, "--yes", "--return-delay", "0", "--limit-range")
    assert (code, out.strip()) == (0, "All servos are set up as the parameters need them.")
    (found,) = json.loads(ax12("scan", "--port", link, "--ids", "4", "--json")[1])
    assert (found["mode"], found["return_delay_us"]) == ("joint", 0)


class Terminal(io.StringIO):
    """Standard input of somebody who types."""

    def isatty(self) -> bool:
        return True


def test_configure_brings_servos_to_the_rate_of_the_parameters(mock, ax12):
    link = mock("--ids", "4", "--baud", "57600").link
    common = ("configure", "--params-file", PAPER, "--port", link, "--ids", "4")
    assert ax12(*common, "--yes")[0] == 1, "nothing answers at the rate of the parameters"
    code, out, err = ax12(*common, "--from-baud", "57600", "--yes")
    assert code == 0, err
    assert "Baud Rate (4)" in out
    assert "joint_4 (servo id 4): answers at 1000000 bit/s" in out
    code, out, _ = ax12(*common, "--yes")
    assert (code, out.strip()) == (0, "All servos are set up as the parameters need them.")


def test_configure_takes_no_for_an_answer(mock, ax12, tmp_path, monkeypatch):
    link = fresh(mock, tmp_path)
    common = ("configure", "--params-file", PAPER, "--port", link, "--ids", "4")
    monkeypatch.setattr(sys, "stdin", Terminal("\n"))
    code, _, err = ax12(*common)
    assert code == 3
    assert "nothing was changed" in err
    monkeypatch.setattr(sys, "stdin", Terminal("y\n"))
    assert ax12(*common)[0] == 0


def test_configure_lets_nothing_go_before_all_is_agreed(servo, ax12, monkeypatch):
    one, link = servo
    one.store("ccw_angle_limit", 600)
    one.store("torque_enable", 1)
    common = ("configure", "--params-file", PAPER, "--port", link, "--ids", "4")
    for answers in ("n\n", "y\nn\n"):
        monkeypatch.setattr(sys, "stdin", Terminal(answers))
        code, _, err = ax12(*common)
        assert (code, err.rstrip().endswith("nothing was changed")) == (3, True)
        assert one.registers["torque_enable"] == 1
    monkeypatch.setattr(sys, "stdin", Terminal("y\ny\n"))
    assert ax12(*common)[0] == 0
    assert one.registers["torque_enable"] == 0


def test_set_id_refuses_an_id_that_the_scan_missed(servo, ax12, monkeypatch):
    one, link = servo
    monkeypatch.setattr(set_id, "scan", lambda *_, **__: [Found(9, 1000000, model=12)])
    code, _, err = ax12("set-id", "--port", link, "4", "--yes")
    assert code == 1
    assert "something answers as 4 already" in err or "servo id 9 does not answer" in err
    assert one.registers["id"] == 4


def test_set_id_wants_one_servo_alone(mock, ax12):
    one = mock("--ids", "1").link
    code, _, err = ax12("set-id", "--port", one, "7")
    assert code == 3, "nobody is there to say yes"
    code, out, _ = ax12("set-id", "--port", one, "7", "--yes")
    assert (code, out.strip()) == (0, "Servo 1 is now servo 7.")
    assert ax12("set-id", "--port", one, "7", "--yes")[1].strip() == "The servo has id 7 already."
    two = mock("--ids", "1-2").link
    code, _, err = ax12("set-id", "--port", two, "7", "--yes")
    assert code == 1
    assert "2 servos answer (ids 1, 2)" in err
    twins = mock("--ids", "3,3", "--degrees=-40,55").link
    code, _, err = ax12("set-id", "--port", twins, "7", "--yes")
    assert code == 1
    assert "not legible" in err
    with pytest.raises(SystemExit):
        main(["set-id", "--port", str(one), "254"])


def test_jog_moves_one_joint_and_lets_go(mock, ax12):
    link = mock("--ids", "4", "--degrees", "10").link
    common = ("jog", "--params-file", PAPER, "--port", link)
    assert ax12(*common, "4", "5")[0] == 3, "nobody is there to say yes"
    code, out, err = ax12(*common, "4", "-5", "--yes", "--json")
    assert code == 0, err
    moved = json.loads(out)
    assert moved["to_rad"] - moved["from_rad"] == pytest.approx(-0.087, abs=0.02)
    state = json.loads(ax12("monitor", "--port", link, "--ids", "4", "--count", "1", "--json")[1])
    assert state["servos"][0]["torque"] == "off"
    assert state["servos"][0]["angle_rad"] == pytest.approx(moved["to_rad"], abs=0.01)
    assert ax12(*common, "4", "90", "--yes")[0] == 2, "no long ways"
    assert ax12(*common, "9", "5", "--yes")[0] == 1, "it is not there"
    for wrong in (("300", "5"), ("x", "5"), ("4", "5", "--speed", "3")):
        with pytest.raises(SystemExit) as ended:
            main(["jog", "--port", str(link), *wrong])
        assert ended.value.code == 2


class Hand(io.StringIO):
    """Turns the shaft of a mock servo before each Enter [deg]."""

    def __init__(self, servo: Servo, turns: list[float]) -> None:
        super().__init__("\n" * len(turns))
        self._servo = servo
        self._turns = iter(turns)

    def readline(self, size: int = -1) -> str:
        turn = next(self._turns, None)
        if turn is not None:
            self._servo.motion.angle_rad = math.radians(turn)
        return super().readline(size)


@pytest.fixture
def servo(tmp_path: Path) -> Iterator[tuple[Servo, str]]:
    """Servo 4 on a line that this process serves, and its port."""
    servo = Servo(4)
    with PtyPort(tmp_path / "hand") as port:
        simulation = Simulation([servo], 0.005, time.monotonic())
        server = Server(port, MockBus([servo]), simulation, time.monotonic)
        server.start()
        yield servo, str(port.link)
        server.stop()


def test_the_guide_finds_a_servo_mounted_the_other_way_round(servo, ax12, monkeypatch):
    shaft, link = servo
    common = ("guide", "--params-file", PAPER, "--port", link, "--ids", "4")
    # Straight at 9 degrees; at first turned by too little; then to its positive side and its ends.
    turns = [9.0, 7.0, -20.0, -110.0, 125.0]
    monkeypatch.setattr(sys, "stdin", Hand(shaft, turns))
    code, out, err = ax12(*common)
    assert code == 1
    assert "a yaw joint" in err
    assert "so that the robot bends to the right" in err
    assert err.count("too little to tell") == 1
    assert "joint_4: servos.directions is +1, the joint turns -1" in out
    assert "directions: [1, 1, 1, -1, 1, 1, 1, 1, 1, 1, 1]" in out
    assert "zero_offsets_rad: [0.000, 0.000, 0.000, 0.159," in out
    monkeypatch.setattr(sys, "stdin", Hand(shaft, turns))
    (found,) = json.loads(ax12(*common, "--json")[1]).values()
    assert found["direction"] == -1
    assert found["range_rad"] == pytest.approx([-2.02, 2.08], abs=0.01)


def test_the_guide_moves_nothing_and_asks_before_it_takes_torque(servo, ax12, monkeypatch):
    shaft, link = servo
    shaft.store("torque_enable", 1)
    common = ("guide", "--params-file", PAPER, "--port", link, "--ids", "4")
    monkeypatch.setattr(sys, "stdin", Hand(shaft, []))
    code, _, err = ax12(*common)
    assert code == 3
    assert "a raised head falls" in err
    assert shaft.driven
    code, _, err = ax12(*common, "--yes")
    assert code == 3, "nobody presses Enter"
    assert not shaft.driven


def test_the_tool_explains_itself():
    done = subprocess.run(
        [sys.executable, "-m", "snake_control.cli.ax12", "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=30.0,
    )
    assert done.returncode == 0
    for word in ("scan", "check", "monitor", "configure", "set-id", "jog", "guide", "Exit codes"):
        assert word in done.stdout
