"""The demo as a newcomer runs it: real nodes, real DDS, real servo bytes; shorter."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from snake_control.cli.demo_outcome import Outcome, outcome_at
from snake_control.config import RobotConfig
from snake_control.experiment.series import Series
from support.process import Process
from support.waiting import wait_for

ROOT = Path(__file__).parents[2]
NODES = {"mock_bus", "bus_driver", "pose_input", "scp_controller", "trajectory_generator"}
FIGURES = {
    "fig10_head_pose.png",
    "fig11_joint_velocities.png",
    "fig12_theta_bar.png",
    "fig13_scps_and_V_h.png",
    "fig14_V_b1_and_d_min.png",
    "fig15_motion.png",
}


class Demo:
    """The demo's process, its results and its children."""

    def __init__(self, directory: Path, *arguments: str) -> None:
        self.out = directory / "out"
        environment = {k: v for k, v in os.environ.items() if k != "ROS_DOMAIN_ID"}
        self.process = Process(
            "demo",
            [sys.executable, "-m", "snake_control.cli.demo", "--out", str(self.out), *arguments],
            log=directory / "demo.txt",
            cwd=ROOT,
            environment=environment | {"PYTHONUNBUFFERED": "1"},
        )

    @property
    def summary(self) -> dict:
        return json.loads((self.out / "summary.json").read_text())

    def rows(self) -> int:
        path = self.out / "series.csv"
        return len(path.read_text().splitlines()) - 1 if path.exists() else 0

    def wait_for_rows(self, count: int) -> None:
        def arrived() -> bool:
            assert self.process.running, self.process.report()
            return self.rows() >= count

        wait_for(arrived, 60.0, f"{count} recorded steps")

    def node_pids(self) -> dict[str, int]:
        """Process ids of the running nodes by kind."""
        found = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and _parent(entry) == self.process.pid:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                modules = [w.decode() for w in words if w.startswith(b"snake_control.nodes.")]
                if modules:
                    found[modules[0].rpartition(".")[2]] = int(entry.name)
        return found


def _parent(entry: Path) -> int | None:
    try:
        stat = (entry / "stat").read_text()
    except OSError:
        return None
    return int(stat.rpartition(")")[2].split()[1])


def _ended(pid: int) -> bool:
    try:
        # A zombie has ended too; whether somebody collects it is not ours.
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.fixture
def start(tmp_path) -> Iterator:
    started: list[Demo] = []

    def run(*arguments: str) -> Demo:
        demo = Demo(tmp_path, *arguments)
        started.append(demo)
        return demo

    yield run
    for demo in started:
        demo.process.kill()


def test_demo_follows_the_reference_and_leaves_all_results(start):
    demo = start("--duration", "5", "--seed", "3")
    assert demo.process.wait(90.0) == 0, demo.process.report()

    summary = demo.summary
    assert (summary["case"], summary["ended"], summary["fell"]) == (3, "duration reached", False)
    assert summary["duration_s"] == pytest.approx(5.0, abs=0.2)
    assert summary["parameters"]["seed"] == 3
    assert summary["stop_findings"] == []
    assert summary["bus"]["servos_lost"] == 0
    assert summary["bus"]["corrupt_replies"] == 0
    assert summary["bus"]["unheard_cycles"] < 0.1 * summary["bus"]["cycles"]
    assert summary["tracking_error_source"] == "ground truth"
    # The head has come nearer to the reference: it starts 0.1 m too high.
    assert abs(summary["tracking_error_final"]["z_h_m"]) < 0.03
    assert {path.name for path in demo.out.glob("*.png")} == FIGURES
    assert {path.stem for path in (demo.out / "logs").iterdir()} == NODES

    series = Series.read(demo.out / "series.csv", RobotConfig())
    assert len(series) == summary["control"]["steps"]
    assert series.has_ground_truth
    t = series.numbers("t_s")
    assert t[0] == 0.0
    assert (t[1:] > t[:-1]).all()

    printed = demo.process.output()
    assert "tracking error" in printed
    assert str(demo.out / "summary.json") in printed
    assert " / 5 s" in printed  # progress


@pytest.mark.parametrize(
    ("t_s", "fell_at_s", "case", "expected"),
    [
        (9.9, None, 3, None),
        (10.0, None, 3, Outcome("duration reached", 0)),
        (6.9, 5.0, 3, None),
        (7.0, 5.0, 3, Outcome("the robot fell at 5.0 s", 1)),
        (7.0, 5.0, 2, Outcome("the robot fell at 5.0 s", 1)),
        (7.0, 5.0, 1, Outcome("the robot fell at 5.0 s", 0)),
        (10.0, 9.5, 3, Outcome("the robot fell at 9.5 s", 1)),
    ],
)
def test_a_fall_fails_in_all_cases_but_the_first(t_s, fell_at_s, case, expected):
    assert outcome_at(t_s, fell_at_s, duration_s=10.0, case=case) == expected


def test_fall_is_reported_and_is_no_success(start, tmp_path):
    # With a light base the centre of mass lies before the foremost wheels.
    light = tmp_path / "light.yaml"
    masses = [0.1] * 5 + [0.01] * 7
    light.write_text(f"/**:\n  ros__parameters:\n    robot:\n      link_mass_kg: {masses}\n")
    demo = start("--duration", "60", "--params-file", str(light))
    assert demo.process.wait(60.0) == 1, demo.process.report()
    assert demo.summary["fell"] is True
    assert demo.summary["ended"] == f"the robot fell at {demo.summary['fell_at_s']:.1f} s"
    assert demo.summary["duration_s"] < 10.0
    assert demo.summary["ended"] in demo.process.output()


def test_ctrl_c_stops_the_nodes_in_order_and_writes_results(start):
    demo = start("--duration", "60", "--case", "1")
    demo.wait_for_rows(60)
    nodes = demo.node_pids()
    assert set(nodes) == NODES
    demo.process.interrupt()
    assert demo.process.wait(60.0) == 130, demo.process.report()

    assert demo.summary["ended"] == "interrupted by SIGINT"
    assert demo.summary["stop_findings"] == []
    assert demo.summary["control"]["steps"] >= 60
    assert (demo.out / "fig08_head_pose.png").exists()
    assert [kind for kind, pid in nodes.items() if not _ended(pid)] == []


def test_node_that_dies_ends_the_demo_and_is_named(start):
    demo = start("--duration", "60")
    demo.wait_for_rows(30)
    nodes = demo.node_pids()
    os.kill(nodes["pose_input"], signal.SIGKILL)
    assert demo.process.wait(60.0) == 1, demo.process.report()

    printed = demo.process.output()
    assert "node pose_input ended by signal 9" in printed
    assert str(demo.out / "logs" / "pose_input.log") in printed
    assert demo.summary["ended"].startswith("node pose_input ended")
    assert demo.summary["control"]["steps"] >= 30
    assert [kind for kind, pid in nodes.items() if not _ended(pid)] == []


def test_nodes_do_not_outlive_a_demo_that_is_killed(start):
    demo = start("--duration", "60")
    demo.wait_for_rows(10)
    nodes = demo.node_pids()
    demo.process.kill()
    demo.process.wait()
    wait_for(lambda: all(map(_ended, nodes.values())), 20.0, "the end of all nodes")
    assert demo.rows() >= 10


def test_driver_that_finds_no_servo_is_reported_with_its_log(start, tmp_path):
    # The nodes read one file, so the mock's servos are put on another baud rate instead.
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("/**/mock_bus:\n  ros__parameters:\n    baud_rate: 57600\n")
    demo = start("--params-file", str(wrong))
    assert demo.process.wait(60.0) == 1, demo.process.report()
    assert demo.summary["ended"].startswith("node bus_driver ended with exit code 1")
    assert "joint_11 (servo id 11): does not answer" in demo.process.output()


def test_wrong_configuration_is_refused_before_anything_starts(start, tmp_path):
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("/**:\n  ros__parameters:\n    robot:\n      links: 3\n")
    demo = start("--params-file", str(wrong))
    assert demo.process.wait(30.0) == 2
    assert "configuration error: robot.links = 3" in demo.process.output()
    assert not demo.out.exists()
