"""Random packets in every test run; ``make fuzz`` runs a million."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
import serial

from fuzz.driver import DriverFuzz, LateFuzz
from fuzz.generate import anything, frames, mutated, of_the_wanted
from fuzz.mock import MockFuzz
from snake_control.ax12.bus import Bus
from snake_control.ax12.port import SerialPort
from support.mock_process import Mock
from support.scripted_servos import ScriptedServos


@pytest.mark.parametrize("seed", [1, 2])
def test_any_bytes_leave_the_mock_servos_well(seed: int) -> None:
    fuzz = MockFuzz(seed)
    for _ in range(20_000):
        fuzz.step()
    # It is worth something only if much of it was understood, and much was not.
    assert fuzz.replies > 2500
    assert 500 < fuzz.refused < fuzz.replies


@pytest.mark.parametrize("seed", [1, 2])
def test_the_driver_believes_nothing_but_good_replies(seed: int) -> None:
    fuzz = DriverFuzz(seed)
    for _ in range(10_000):
        fuzz.step()
    assert fuzz.believed > 3000
    assert fuzz.missed > 1000


@pytest.mark.parametrize("seed", [1, 2])
def test_no_late_reply_is_taken_for_the_next_one(seed: int) -> None:
    fuzz = LateFuzz(seed)
    for _ in range(10_000):
        fuzz.step()
    assert fuzz.believed > 3000
    assert fuzz.late > 1000


def test_a_good_frame_is_found_and_a_bad_one_is_not() -> None:
    good = bytes.fromhex("ff ff 01 03 00 20 db")
    assert frames(b"\x00" + good) == [(1, 0, b"\x20")]
    assert frames(good[:-1] + b"\xdc") == []


def test_a_few_thousand_packets_over_a_real_port_leave_the_mock_well(tmp_path: Path) -> None:
    rng = random.Random(3)
    mock = Mock(tmp_path / "bus", "--ids", "1-3", "--no-wire-time")
    try:
        with serial.Serial(str(mock.link), 1_000_000, timeout=0.05, write_timeout=5.0) as line:
            for k in range(3000):
                line.write(anything(rng))
                if k % 10 == 0:
                    line.read(4096)
        assert mock.process.poll() is None
        # Ids, rates and reply levels may be anything now; a new line to it works.
        with serial.Serial(str(mock.link), 1_000_000, timeout=0.2) as line:
            line.write(b"\xff" * 40)
        assert mock.process.poll() is None
    finally:
        assert mock.stop() == 0


def test_a_few_thousand_spoilt_replies_over_a_real_port_do_no_harm() -> None:
    rng = random.Random(4)
    sent: list[bytes] = []
    asked = b""

    def spoil(instruction: bytes, answer: bytes) -> bytes:
        nonlocal asked
        asked = instruction
        spoilt = mutated(rng, answer) if rng.random() < 0.5 else answer
        sent.append(spoilt)
        del sent[:-4]
        return spoilt

    with ScriptedServos([1, 2]) as servos:
        servos.answer = spoil
        bus = Bus(SerialPort(servos.path, 1_000_000, reply_timeout_s=0.002), retries=1)
        believed = 0
        for k in range(2000):
            servo_id = 1 + k % 2
            begin = time.monotonic()
            reply = bus.read(servo_id, 36, 8)
            assert time.monotonic() - begin < 5.0, "it hangs"
            if reply is not None:
                believed += 1
                line = b"".join(sent)
                assert reply in of_the_wanted(frames(line), asked, servo_id, 36, 8)
        bus.close()
    assert 800 < believed < 2000
