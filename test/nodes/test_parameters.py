"""Parameters of a running node, and how a node refuses to start with wrong ones."""

import os

import pytest
from snake_interfaces.msg import ControllerState

from snake_control.nodes import topics
from support.graph import CONFIG, Graph

PAPER_ROBOT = CONFIG / "paper_robot.yaml"
NODE = "scp_controller"


@pytest.fixture(scope="module")
def running():
    with Graph() as graph:
        states = graph.subscribe(topics.CONTROLLER_STATE)
        # One file with a /** section for every node: servos.* are none of the controller's.
        graph.start(NODE, params_files=[PAPER_ROBOT, CONFIG / "case_2.yaml"])
        graph.wait_for(lambda: states.last, 30.0, "the controller")
        graph.states = states
        yield graph


def case(graph):
    return graph.states.last.experiment_case


def test_a_later_file_wins_and_sets_the_weights(running):
    assert case(running) == 2
    assert running.get_parameter(NODE, "controller.case") == 2
    assert running.get_parameter(NODE, "controller.b_prime") == 0.0


def test_the_command_line_counts_from_left_to_right(tmp_path):
    """rcl would let the file's section for the node win over -p, and over a later /** section."""
    own = tmp_path / "own.yaml"
    own.write_text("/**/pose_input: {ros__parameters: {cutoff_hz: 5.0, timeout_s: 0.2}}\n")
    later = tmp_path / "later.yaml"
    later.write_text("/**: {ros__parameters: {timeout_s: 0.3}}\n")
    with Graph() as graph:
        graph.start("pose_input", params_files=[own, later], params={"cutoff_hz": 7.0})
        assert graph.get_parameter("pose_input", "cutoff_hz") == 7.0
        assert graph.get_parameter("pose_input", "timeout_s") == 0.3


def test_a_change_while_running_is_taken_and_the_weights_follow(running):
    result = running.set_parameters(NODE, controller__case=1)["controller__case"]
    assert result.successful, result.reason
    running.wait_for(lambda: case(running) == 1, 10.0, "case 1")
    assert running.get_parameter(NODE, "controller.a_h") == 0.0
    assert running.set_parameters(NODE, controller__case=3)["controller__case"].successful
    running.wait_for(lambda: case(running) == 3, 10.0, "case 3")
    assert running.get_parameter(NODE, "controller.a_h") == 1e5
    assert running.get_parameter(NODE, "controller.b_prime") == 3.0


def test_a_change_is_seen_in_the_state_and_a_refusal_is_not(running):
    before = running.states.last
    gains = [*before.k[:5], 0.3]
    assert running.set_parameters(NODE, controller__K=gains)["controller__K"].successful
    running.wait_for(lambda: list(running.states.last.k) == gains, 10.0, "the new gains")
    assert running.states.last.parameter_changes == before.parameter_changes + 1
    refused = running.set_parameters(NODE, controller__K=[-1.0] * 6)["controller__K"]
    assert not refused.successful
    assert "controller.K" in refused.reason
    kept = running.set_parameters(NODE, controller__K=list(before.k))["controller__K"]
    assert kept.successful
    running.wait_for(lambda: list(running.states.last.k) == list(before.k), 10.0, "the old gains")
    assert running.states.last.parameter_changes == before.parameter_changes + 2


def test_a_weight_given_explicitly_survives_a_change_of_case(running):
    running.set_parameters(NODE, controller__case=3)
    # The very value that the case had set: explicit from now on.
    assert running.set_parameters(NODE, controller__a_b=1.0)["controller__a_b"].successful
    assert running.set_parameters(NODE, controller__case=1)["controller__case"].successful
    assert running.get_parameter(NODE, "controller.a_b") == 1.0
    assert running.get_parameter(NODE, "controller.a_h") == 0.0


def test_sub_tasks_change_while_running_and_their_weights_follow(tmp_path, monkeypatch):
    module = tmp_path / "my_sub_tasks.py"
    module.write_text(
        "from snake_control.control.sub_tasks import SubTask\n"
        "class Lazy(SubTask):\n"
        "    def value(self, posture): return 0.0\n"
        "    def gradient(self, posture): return 0.0 * posture.g.q\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    obstacles = tmp_path / "obstacles.yaml"
    obstacles.write_text("- {x_m: 1.0, y_m: 1.0, radius_m: 0.1}\n")
    with Graph() as graph:
        graph.start(NODE, params_files=[PAPER_ROBOT])

        def now(name):
            return list(graph.get_parameter(NODE, f"controller.{name}"))

        def change(**values):
            (result,) = graph.set_parameters(NODE, **values).values()
            return result

        assert now("base_sub_tasks") == ["singularity", "fall"]
        assert now("base_weights") == [1e-11, 3.0]
        assert change(controller__preset="scale_free").successful
        assert now("base_sub_tasks") == ["wheel_axes", "relative_fall", "joint_range"]
        assert change(controller__base_sub_tasks=["fall", "my_sub_tasks:Lazy"]).successful
        assert now("base_weights") == [3.0, 1.0]
        assert graph.get_parameter(NODE, "controller.b_prime") == 3.0
        for values, reason in (
            ({"controller__base_sub_tasks": ["fal"]}, "allowed: singularity"),
            ({"controller__base_sub_tasks": ["my_sub_tasks:Busy"]}, "no class Busy"),
            ({"controller__base_sub_tasks": ["obstacles"]}, "obstacles_file"),
            ({"controller__obstacles_file": "/nowhere.yaml"}, "cannot be read"),
            ({"controller__base_weights": [1.0, 2.0, 3.0]}, "one weight for each"),
            ({"controller__a_prime": 1.0}, "not among the base sub-tasks"),
        ):
            result = change(**values)
            assert not result.successful
            assert reason in result.reason
        assert now("base_sub_tasks") == ["fall", "my_sub_tasks:Lazy"]
        both = {"controller__base_sub_tasks": ["fall"], "controller__base_weights": [5.0]}
        assert graph.set_parameters_atomically(NODE, **both).successful
        assert (now("base_sub_tasks"), now("base_weights")) == (["fall"], [5.0])
        both = {"controller__base_sub_tasks": ["wheel_axes", "fal"], "controller__a_b": 2.0}
        assert not graph.set_parameters_atomically(NODE, **both).successful
        assert graph.get_parameter(NODE, "controller.a_b") == 1.0
        # Weights were given now: they no longer follow another list.
        assert not change(controller__base_sub_tasks=["fall", "joint_range"]).successful
        both = {"controller__base_sub_tasks": ["fall", "joint_range"]}
        both["controller__base_weights"] = [4.0, 0.2]
        assert graph.set_parameters_atomically(NODE, **both).successful
        assert graph.get_parameter(NODE, "controller.b_prime") == 4.0
        none = {"controller__base_sub_tasks": ["none"], "controller__base_weights": [0.0]}
        assert graph.set_parameters_atomically(NODE, **none).successful
        assert (now("base_sub_tasks"), now("base_weights")) == (["none"], [0.0])
        assert change(controller__obstacles_file=str(obstacles)).successful
        near = {"controller__base_sub_tasks": ["obstacles"], "controller__base_weights": [0.1]}
        assert graph.set_parameters_atomically(NODE, **near).successful


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("controller__case", 4, "1, 2, 3"),
        ("controller__case", "two", "type"),
        ("controller__K", [0.4, 0.4], "6 gains"),
        ("controller__K", [0.4, 0.4, 0.4, 0.1, 0.1, float("nan")], "finite"),
        ("controller__a_h", -1.0, "0"),
        ("robot__links", 14, "read-only"),
        ("rate_hz", 100.0, "read-only"),
        ("servos__ids", [1], "undeclared"),
        ("controller__gain", 1.0, "undeclared"),
    ],
)
def test_a_wrong_change_is_refused_with_a_reason_and_changes_nothing(running, name, value, reason):
    before = running.get_parameter(NODE, "controller.K")
    result = running.set_parameters(NODE, **{name: value})[name]
    assert not result.successful
    assert reason in result.reason
    assert running.get_parameter(NODE, "controller.K") == before
    count = len(running.states.messages)
    running.wait_for(lambda: len(running.states.messages) > count + 5, 10.0, "further steps")


def test_an_integer_does_for_a_decimal(running):
    assert running.set_parameters(NODE, controller__a_h=2)["controller__a_h"].successful
    assert running.get_parameter(NODE, "controller.a_h") == 2
    assert running.states.last.status == ControllerState.STATUS_WAITING


# Kind of node, content of a file given last, what the one line says.
BROKEN = [
    ("pose_input", "/**:\n  ros__parameters:\n    cutof_hz: 3.0\n", "cutoff_hz"),
    ("pose_input", "/**:\n  ros__parameters:\n    cutoff_hz: 0.0\n", "0.1 to 100"),
    ("pose_input", "/**:\n  ros__parameters:\n    frame_id: 7\n", "give a text"),
    ("scp_controller", "/**:\n  ros__parameters:\n    controller: {case: 7}\n", "controller.case"),
    (
        "scp_controller",
        "/**:\n  ros__parameters:\n    controller: {K: [0.4, 0.25, 0, 1.0, 1.0, 1.0]}\n",
        "mixed lists",
    ),
    ("scp_controller", "/**:\n  ros__parameters:\n    robot: {head_links: 3}\n", "Condition 5"),
    (
        "scp_controller",
        "/**:\n  ros__parameters:\n    controller: {base_sub_tasks: ['nowhere:Task']}\n",
        "controller.base_sub_tasks[0] = 'nowhere:Task': cannot import nowhere",
    ),
    (
        "scp_controller",
        "/**:\n  ros__parameters:\n    robot: {wheelless_links: []}\n",
        "empty list",
    ),
    (
        "trajectory_generator",
        "/**/trajectory_generator:\n  ros__parameters:\n    start_pose: [0.0, 1.0]\n",
        "start_pose",
    ),
    (
        "trajectory_generator",
        "/**/trajectory_generator:\n  ros__parameters:\n    trajectory: circle\n",
        "line, hold",
    ),
    ("trajectory_generator", "/**:\n  ros__parameters: [1, 2\n", "not valid YAML"),
    ("pose_input", "pose_input: 3\n", "ros__parameters"),
    ("pose_input", "/pose_inputs:\n  ros__parameters: {cutoff_hz: 3.0}\n", "pose_input?"),
]


@pytest.mark.parametrize(("kind", "text", "says"), BROKEN)
def test_a_broken_file_gives_one_clear_line_and_exit_code_2(tmp_path, kind, text, says):
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with Graph() as graph:
        process = graph.start(kind, params_files=[PAPER_ROBOT, path])
        assert process.wait(30.0) == 2
        output = process.output()
    assert output.startswith("configuration error: ")
    assert says in output
    assert "Traceback" not in output
    # A YAML error shows the place on lines of its own.
    assert len(output.splitlines()) == 1 or "not valid YAML" in output


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("cutof_hz:=3.0", "cutoff_hz"),
        ("cutoff_hz:=0.0", "0.1 to 100"),
        ("cutoff_hz:=fast", "give a number"),
        ("frame_id:=[1, 2.0]", "configuration error"),
    ],
)
def test_a_wrong_value_on_the_command_line_gives_one_too(override, says):
    with Graph() as graph:
        process = graph.start("pose_input", arguments=["-p", override])
        assert process.wait(30.0) == 2
        output = process.output()
    assert "configuration error: " in output
    assert says in output
    assert "Traceback" not in output


def test_a_missing_file_is_named():
    with Graph() as graph:
        process = graph.start("pose_input", params_files=["/nowhere/robot.yaml"])
        assert process.wait(30.0) == 2
        assert "/nowhere/robot.yaml: cannot be read" in process.output()


def test_sections_of_other_packages_and_of_a_renamed_node(tmp_path):
    path = tmp_path / "more.yaml"
    path.write_text(
        "/joy_node:\n  ros__parameters: {deadzone: 0.1}\n"
        "/robot_7/pose_input:\n  ros__parameters: {cutoff_hz: 5.0}\n"
        "/pose_input:\n  ros__parameters: {cutoff_hz: 7.0}\n"
    )
    with Graph() as graph:
        graph.start(
            "pose_input", params_files=[PAPER_ROBOT, path], arguments=["-r", "__ns:=/robot_7"]
        )
        assert graph.get_parameter("robot_7/pose_input", "cutoff_hz") == 5.0


@pytest.mark.parametrize("signal_name", ["interrupt", "terminate"])
@pytest.mark.parametrize("kind", ["pose_input", "trajectory_generator", "scp_controller"])
def test_signals_end_a_node_in_order(kind, signal_name):
    with Graph() as graph:
        process = graph.start(kind, params_files=[PAPER_ROBOT])
        graph.wait_for(lambda: kind in graph.node.get_node_names(), 30.0, f"{kind} in the graph")
        getattr(process, signal_name)()
        assert process.wait() == 0
        assert "Traceback" not in process.output()
