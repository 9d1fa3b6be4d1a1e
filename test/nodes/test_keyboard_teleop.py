"""The keyboard teleoperation in a pseudo terminal, on real DDS."""

from __future__ import annotations

import fcntl
import os
import pty
import subprocess
import sys
import termios

import pytest

from snake_control.nodes import topics
from support.graph import ROOT, Graph


@pytest.fixture
def terminal():
    """A node in a terminal of its own: graph, recorder, what is typed, the process."""
    with Graph() as graph:
        commands = graph.subscribe(topics.CMD_VEL)
        master, slave = pty.openpty()
        process = subprocess.Popen(
            [sys.executable, "-m", "snake_control.nodes.keyboard_teleop"],
            stdin=slave,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=ROOT,
            env=graph.environment,
            text=True,
            # Ctrl-C is a matter of the terminal that controls a session.
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(slave)
        try:
            assert process.stdout is not None
            # It explains itself when it is ready.
            while "quit" not in process.stdout.readline():
                assert process.poll() is None
            graph.wait_for(
                lambda: graph.node.get_publishers_info_by_topic("/cmd_vel"), 30.0, "its publisher"
            )
            yield graph, commands, master, process
        finally:
            process.kill()
            process.communicate()
            os.close(master)


def test_keys_become_velocities_and_silence_becomes_rest(terminal):
    graph, commands, master, process = terminal

    def moving():
        os.write(master, b"w")
        last = commands.last
        return last if last and last.twist.linear.x > 0 else None

    last = graph.wait_for(moving, 20.0, "motion ahead")
    assert last.header.frame_id == "link_1"
    assert last.header.stamp.sec > 0
    assert last.twist.linear.x == pytest.approx(0.02)
    graph.wait_for(lambda: commands.last.twist.linear.x == 0.0, 10.0, "rest after the last key")
    os.write(master, b"x")
    assert process.wait(10.0) == 0


def test_nothing_is_sent_before_a_key_and_ctrl_c_ends_it(terminal):
    graph, commands, master, process = terminal
    os.write(master, b"z")
    begin = graph.now_ns()
    graph.wait_for(lambda: graph.now_ns() - begin > 5e8, 10.0, "half a second")
    assert commands.last is None
    os.write(master, b"\x03")
    assert process.wait(10.0) == 0


def test_without_a_terminal_it_says_so():
    with Graph() as graph:
        process = graph.run("snake_control.nodes.keyboard_teleop", [])
        process.let_end()
        assert process.wait(20.0) == 2
        assert "no terminal" in process.output()
