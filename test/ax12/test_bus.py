"""Bytes on the wire, and replies that must not be believed, through the real SDK over a pty."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from snake_control.ax12.bus import Bus, Reply
from snake_control.ax12.port import SerialPort
from snake_control.errors import BusError, ServoError
from support.scripted_servos import PING, READ, ScriptedServos, packet


@pytest.fixture
def servos() -> Iterator[ScriptedServos]:
    with ScriptedServos([0, 1]) as servos:
        yield servos


@pytest.fixture
def bus(servos: ScriptedServos) -> Iterator[Bus]:
    bus = Bus(SerialPort(servos.path, 1000000, reply_timeout_s=0.05), retries=1)
    yield bus
    bus.close()


def hexes(text: str) -> bytes:
    return bytes.fromhex(text)


def test_ping_is_the_manuals(bus: Bus, servos: ScriptedServos) -> None:
    assert bus.ping(1) == Reply(b"", 0)
    assert servos.packets == [hexes("FF FF 01 02 01 FB")]


def test_read_is_the_manuals(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory[1][43] = 0x20
    assert bus.read(1, 0x2B, 1) == Reply(b"\x20", 0)
    assert servos.packets == [hexes("FF FF 01 04 02 2B 01 CC")]


def test_sync_write_is_the_manuals(bus: Bus, servos: ScriptedServos) -> None:
    bus.sync_write(0x1E, {0: hexes("10 00 50 01"), 1: hexes("20 02 60 03")})
    assert bus.ping(1) is not None  # the sync write has arrived when this is answered
    assert servos.packets[0] == hexes("FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67")


def test_write_is_acknowledged_and_read_back(bus: Bus, servos: ScriptedServos) -> None:
    bus.write_verified(1, 30, hexes("F4 01"))
    assert servos.packets[0] == packet(1, 5, 3, 30, 0xF4, 0x01)
    assert servos.memory[1][30:32] == hexes("F4 01")


def test_a_write_that_does_not_stick_is_an_error(bus: Bus, servos: ScriptedServos) -> None:
    def forget(instruction: bytes, answer: bytes) -> bytes:
        servos.memory[1][24] = 0
        return answer

    servos.answer = forget
    with pytest.raises(ServoError, match=r"holds \[0\] at address 24 instead of \[1\]"):
        bus.write_verified(1, 24, b"\x01")


def test_a_refused_write_names_the_error(bus: Bus, servos: ScriptedServos) -> None:
    servos.error_bits[1] = 2 | 32
    with pytest.raises(ServoError, match=r"refused .* angle limit error"):
        bus.write_verified(1, 30, hexes("F4 01"))


def test_error_bits_come_beside_the_data(bus: Bus, servos: ScriptedServos) -> None:
    servos.error_bits[1] = 0x20
    reply = bus.read(1, 36, 8)
    assert reply is not None
    assert reply.error_bits == 0x20
    assert reply.data == bytes(servos.memory[1][36:44])


def test_a_missed_reply_is_asked_for_again_and_counted(bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = lambda _, answer: b"" if len(servos.packets) == 1 else answer
    assert bus.read(1, 36, 8) is not None
    counters = bus.counters[1]
    assert (counters.replies, counters.retries, counters.misses) == (1, 1, 0)
    assert len(servos.instructions(READ)) == 2


def test_silence_is_a_miss_not_an_exception(bus: Bus) -> None:
    assert bus.read(7, 36, 8) is None
    assert bus.read(7, 36, 8, retries=0) is None
    counters = bus.counters[7]
    assert (counters.retries, counters.misses, counters.misses_in_row) == (1, 2, 2)


def test_a_reply_ends_a_row_of_misses(bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = lambda _, answer: b""
    assert bus.read(1, 36, 8) is None
    servos.answer = None
    assert bus.read(1, 36, 8) is not None
    assert bus.counters[1].misses_in_row == 0
    assert bus.counters[1].misses == 1


# Each changes the right answer into one that must not pass for data, whatever length was asked for.
WRONG = {
    "bad checksum": lambda _, answer: answer[:-1] + bytes((answer[-1] ^ 1,)),
    "one byte short": lambda _, answer: packet(1, answer[3] - 1, 0, *answer[5:-2]),
    "error status without data": lambda _, answer: packet(1, 2, 8),
    "one byte too many": lambda _, answer: packet(1, answer[3] + 1, 0, *answer[5:-1], 0),
    "truncated": lambda _, answer: answer[:9],
    "echo": lambda instruction, _: instruction,
    "echo and answer": lambda instruction, answer: instruction + answer,
    "answer of another servo": lambda _, answer: packet(0, answer[3], 0, *answer[5:-1]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_answer_is_no_data(wrong: str, bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = WRONG[wrong]
    assert bus.read(1, 36, 8) is None
    servos.answer = None
    assert bus.read(1, 36, 8) == Reply(bytes(servos.memory[1][36:44]), 0)


def test_corrupt_replies_are_counted_and_echoes_known(bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = WRONG["echo"]
    assert bus.read(1, 36, 8) is None
    assert bus.counters[1].corrupt_replies == 2
    assert bus.echoes == 2


def test_a_ping_with_the_voltage_bit_is_no_echo(bus: Bus, servos: ScriptedServos) -> None:
    servos.error_bits[1] = 1
    assert bus.ping(1) == Reply(b"", 1)
    assert servos.packets == [packet(1, 2, PING)]


def test_leading_noise_is_skipped(bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = lambda _, answer: b"\x00\xff\x17" + answer
    assert bus.read(1, 36, 8) == Reply(bytes(servos.memory[1][36:44]), 0)


def test_a_second_answer_is_not_taken_for_the_next(bus: Bus, servos: ScriptedServos) -> None:
    late = packet(1, 10, 0, *([0x55] * 8))
    servos.answer = lambda _, answer: answer + late
    bus.ping(1)
    servos.answer = None
    assert bus.read(1, 36, 8) == Reply(bytes(servos.memory[1][36:44]), 0)


@pytest.mark.parametrize("retries", [0, 1])
def test_an_answer_that_comes_too_late_is_passed_over(
    retries: int, bus: Bus, servos: ScriptedServos
) -> None:
    held_back: list[bytes] = []

    def late_once(_: bytes, answer: bytes) -> bytes:
        if not held_back:
            held_back.append(answer)
            return b""
        # By now the servo has moved.
        servos.memory[1][36] = 7
        return held_back[0] + packet(1, answer[3], 0, 7, *answer[6:-1])

    servos.answer = late_once
    reply = bus.read(1, 36, 8, retries=retries)
    if retries == 0:
        assert reply is None
        reply = bus.read(1, 36, 8)
    assert reply == Reply(bytes(servos.memory[1][36:44]), 0)
    assert reply.data[0] == 7
    assert bus.counters[1].corrupt_replies == 0


def test_answers_that_are_late_again_and_again_are_never_believed(
    bus: Bus, servos: ScriptedServos
) -> None:
    queue = [b""]

    def late(_: bytes, answer: bytes) -> bytes:
        queue.append(answer)
        return queue.pop(0)

    servos.answer = late
    for length in (8, 6, 8, 8, 6, 6, 8, 6):
        assert bus.read(1, 36, length, retries=0) is None
    servos.answer = None
    assert bus.read(1, 36, 8) == Reply(bytes(servos.memory[1][36:44]), 0)


def test_the_wrong_servo_first_then_the_right_one(bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = lambda _, answer: packet(0, answer[3], 0, *([9] * 8)) + answer
    assert bus.read(1, 36, 8) == Reply(bytes(servos.memory[1][36:44]), 0)


def test_many_servos_get_several_sync_writes(bus: Bus, servos: ScriptedServos) -> None:
    values = {servo_id: bytes((servo_id, 0, 1, 0)) for servo_id in range(100)}
    bus.sync_write(30, values)
    assert bus.ping(1) is not None
    written: dict[int, bytes] = {}
    for sent in servos.instructions(0x83):
        assert len(sent) <= 250
        entries = sent[7:-1]
        written |= {entries[i]: entries[i + 1 : i + 5] for i in range(0, len(entries), 5)}
    assert written == values


def test_different_lengths_in_one_sync_write_are_refused(bus: Bus) -> None:
    with pytest.raises(ValueError, match="one length"):
        bus.sync_write(30, {0: b"\x00\x00", 1: b"\x00"})
    with pytest.raises(ValueError, match="one length"):
        bus.sync_write(30, {})


def test_what_does_not_fit_a_byte_does_not_block_the_port(bus: Bus, servos: ScriptedServos) -> None:
    with pytest.raises(ValueError, match="range"):
        bus.read(1, 300, 8)
    assert bus.ping(1) is not None


def test_an_unplugged_port_is_a_bus_error_each_time(bus: Bus, servos: ScriptedServos) -> None:
    assert bus.ping(1) is not None
    servos.unplug()
    for _ in range(2):
        with pytest.raises(BusError, match="stopped working"):
            bus.read(1, 36, 8)
        with pytest.raises(BusError, match="stopped working"):
            bus.sync_write(30, {1: b"\x00\x00"})


def test_waiting_for_a_reply_costs_no_processor_time(bus: Bus) -> None:
    before = time.process_time()
    begin = time.monotonic()
    for _ in range(3):
        assert bus.read(7, 36, 8) is None
    waited = time.monotonic() - begin
    assert waited >= 6 * 0.05
    assert time.process_time() - before < 0.5 * waited
