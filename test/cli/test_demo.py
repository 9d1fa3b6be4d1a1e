"""The demo as a newcomer runs it: real nodes, real DDS, real servo bytes; shorter."""

from __future__ import annotations

import json
import os
import signal
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import pytest

from snake_control.cli.demo_outcome import Outcome, RunJudge
from snake_control.config import RobotConfig
from snake_control.experiment.series import Series
from snake_control.nodes.recorder import FOLLOWING
from snake_control.nodes.topics import ALL
from support.graph import Graph
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

    def __init__(self, directory: Path, *arguments: str, domain_id: int | None = None) -> None:
        self.out = directory / "out"
        environment = {k: v for k, v in os.environ.items() if k != "ROS_DOMAIN_ID"}
        if domain_id is not None:
            environment |= {
                "ROS_DOMAIN_ID": str(domain_id),
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            }
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

    def run(*arguments: str, domain_id: int | None = None) -> Demo:
        demo = Demo(tmp_path, *arguments, domain_id=domain_id)
        started.append(demo)
        return demo

    yield run
    for demo in started:
        demo.process.kill()


@pytest.mark.timeout(240)
def test_demo_follows_the_reference_and_leaves_all_results(start):
    demo = start("--duration", "60", "--seed", "3")
    assert demo.process.wait(180.0) == 0, demo.process.report()

    summary = demo.summary
    assert (summary["case"], summary["ended"], summary["fell"]) == (3, "duration reached", False)
    assert summary["duration_s"] == pytest.approx(60.0, abs=0.2)
    assert summary["parameters"]["seed"] == 3
    assert summary["stop_findings"] == []
    assert summary["bus"]["servos_lost"] == 0
    assert summary["bus"]["corrupt_replies"] == 0
    assert summary["bus"]["missed_replies_fraction"] < 1e-3
    assert summary["bus"]["unheard_cycles"] < 0.1 * summary["bus"]["cycles"]
    assert summary["control"]["rate_slowest_10_s_hz"] > 0.95 * 50.0
    growth = {kind: entry["growth_bytes"] for kind, entry in summary["memory"].items()}
    assert set(growth) == NODES
    assert max(growth.values()) < 5e6, growth
    assert set(summary["processor"]) == NODES
    assert all(share > 0.0 for share in summary["processor"].values())
    assert summary["tracking_error_source"] == "ground truth"
    assert abs(summary["tracking_error_final"]["z_h_m"]) < 0.003
    assert summary["max_singular_nearness"] < 0.95
    assert {path.name for path in demo.out.glob("*.png")} == FIGURES
    assert {path.stem for path in (demo.out / "logs").iterdir()} == NODES

    series = Series.read(demo.out / "series.csv", RobotConfig())
    assert len(series) == summary["control"]["steps"]
    assert series.truth_known.all()
    t = series.numbers("t_s")
    assert t[0] == 0.0
    assert (t[1:] > t[:-1]).all()

    printed = demo.process.output()
    assert "tracking error" in printed
    assert str(demo.out / "summary.json") in printed
    assert " / 60 s" in printed  # progress


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
    judge = RunJudge(duration_s=10.0, case=case)
    assert judge.outcome(t_s, t_s, fell_at_s, "tracking", "") == expected


def judged(case, status, until_s, since_s=3.0):
    """How a run of 10 s ends whose controller has that status from ``since_s`` on."""
    judge = RunJudge(duration_s=10.0, case=case)
    for k in range(round(50 * until_s) + 1):
        t = 0.02 * k
        outcome = judge.outcome(100.0 + t, t, None, status if t >= since_s else "tracking", "why")
        if outcome is not None:
            return t, outcome
    return None


@pytest.mark.parametrize("case", [1, 2, 3])
@pytest.mark.parametrize("status", ["stale", "invalid", "fault", "error too large", "disabled"])
def test_a_controller_that_does_not_follow_ends_the_run(case, status):
    words = f"scp_controller did not follow the reference from 3.0 s on: {status}: why"
    if case == 1 and status in ("fault", "error too large"):
        assert judged(case, status, 11.0) == (10.0, Outcome(f"duration reached; {words}", 0))
    else:
        t, outcome = judged(case, status, 11.0)
        assert t == pytest.approx(4.0, abs=0.1)
        assert outcome == Outcome(words, 1)


def test_a_controller_that_does_not_follow_at_the_end_is_no_success():
    t, outcome = judged(3, "fault", 12.0, since_s=9.9)
    assert t == pytest.approx(10.9, abs=0.1)
    assert outcome.exit_code == 1


def test_a_lapse_that_the_end_meets_may_pass():
    judge = RunJudge(duration_s=10.0, case=3)
    assert judge.outcome(9.98, 9.98, None, "stale", "joint_states is 0.11 s old") is None
    assert judge.outcome(10.1, 10.1, None, "stale", "joint_states is 0.12 s old") is None
    assert judge.outcome(10.2, 10.2, None, "tracking", "") == Outcome("duration reached", 0)


def test_a_short_lapse_is_forgiven():
    judge = RunJudge(duration_s=10.0, case=3)
    assert judge.outcome(5.0, 5.0, None, "stale", "head/odometry is 0.11 s old") is None
    assert judge.outcome(5.9, 5.9, None, "limited", "") is None
    assert judge.outcome(6.5, 6.5, None, "stale", "") is None
    assert judge.outcome(10.0, 10.0, None, "tracking", "") == Outcome("duration reached", 0)


def test_a_controller_that_never_follows_says_why():
    judge = RunJudge(duration_s=10.0, case=3)
    assert judge.outcome(0.0, None, None, "waiting", "waiting for head/reference") is None
    assert judge.outcome(0.1, None, None, "invalid", "why") is None
    outcome = judge.outcome(6.0, None, None, "invalid", "why")
    assert outcome == Outcome("scp_controller did not follow the reference: invalid: why", 1)


def test_a_reference_out_of_reach_is_reported(start, tmp_path):
    far = tmp_path / "far.yaml"
    far.write_text(
        "/**/trajectory_generator:\n  ros__parameters:\n"
        "    start_pose: [5.0, 0.0, 0.2, 0.39, 0.39, 0.0]\n"
    )
    demo = start("--duration", "5", "--params-file", str(far))
    assert demo.process.wait(90.0) == 1, demo.process.report()
    assert "error too large" in demo.summary["ended"]
    assert "max_position_error_m" in demo.process.output()


def test_demo_keeps_to_a_namespace_of_its_own(start):
    with Graph() as graph:
        demo = start("--duration", "60", domain_id=graph.domain_id)
        demo.wait_for_rows(10)
        namespace = f"/demo_{demo.process.pid}"

        def nodes():
            found = graph.node.get_node_names_and_namespaces()
            return {(name, where) for name, where in found if name in NODES | {"demo"}}

        expected = {(name, namespace) for name in NODES | {"demo"}}
        graph.wait_for(lambda: nodes() == expected, 20.0, "the nodes in the namespace")
        shared = {"/rosout", "/parameter_events", "/diagnostics"}
        topics = {name for name, _ in graph.node.get_topic_names_and_types()} - shared
        assert topics
        assert [name for name in topics if not name.startswith(f"{namespace}/")] == []
        demo.process.interrupt()
        assert demo.process.wait(60.0) == 130, demo.process.report()


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
    # Where its reader is not installed, this whole test is skipped.
    from support.recordings import read

    demo = start("--duration", "60", "--case", "1", "--record")
    demo.wait_for_rows(60)
    nodes = demo.node_pids()
    assert set(nodes) == NODES | {"description", "record"}
    demo.process.interrupt()
    assert demo.process.wait(60.0) == 130, demo.process.report()

    assert demo.summary["ended"] == "interrupted by SIGINT"
    assert demo.summary["stop_findings"] == []
    assert demo.summary["control"]["steps"] >= 60
    assert (demo.out / "fig08_head_pose.png").exists()
    recording = read(demo.out / "demo.mcap")
    # Under the names that the layouts have.
    name = "/controller_state"
    steps = [entry.decoded for entry in recording if entry.channel.topic == name]
    first = next(i for i, state in enumerate(steps) if state.status in FOLLOWING)
    series = Series.read(demo.out / "series.csv", RobotConfig())
    # The recorder goes on while the nodes are stopped; the table has fewer digits.
    recorded = [state.w[0] for state in steps[first : first + len(series)]]
    in_table = series.numbers("w_measured")[:, 0].tolist()
    assert recorded == pytest.approx(in_table, abs=1e-6, nan_ok=True)
    assert "none lost" in (demo.out / "logs" / "record.log").read_text()
    heard = {entry.channel.topic for entry in recording}
    # What only people, or other motion capture, would send; and the answers to it.
    mute = {"/cmd_vel", "/tf", "/head/path", "/head/trajectory", "/head/trajectory_status"}
    mute |= {f"/mocap/{kind}" for kind in ("transform", "odometry", "pose_with_covariance")}
    assert heard | mute >= {
        topic.name if topic.name[0] == "/" else f"/{topic.name}" for topic in ALL
    }
    description = next(e.decoded for e in recording if e.channel.topic == "/robot_description")
    assert len(ElementTree.fromstring(description.data).findall("link")) == RobotConfig().links
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
