"""A port that vanishes and comes back, with servos that lost everything: what the driver does."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from snake_control.config import load
from snake_control.errors import BusError
from snake_control.nodes.bus_loop import BusLoop
from snake_control.nodes.bus_snapshot import Snapshot, State
from support.scripted_servos import SYNC_WRITE, WRITE, ScriptedServos
from support.waiting import wait_for

CONFIG = Path(__file__).resolve().parents[2] / "config" / "paper_robot.yaml"
IDS = range(1, 12)
QUICK = {"reconnect_first_s": 0.05, "reconnect_longest_s": 0.2}


class Driver:
    """A loop on a link that leads to one set of servos after the other."""

    def __init__(self, link: Path, **changes: Any) -> None:
        config = load(CONFIG)
        own = dataclasses.replace(config.bus_driver, port=str(link), **QUICK | changes)
        self.link = link
        self.snapshots: list[Snapshot] = []
        self.warnings: list[str] = []
        self.loop = BusLoop(
            dataclasses.replace(config, bus_driver=own),
            self.snapshots.append,
            self.warnings.append,
            self.warnings.append,
        )

    def plug(self, servos: ScriptedServos) -> None:
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(servos.path)

    def unplug(self, servos: ScriptedServos) -> None:
        self.link.unlink()
        servos.unplug()

    def wait_for(self, state: State, text: str = "") -> Snapshot:
        def reached() -> Snapshot | None:
            last = self.snapshots[-1] if self.snapshots else None
            return last if last and last.state is state and text in last.text else None

        return wait_for(reached, 15.0, f"{state.name} {text}")


@contextmanager
def driving(tmp_path: Path, servos: ScriptedServos, **changes: Any) -> Iterator[Driver]:
    driver = Driver(tmp_path / "port", **changes)
    driver.plug(servos)
    driver.loop.open()
    try:
        driver.loop.activate()
        driver.wait_for(State.DRY_RUN if changes.get("dry_run") else State.HOLDING)
        yield driver
    finally:
        driver.loop.close()


@pytest.fixture
def before() -> Iterator[ScriptedServos]:
    with ScriptedServos(IDS) as servos:
        yield servos


@pytest.fixture
def after() -> Iterator[ScriptedServos]:
    with ScriptedServos(IDS) as servos:
        yield servos


def test_after_a_replug_feedback_returns_by_itself_and_torque_on_request(
    tmp_path: Path, before: ScriptedServos, after: ScriptedServos
) -> None:
    with driving(tmp_path, before) as driver:
        driver.unplug(before)
        driver.wait_for(State.STOPPED, "no such port")
        driver.plug(after)
        snapshot = driver.wait_for(State.STOPPED, "the port works again; needs ~/recover")
        assert snapshot.reconnections == 1
        assert len(snapshot.readings) == len(IDS)
        assert after.instructions(WRITE) == after.instructions(SYNC_WRITE) == []
        driver.loop.command((0.5,) * 11, 0.0)
        driver.loop.recover()
        snapshot = driver.wait_for(State.HOLDING)
        assert {memory[24] for memory in after.memory.values()} == {1}
        goals = {int.from_bytes(memory[30:32], "little") for memory in after.memory.values()}
        assert goals == {512}, "no jump, and no command from before"


def test_servos_missing_after_a_replug_are_named_and_tried_again(
    tmp_path: Path, before: ScriptedServos, after: ScriptedServos
) -> None:
    with driving(tmp_path, before) as driver:
        after.answer = lambda i, answer: b"" if i[2] in (3, 7) else answer
        driver.unplug(before)
        driver.plug(after)
        driver.wait_for(State.STOPPED, "joint_7 (servo id 7): does not answer")
        seen = len(driver.snapshots)
        wait_for(lambda: len(driver.snapshots) > seen + 50, 10.0, "cycles between two tries")
        told = [text for text in driver.warnings if "joint_3" in text and "not back" in text]
        assert len(told) == 1, "said once, not at every try"
        after.answer = None
        snapshot = driver.wait_for(State.STOPPED, "the port works again")
        assert snapshot.reconnections == 1


def test_a_recovery_without_a_port_fails_with_the_reason_and_the_port_is_tried_on(
    tmp_path: Path, before: ScriptedServos, after: ScriptedServos
) -> None:
    with driving(tmp_path, before) as driver:
        driver.unplug(before)
        driver.wait_for(State.STOPPED)
        with pytest.raises(BusError, match="no such port"):
            driver.loop.recover()
        driver.plug(after)
        driver.wait_for(State.STOPPED, "the port works again")
        driver.loop.recover()
        driver.wait_for(State.HOLDING)


def test_an_emergency_stop_outlives_the_loss_of_the_port(
    tmp_path: Path, before: ScriptedServos, after: ScriptedServos
) -> None:
    with driving(tmp_path, before) as driver:
        driver.loop.emergency_stop()
        driver.unplug(before)
        driver.plug(after)
        snapshot = driver.wait_for(State.EMERGENCY_STOP, "the port works again")
        assert snapshot.emergency
        driver.loop.reset_emergency_stop()
        driver.wait_for(State.STOPPED, "needs ~/recover")


def test_a_dry_run_goes_on_by_itself(
    tmp_path: Path, before: ScriptedServos, after: ScriptedServos
) -> None:
    with driving(tmp_path, before, dry_run=True) as driver:
        driver.unplug(before)
        driver.wait_for(State.DRY_RUN, "no such port")
        driver.plug(after)
        driver.wait_for(State.DRY_RUN, "no command yet")
        assert after.instructions(WRITE) == after.instructions(SYNC_WRITE) == []


def test_an_inactive_driver_finds_its_port_again_too(
    tmp_path: Path, before: ScriptedServos, after: ScriptedServos
) -> None:
    with driving(tmp_path, before) as driver:
        driver.loop.deactivate()
        driver.unplug(before)
        driver.wait_for(State.INACTIVE, "no such port")
        driver.plug(after)
        wait_for(lambda: driver.snapshots[-1].readings, 10.0, "readings")
        driver.loop.activate()
        driver.wait_for(State.HOLDING)


def test_closing_does_not_wait_for_servos_that_are_silent(
    tmp_path: Path, before: ScriptedServos, after: ScriptedServos
) -> None:
    with driving(tmp_path, before) as driver:
        after.answer = lambda i, answer: b""
        driver.unplug(before)
        driver.plug(after)
        wait_for(lambda: after.packets, 10.0, "a check of the silent servos")
        asked = len(after.packets)
        driver.loop.close()
        # 44 pings and some two seconds would be the whole check.
        assert len(after.packets) - asked <= 3
