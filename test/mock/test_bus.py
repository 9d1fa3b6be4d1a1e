import pytest

from snake_control.mock.bus import GAP_S, Bus
from snake_control.mock.servo import Servo
from support.packets import (
    BROADCAST,
    PING,
    READ,
    SYNC_WRITE,
    WRITE,
    instruction,
    status,
    word,
)

MBAUD = 1_000_000
BYTE_S = 10e-6


def servos(*ids: int, delay_raw: int = 250, **eeprom: int) -> list[Servo]:
    return [Servo(i, eeprom={"return_delay_time": delay_raw, **eeprom}) for i in ids]


def test_a_reply_has_passed_after_both_packets_and_the_return_delay():
    bus = Bus(servos(1))

    [reply] = bus.receive(instruction(1, READ, 36, 8), now=100.0, baud_rate=MBAUD)

    assert len(reply.data) == 14
    assert reply.at - 100.0 == pytest.approx(8 * BYTE_S + 500e-6 + 14 * BYTE_S)


@pytest.mark.parametrize("raw", [0, 1, 100, 254])
def test_the_return_delay_counts_in_2_us(raw):
    bus = Bus(servos(1, delay_raw=raw))

    [reply] = bus.receive(instruction(1, PING), now=0.0, baud_rate=MBAUD)

    assert reply.at == pytest.approx(12 * BYTE_S + raw * 2e-6)


def test_the_return_delay_can_be_written():
    bus = Bus(servos(1))
    bus.receive(instruction(1, WRITE, 5, 0), now=0.0, baud_rate=MBAUD)

    [reply] = bus.receive(instruction(1, PING), now=1.0, baud_rate=MBAUD)

    assert reply.at == pytest.approx(1.0 + 12 * BYTE_S)


@pytest.mark.parametrize(("rate", "register"), [(57600, 34), (115200, 16), (9600, 207)])
def test_a_slower_wire_takes_longer(rate, register):
    bus = Bus(servos(1, delay_raw=0, baud_rate=register))

    [reply] = bus.receive(instruction(1, PING), now=0.0, baud_rate=rate)

    assert reply.at == pytest.approx(12 * 10 / rate)


def test_a_cycle_of_eleven_servos_takes_what_the_bytes_take():
    bus = Bus(servos(*range(1, 12), delay_raw=0))
    entries = [b for i in range(1, 12) for b in (i, *word(600), *word(100))]
    sync = instruction(BROADCAST, SYNC_WRITE, 30, 4, *entries)
    assert len(sync) == 63

    now = 0.0
    assert bus.receive(sync, now, MBAUD) == []
    for servo_id in range(1, 12):
        [reply] = bus.receive(instruction(servo_id, READ, 36, 8), now, MBAUD)
        now = reply.at

    assert now == pytest.approx((63 + 11 * 22) * BYTE_S)


def test_instructions_written_at_once_are_answered_one_after_the_other():
    bus = Bus(servos(1, 2, delay_raw=0))

    replies = bus.receive(instruction(2, PING) + instruction(1, PING), 0.0, MBAUD)

    assert [reply.data for reply in replies] == [status(2), status(1)]
    assert replies[1].at - replies[0].at >= 6 * BYTE_S * (1 - 1e-9)


def test_without_wire_time_only_the_return_delay_counts():
    bus = Bus(servos(1), wire_time=False)

    [reply] = bus.receive(instruction(1, PING), now=0.0, baud_rate=MBAUD)

    assert reply.at == pytest.approx(500e-6)


@pytest.mark.parametrize("rate", [9600, 57600, 500_000, 2_000_000, 0])
def test_servos_do_not_hear_another_baud_rate(rate):
    deaf = servos(1)
    bus = Bus(deaf)

    assert bus.receive(instruction(1, PING), 0.0, rate) == []
    bus.receive(instruction(BROADCAST, WRITE, 25, 1), 1.0, rate)
    assert deaf[0].registers["led"] == 0


def test_a_written_baud_rate_holds_from_the_next_packet_on():
    bus = Bus(servos(1))

    assert bus.receive(instruction(1, WRITE, 4, 34), 0.0, MBAUD)[0].data == status(1)
    assert bus.receive(instruction(1, PING), 1.0, MBAUD) == []
    assert bus.receive(instruction(1, PING), 2.0, 57600)[0].data == status(1)


def test_an_id_that_is_not_there_is_not_answered():
    assert Bus(servos(1, 2)).receive(instruction(3, PING), 0.0, MBAUD) == []


def test_two_servos_with_one_id_garble_their_replies():
    twins = [Servo(1, angle_rad=0.0), Servo(1, angle_rad=0.5)]
    bus = Bus(twins)

    [reply] = bus.receive(instruction(1, READ, 36, 8), 0.0, MBAUD)

    alone = [Bus([t]).receive(instruction(1, READ, 36, 8), 0.0, MBAUD)[0].data for t in twins]
    assert reply.data not in alone
    assert reply.data[-1] != ~sum(reply.data[2:-1]) & 0xFF


def test_a_ping_of_two_servos_with_one_id_is_garbled_too():
    [reply] = Bus(servos(5, 5)).receive(instruction(5, PING), 0.0, MBAUD)

    assert reply.data != status(5)


def test_half_a_packet_is_given_up_after_a_gap():
    ping = instruction(1, PING)
    bus = Bus(servos(1))

    bus.receive(ping[:4], 0.0, MBAUD)
    assert len(bus.receive(ping[4:], 0.5 * GAP_S, MBAUD)) == 1
    bus.receive(ping[:4], 1.0, MBAUD)
    assert bus.receive(ping[4:], 1.0 + 2 * GAP_S, MBAUD) == []
    assert len(bus.receive(ping, 2.0, MBAUD)) == 1


def test_a_late_host_does_not_wait_for_what_it_sent_long_ago():
    bus = Bus(servos(1, delay_raw=0))
    bus.receive(instruction(1, PING), 0.0, MBAUD)

    [reply] = bus.receive(instruction(1, PING), 5.0, MBAUD)

    assert reply.at == pytest.approx(5.0 + 12 * BYTE_S)
