"""All five nodes together on a mock robot: it moves when told, and only then."""

import numpy as np
from snake_interfaces.msg import BusState
from std_srvs.srv import Trigger

from snake_control.nodes import topics
from snake_control.nodes.conversions import reference_from, stamp_ns
from support.whole_graph import WholeGraph

MS = 1_000_000
AT_REST_RAD_S = 0.05


def speed(state):
    return float(np.abs(state.phi_dot).max())


def check_the_way_from_pose_to_bus(robot):
    """What the nodes say of waiting and of the command that a cycle follows fits together."""
    commands = {stamp_ns(command) for command in robot.commands.messages}
    cycles = [state for state in robot.bus.messages if state.state == BusState.STATE_MOVING]
    # The newest command may not have been heard here yet.
    for cycle in cycles[-100:-5]:
        computed, sent = time_ns(cycle.command_stamp), time_ns(cycle.goals_sent)
        assert computed in commands
        assert cycle.command_waited * 1e9 <= sent - computed < 150 * MS
    for step in robot.states.messages[-100:]:
        assert 0.0 <= step.head_waited < step.head_age
    holding = [state for state in robot.bus.messages if state.state == BusState.STATE_HOLDING]
    assert all(time_ns(state.goals_sent) == 0 for state in holding)


def time_ns(time):
    return time.sec * 1_000_000_000 + time.nanosec


def test_tracks_table_1_and_a_killed_controller_stops_the_joints(tmp_path):
    with WholeGraph(tmp_path) as robot:
        start = robot.w
        posture = np.array(robot.truth.last.phi)
        # Nobody has asked for a motion: none of the commands so far was one.
        assert robot.commands.messages
        assert not any(np.any(command.velocity) for command in robot.commands.messages)

        response = robot.graph.call("trajectory_generator", topics.START, Trigger.Request())
        assert response.success, response.message
        w_d = np.array([0, 0, 0.2, np.pi / 8, np.pi / 8, 0])
        # Height is regulated with 0.5 1/s, pitch with 0.1 1/s.
        robot.wait_truth(
            lambda state: abs(state.w[2] - w_d[2]) < 0.3 * abs(start[2] - w_d[2]),
            30.0,
            "the head near its wanted height",
        )
        assert abs(robot.w[4] - w_d[4]) < 0.95 * abs(start[4] - w_d[4])
        assert np.abs(np.array(robot.truth.last.phi) - posture).max() > 0.1
        assert not robot.truth.last.fallen
        robot.graph.wait_for(
            lambda: (
                speed(robot.truth.last) > AT_REST_RAD_S
                and all(np.any(command.velocity) for command in robot.commands.messages[-5:])
            ),
            20.0,
            "commanded motion",
        )
        check_the_way_from_pose_to_bus(robot)
        robot.processes["scp_controller"].kill()
        robot.processes["scp_controller"].wait()
        killed = robot.graph.now_ns()
        robot.graph.wait_for(
            lambda: robot.truth_after(killed + 1000 * MS), 20.0, "a second of ground truth"
        )
        last_command = stamp_ns(robot.commands.last)
        assert np.any(robot.commands.last.velocity)
        states = robot.truth_after(last_command)
        moving = [state for state in states if speed(state) > AT_REST_RAD_S]
        stopped_after_s = (stamp_ns(moving[-1]) - last_command) * 1e-9 if moving else 0.0
        assert stopped_after_s < 0.3


def test_cmd_vel_moves_the_head_and_its_end_stops_it(tmp_path):
    with WholeGraph(tmp_path) as robot:
        start = robot.w
        robot.drive((0.04, 0.0, 0.0))
        robot.wait_truth(lambda state: state.w[0] - start[0] > 0.03, 30.0, "the head 30 mm ahead")
        robot.drive(None)
        last_sent = robot.graph.now_ns()
        robot.graph.wait_for(
            lambda: robot.graph.now_ns() - stamp_ns(robot.references.last) > 1000 * MS,
            30.0,
            "the end of the references",
        )
        # Dead-man 0.5 s, braking 0.4 s, and until the reference counts as stale 0.2 s.
        end = reference_from(robot.references.last, "world")
        assert stamp_ns(robot.references.last) - last_sent < 2000 * MS
        np.testing.assert_array_equal(end.w_d_dot, np.zeros(6))
        robot.wait_truth(lambda state: speed(state) < AT_REST_RAD_S, 10.0, "the joints at rest")
        at_rest = robot.w
        now = stamp_ns(robot.truth.last)
        robot.graph.wait_for(lambda: robot.truth_after(now + 500 * MS), 20.0, "half a second more")
        np.testing.assert_allclose(robot.w, at_rest, atol=2e-3)
        # It went straight ahead, and no further than the reference.
        assert start[0] + 0.03 < robot.w[0] < end.w_d[0] + 0.01
        np.testing.assert_allclose(robot.w[1:3], start[1:3], atol=0.01)
        assert not robot.truth.last.fallen
