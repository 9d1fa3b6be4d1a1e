"""The thread that owns the bus, without ROS: what it does when things go wrong."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from snake_control.ax12.driven_joint import DrivenJoint
from snake_control.config import load
from snake_control.errors import ServoError
from snake_control.nodes.bus_loop import BusLoop
from snake_control.nodes.bus_requests import NotLoweredError, RefusedError, Requests
from snake_control.nodes.bus_snapshot import Snapshot, State
from support.scripted_servos import PING, SYNC_WRITE, WRITE, ScriptedServos, packet
from support.waiting import wait_for

CONFIG = Path(__file__).resolve().parents[2] / "config" / "paper_robot.yaml"
IDS = range(1, 12)
AHEAD = (0.5,) * 11
TORQUE_ENABLE = 24
INSTRUCTION_ERROR = 64


class Driver:
    """A loop on scripted servos; what it publishes and logs."""

    def __init__(self, servos: ScriptedServos, **changes: Any) -> None:
        config = load(CONFIG)
        modes = changes.pop("velocity_modes", config.servos.velocity_modes)
        config = dataclasses.replace(
            config, servos=dataclasses.replace(config.servos, velocity_modes=modes)
        )
        own = dataclasses.replace(config.bus_driver, port=servos.path, **changes)
        self.servos = servos
        self.last: Snapshot | None = None
        self.on_publish: Callable[[], None] = lambda: None
        self.warnings: list[str] = []
        self.errors: list[str] = []
        self.loop = BusLoop(
            dataclasses.replace(config, bus_driver=own),
            self._publish,
            self.warnings.append,
            self.errors.append,
        )

    def _publish(self, snapshot: Snapshot) -> None:
        self.last = snapshot
        self.on_publish()

    def wait_for_state(self, state: State, text: str = "") -> Snapshot:
        def reached() -> Snapshot | None:
            last = self.last
            return last if last and last.state is state and text in last.text else None

        return wait_for(reached, 10.0, f"{state.name} {text}")

    def drive(self, state: State, text: str = "", velocities: tuple[float, ...] = AHEAD) -> None:
        """Command until a state is reached."""

        def reached() -> bool:
            self.loop.command(velocities, 0.0)
            return self.last is not None and self.last.state is state and text in self.last.text

        wait_for(reached, 10.0, f"{state.name} {text}")

    def move(self) -> None:
        """Command motion as somebody who has just begun to: with a zero before."""
        self.drive(State.MOVING, velocities=(0.0,) * 11)
        self.drive(State.MOVING)

    def torque(self) -> set[int]:
        """Ids of the servos with torque."""
        return {i for i, memory in self.servos.memory.items() if memory[TORQUE_ENABLE]}


@pytest.fixture
def servos() -> Iterator[ScriptedServos]:
    with ScriptedServos(IDS) as servos:
        yield servos


@contextmanager
def driving(servos: ScriptedServos, **changes: Any) -> Iterator[Driver]:
    driver = Driver(servos, **changes)
    driver.loop.open()
    try:
        driver.loop.activate()
        yield driver
    finally:
        driver.loop.close()


def silence(servos: ScriptedServos, servo_id: int) -> None:
    servos.answer = lambda i, answer: b"" if i[2] == servo_id else answer


def test_after_a_failed_recovery_torque_can_be_taken_off(servos: ScriptedServos) -> None:
    with driving(servos) as driver:
        silence(servos, 3)
        with pytest.raises(ServoError, match=r"joint_3 .*does not answer"):
            driver.loop.recover()
        snapshot = driver.wait_for_state(State.STOPPED, "recovery failed")
        assert snapshot.readings, "the other servos are read on"
        assert driver.torque() == set(IDS), "a failed recovery lets nothing fall"
        with pytest.raises(ServoError, match=r"^joint_3 .*torque off is not confirmed$"):
            driver.loop.set_torque(False)
        assert driver.torque() == set()


def test_torque_off_on_exit_does_not_ask_whether_a_recovery_failed(servos: ScriptedServos) -> None:
    def refuse(instruction: bytes, answer: bytes) -> bytes:
        refused = instruction[2] == 3 and instruction[4] == WRITE
        return packet(3, 2, INSTRUCTION_ERROR) if refused else answer

    with driving(servos, torque_off_on_exit=True) as driver:
        servos.answer = refuse
        with pytest.raises(ServoError, match=r"joint_3 .*refused"):
            driver.loop.recover()
        snapshot = driver.wait_for_state(State.STOPPED, "recovery failed")
        assert all(reading.torque_on for reading in snapshot.readings)
        assert driver.torque() == set(IDS)
    assert driver.torque() == set()


def test_recover_works_again_on_the_open_port(servos: ScriptedServos) -> None:
    with driving(servos) as driver:
        silence(servos, 3)
        driver.wait_for_state(State.STOPPED, "joint_3 (servo id 3)")
        with pytest.raises(ServoError):
            driver.loop.recover()
        servos.answer = None
        driver.loop.recover()
        driver.wait_for_state(State.HOLDING)


def test_recover_does_not_undo_an_emergency_stop(servos: ScriptedServos) -> None:
    with driving(servos) as driver:
        driver.loop.emergency_stop()
        with pytest.raises(RefusedError, match="reset_emergency_stop"):
            driver.loop.recover()
        driver.wait_for_state(State.EMERGENCY_STOP)


def test_an_emergency_stop_while_servos_are_checked_keeps_them_without_torque(
    servos: ScriptedServos,
) -> None:
    def stop(instruction: bytes, answer: bytes) -> bytes:
        if instruction[4] == PING:  # only when servos are checked
            driver.loop.emergency_stop()
        return answer

    with driving(servos) as driver:
        for memory in servos.memory.values():
            memory[TORQUE_ENABLE] = 0
        driver.wait_for_state(State.STOPPED, "torque is off")
        servos.answer = stop
        with pytest.raises(RefusedError, match="emergency stop in the meantime"):
            driver.loop.recover()
        assert driver.torque() == set()
        servos.answer = None
        driver.loop.reset_emergency_stop()
        driver.loop.recover()
        driver.wait_for_state(State.HOLDING)


@contextmanager
def lowering(servos: ScriptedServos, goal: float, **changes: Any) -> Iterator[Driver]:
    """An inactive driver that lowers joint 1; scripted servos themselves do not move."""
    changes = {"follow_timeout_s": 60.0} | changes
    pose = {"lower_before_torque_off": True, "lowering_angles_rad": (goal,) + (0.0,) * 10}
    with driving(servos, **pose, **changes) as driver:
        driver.loop.deactivate()
        yield driver


def test_release_returns_when_torque_is_off_after_a_lowering(servos: ScriptedServos) -> None:
    def follow(instruction: bytes, answer: bytes) -> bytes:
        for memory in servos.memory.values():
            goal, here = (int.from_bytes(memory[a : a + 2], "little") for a in (30, 36))
            memory[36:38] = (here + max(-1, min(1, goal - here))).to_bytes(2, "little")
        return answer

    with lowering(servos, 0.3) as driver:
        servos.answer = follow
        assert driver.loop.release() == "torque is off, after a lowering"
        assert driver.torque() == set()
        angle = (int.from_bytes(servos.memory[1][36:38], "little") - 511.5) * 300 / 1023
        assert angle == pytest.approx(17.2, abs=2.5)  # degrees


def test_a_reading_that_is_late_does_not_drop_the_robot(servos: ScriptedServos) -> None:
    # Older than feedback_timeout_s all the time.
    with lowering(servos, 0.5, feedback_timeout_s=0.01, rate_hz=20.0) as driver:
        assert driver.loop.set_torque(False).startswith("lowering")
        driver.wait_for_state(State.LOWERING)
        assert driver.torque() == set(IDS)


def test_release_says_why_torque_stays_on(servos: ScriptedServos) -> None:
    with lowering(servos, 0.5) as driver:
        with pytest.raises(NotLoweredError, match=r"joint_1 .* does not get nearer"):
            driver.loop.release()
        assert driver.torque() == set(IDS)


@pytest.mark.parametrize("end", ["emergency stop", "end of the driver", "loss of the port"])
def test_a_lowering_that_is_ended_leaves_no_goal_ahead(servos: ScriptedServos, end: str) -> None:
    with lowering(servos, 0.5) as driver:
        driver.loop.set_torque(False)
        driver.wait_for_state(State.LOWERING, "is 0.50 rad away")
        ahead = servos.memory[1][30:32]
        if end == "emergency stop":
            driver.loop.emergency_stop()
            driver.wait_for_state(State.INACTIVE, "emergency stop is latched")
        elif end == "end of the driver":
            driver.loop.close()
        else:
            servos.unplug()
            driver.wait_for_state(State.INACTIVE, "stopped working")
            assert any("lowering ended, torque stays on" in text for text in driver.errors)
            return
        assert driver.torque() == set(IDS)
        assert int.from_bytes(ahead, "little") > 512 + 33

        def holds() -> bool:
            last = servos.instructions(SYNC_WRITE)[-5:]
            return all(abs(int.from_bytes(p[8:10], "little") - 512) <= 6 for p in last)

        wait_for(holds, 5.0, "five cycles of hold")


def test_recover_keeps_torque_off_that_was_switched_off(servos: ScriptedServos) -> None:
    with driving(servos) as driver:
        driver.loop.set_torque(False)
        driver.loop.recover()
        driver.wait_for_state(State.TORQUE_OFF)
        assert driver.torque() == set()


def test_torque_that_is_on_already_is_told(servos: ScriptedServos) -> None:
    servos.memory[2][TORQUE_ENABLE] = 1
    with driving(servos, torque_on_activate=False) as driver:
        snapshot = driver.wait_for_state(State.TORQUE_OFF, "still on at joint_2 (servo id 2)")
        assert [reading.torque_on for reading in snapshot.readings].count(True) == 1
        assert driver.warnings == ["torque is on already at joint_2 (servo id 2)"]
        for memory in servos.memory.values():
            memory[TORQUE_ENABLE] = 1
        driver.wait_for_state(State.HOLDING, "no command is taken before ~/set_torque")
        driver.loop.set_torque(False)
        assert driver.torque() == set()


def test_who_was_commanding_already_at_the_start_is_not_obeyed(servos: ScriptedServos) -> None:
    with driving(servos) as driver:
        driver.drive(State.HOLDING, "holding: waiting for a zero command")
        driver.move()


@pytest.mark.parametrize("stop", ["recover", "torque", "emergency stop"])
def test_after_a_stop_motion_waits_for_a_zero_command(servos: ScriptedServos, stop: str) -> None:
    with driving(servos) as driver:
        driver.move()
        if stop == "recover":
            driver.loop.recover()
        elif stop == "torque":
            driver.loop.set_torque(True)
        else:
            driver.loop.emergency_stop()
            driver.loop.reset_emergency_stop()
        driver.drive(State.HOLDING, "holding: waiting for a zero command")
        driver.drive(State.MOVING, velocities=(0.0,) * 11)
        driver.drive(State.MOVING)


def test_a_state_that_cannot_be_published_does_not_stop_the_cycle(servos: ScriptedServos) -> None:
    def fail() -> None:
        raise RuntimeError("no publisher")

    with driving(servos) as driver:
        driver.on_publish = fail
        driver.move()
        driver.loop.check()
        assert driver.errors == ["the state cannot be published: RuntimeError('no publisher')"]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_thread_that_fails_lets_the_joints_hold_and_is_noticed(servos: ScriptedServos) -> None:
    def fail() -> None:
        raise AttributeError("a mistake of the program")

    def ended() -> bool:
        try:
            driver.loop.check()
        except RefusedError:
            return True
        return False

    with driving(servos) as driver:
        driver.move()
        driver.on_publish = fail
        wait_for(ended, 10.0, "the end of the thread")
        with pytest.raises(RefusedError, match="a mistake of the program"):
            driver.loop.check()
        begin = time.monotonic()
        with pytest.raises(RefusedError, match="the bus thread has ended"):
            driver.loop.recover()
        assert time.monotonic() - begin < 5.0
        for servo_id in IDS:
            goal = int.from_bytes(servos.memory[servo_id][30:32], "little")
            assert abs(goal - 512) <= 6, "a goal ahead is no hold"


def test_what_moves_comes_to_rest_before_servos_are_asked_and_armed(
    servos: ScriptedServos,
) -> None:
    with driving(servos) as driver:
        driver.move()
        silence(servos, 3)
        with pytest.raises(ServoError):
            driver.loop.recover()
        first = next(i for i, p in enumerate(servos.packets) if p[4] == PING and i > 400)
        goals = [p for p in servos.packets[:first] if p[4] == SYNC_WRITE and p[5] == 30][-1]
        for at in range(7, len(goals) - 1, 5):
            assert abs(int.from_bytes(goals[at + 1 : at + 3], "little") - 512) <= 6


def test_whoever_keeps_a_state_from_being_published_does_not_keep_the_joints_from_stopping(
    servos: ScriptedServos,
) -> None:
    free = threading.Event()
    with driving(servos) as driver:
        driver.move()
        # A subscriber that is frozen may hold what the middleware shares with it.
        driver.on_publish = lambda: free.wait(20.0) and None
        try:
            sent = len(servos.packets)
            driver.loop.command(AHEAD, 0.0)

            def held() -> bool:
                goals = [p for p in servos.packets[sent:] if p[4] == SYNC_WRITE and p[5] == 30]
                # Fifty cycles later; the command has run out after five.
                if len(goals) < 50:
                    return False
                at = [int.from_bytes(goals[-1][i + 1 : i + 3], "little") for i in range(7, 60, 5)]
                return all(abs(goal - 512) <= 6 for goal in at)

            wait_for(held, 10.0, "the joints' hold")
            driver.loop.emergency_stop()
        finally:
            free.set()
        driver.wait_for_state(State.EMERGENCY_STOP)


def wheel(servos: ScriptedServos, servo_id: int) -> tuple[str, ...]:
    """Make it a servo in wheel mode that somebody has set going; return the modes of all."""
    servos.memory[servo_id][6:10] = bytes(4)
    servos.memory[servo_id][32:34] = (300).to_bytes(2, "little")
    return tuple("wheel" if i == servo_id else "joint" for i in IDS)


def speed_of(servos: ScriptedServos, servo_id: int) -> int:
    return int.from_bytes(servos.memory[servo_id][32:34], "little") & 0x3FF


def test_a_wheel_that_somebody_set_going_is_stopped_also_without_torque_from_here(
    servos: ScriptedServos,
) -> None:
    modes = wheel(servos, 4)
    with driving(servos, velocity_modes=modes, torque_on_activate=False) as driver:
        driver.wait_for_state(State.TORQUE_OFF)
        wait_for(lambda: speed_of(servos, 4) == 0, 10.0, "the wheel's stop")
        driver.loop.emergency_stop()
        driver.wait_for_state(State.EMERGENCY_STOP)
        servos.memory[4][32:34] = (300).to_bytes(2, "little")
        wait_for(lambda: speed_of(servos, 4) == 0, 10.0, "the wheel's stop")
        assert driver.torque() == set()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_thread_that_cannot_write_goals_any_more_still_stops_the_wheels(
    servos: ScriptedServos, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise AttributeError("a mistake of the program")

    modes = wheel(servos, 4)
    with driving(servos, velocity_modes=modes) as driver:
        driver.move()
        wait_for(lambda: speed_of(servos, 4) > 0, 10.0, "a wheel that turns")
        monkeypatch.setattr(DrivenJoint, "step", fail)
        wait_for(lambda: speed_of(servos, 4) == 0, 10.0, "the wheel's stop")
        assert driver.torque() == set(IDS), "nothing is let go"


def test_a_request_that_timed_out_is_not_carried_out_later() -> None:
    requests = Requests()
    done: list[int] = []
    with pytest.raises(RefusedError, match="not carried out"):
        requests.carry_out(lambda: done.append(1), 0.05)
    assert not requests.serve()
    assert done == []


def test_a_lowering_that_gets_nowhere_is_given_up_and_torque_stays_on(
    servos: ScriptedServos,
) -> None:
    # Scripted servos stay where they are; that is to be found by the lowering itself.
    lowering = {"lower_before_torque_off": True, "lowering_angles_rad": (0.5,) + (0.0,) * 10}
    with driving(servos, follow_timeout_s=60.0, **lowering) as driver:
        assert driver.loop.set_torque(False).startswith("lowering")
        driver.wait_for_state(State.LOWERING, "joint_1 (servo id 1) is 0.50 rad away")
        # Who goes on commanding all the time gets nothing of it afterwards either.
        driver.drive(State.HOLDING, "waiting for a zero command; lowering given up, torque stays")
        assert driver.torque() == set(IDS)
        assert driver.errors[-1].startswith("lowering given up")


def test_a_fault_ends_a_lowering_and_torque_stays_on(servos: ScriptedServos) -> None:
    lowering = {"lower_before_torque_off": True, "lowering_angles_rad": (0.5,) + (0.0,) * 10}
    with driving(servos, **lowering) as driver:
        driver.loop.set_torque(False)
        driver.wait_for_state(State.LOWERING)
        servos.error_bits[5] = 32
        driver.wait_for_state(State.STOPPED, "joint_5 (servo id 5) shut down: overload")
        assert driver.torque() == set(IDS)
        # At once then, and it says that nothing was lowered.
        assert "the robot was not lowered: joint_5" in driver.loop.set_torque(False)
        assert driver.torque() == set()


def test_at_the_end_the_robot_is_lowered_too(servos: ScriptedServos) -> None:
    there = {"lower_before_torque_off": True, "lowering_angles_rad": (0.0,) * 11}
    there |= {"follow_timeout_s": 60.0}
    with driving(servos, torque_off_on_exit=True, **there) as driver:
        driver.wait_for_state(State.HOLDING)
    assert driver.torque() == set()
    far = there | {"lowering_angles_rad": (0.5,) + (0.0,) * 10}
    with driving(servos, torque_off_on_exit=True, **far) as driver:
        driver.wait_for_state(State.HOLDING)
    assert driver.torque() == set(IDS), "better held than dropped"
    assert driver.errors[-1].startswith("lowering given up")


def test_a_port_that_is_lost_is_opened_again_with_growing_pauses(servos: ScriptedServos) -> None:
    with driving(servos, reconnect_first_s=0.05, reconnect_longest_s=0.2) as driver:
        driver.wait_for_state(State.HOLDING)
        servos.unplug()
        driver.wait_for_state(State.STOPPED, "no such port")
        tries = [text for text in driver.warnings if "the port is not back yet" in text]
        assert len(tries) == 1, "the same reason is told once"
        driver.loop.emergency_stop()
        driver.wait_for_state(State.EMERGENCY_STOP)
        assert driver.last is not None
        assert driver.last.readings == ()
