import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snake_control.mock.bus import Bus
from snake_control.mock.protocol import (
    BROADCAST_ID,
    ErrorBit,
    Instruction,
    InstructionPacket,
    Parser,
    StatusPacket,
)
from snake_control.mock.servo import Servo
from support.packets import PING, instruction


def parse(*pieces: bytes) -> list[InstructionPacket]:
    parser = Parser()
    return [packet for piece in pieces for _, packet in parser.feed(piece)]


# Examples of the manual and the e-manual, byte for byte.
@pytest.mark.parametrize(
    ("text", "packet"),
    [
        ("FF FF 01 02 01 FB", InstructionPacket(1, Instruction.PING)),
        ("FF FF 01 04 02 2B 01 CC", InstructionPacket(1, Instruction.READ, b"\x2b\x01")),
        (
            "FF FF 01 05 04 1E F4 01 E2",
            InstructionPacket(1, Instruction.REG_WRITE, b"\x1e\xf4\x01"),
        ),
        ("FF FF FE 02 05 FA", InstructionPacket(BROADCAST_ID, Instruction.ACTION)),
        (
            "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
            InstructionPacket(
                BROADCAST_ID,
                Instruction.SYNC_WRITE,
                bytes.fromhex("1E 04 00 10 00 50 01 01 20 02 60 03"),
            ),
        ),
        ("FF FF 00 05 03 30 40 00 87", InstructionPacket(0, Instruction.WRITE, b"\x30\x40\x00")),
    ],
)
def test_instructions_of_the_manual_are_read(text, packet):
    assert parse(bytes.fromhex(text)) == [packet]


@pytest.mark.parametrize(
    ("packet", "text"),
    [
        (StatusPacket(1), "FF FF 01 02 00 FC"),
        (StatusPacket(1, parameters=b"\x20"), "FF FF 01 03 00 20 DB"),
        (StatusPacket(0, ErrorBit.RANGE), "FF FF 00 02 08 F5"),
        (StatusPacket(1, ErrorBit.OVERLOAD | ErrorBit.OVERHEATING), "FF FF 01 02 24 D8"),
    ],
)
def test_replies_of_the_manual_are_built(packet, text):
    assert packet.to_bytes() == bytes.fromhex(text)


def test_a_packet_may_come_byte_by_byte():
    pieces = [bytes((b,)) for b in instruction(7, Instruction.READ, 36, 8)]

    assert parse(*pieces) == [InstructionPacket(7, Instruction.READ, b"\x24\x08")]


def test_the_end_of_a_packet_is_told_in_bytes_of_the_last_piece():
    ping = instruction(1, PING)
    parser = Parser()
    parser.feed(ping[:2])

    assert [end for end, _ in parser.feed(ping[2:] + ping)] == [4, 10]


def test_a_wrong_checksum_is_marked_and_the_next_packet_is_read():
    ping = instruction(1, PING)
    wrong = ping[:-1] + b"\x00"

    assert [p.checksum_ok for p in parse(wrong + ping)] == [False, True]


def test_a_longer_row_of_ff_ends_in_a_header():
    assert parse(b"\xff\xff\xff" + instruction(1, PING)) == [InstructionPacket(1, PING)]


@pytest.mark.parametrize("length", [0, 1])
def test_an_impossible_length_is_noise(length):
    noise = bytes((0xFF, 0xFF, 3, length))

    assert parse(noise + instruction(1, PING)) == [InstructionPacket(1, PING)]


@given(st.lists(st.binary(max_size=60), max_size=12))
def test_any_bytes_are_survived(pieces):
    bus = Bus([Servo(1), Servo(2)])

    for i, piece in enumerate(pieces):
        bus.receive(piece, now=0.001 * i, baud_rate=1_000_000)


# Without FF no noise can look like a header; an FF at its end would only lengthen the header.
NOISE = st.binary(max_size=300).map(lambda noise: noise.replace(b"\xff", b"\x00"))


@given(noise=NOISE, cuts=st.lists(st.integers(0, 305), max_size=6))
def test_a_packet_behind_noise_is_answered(noise, cuts):
    stream = noise + instruction(1, PING)
    bus = Bus([Servo(1)])

    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    replies = []
    for start, end in itertools.pairwise(edges):
        replies += bus.receive(stream[start:end], now=0.0, baud_rate=1_000_000)

    assert [reply.data for reply in replies] == [bytes.fromhex("FF FF 01 02 00 FC")]


@given(st.integers(0, 253), st.integers(0, 255), st.binary(max_size=240))
def test_every_packet_is_read_as_it_was_built(servo_id, code, parameters):
    stream = instruction(servo_id, code, *parameters)

    assert parse(stream) == [InstructionPacket(servo_id, code, parameters)]
