"""The mock as a process of its own, spoken to by the SDK that real robots are driven with."""

import argparse
import os
import subprocess
import sys

import dynamixel_sdk as sdk
import pytest

from snake_control.mock.__main__ import baud_register, ids
from support.mock_process import ROOT, Mock
from support.waiting import wait_for

# On a busy machine the SDK may give up a reply that is just coming.
ATTEMPTS = 5


@pytest.fixture
def mock(tmp_path):
    made = Mock(tmp_path / "bus", "--ids", "1-3,9")
    yield made
    if made.process.poll() is None:
        made.process.kill()
        made.process.communicate()


@pytest.fixture
def port(mock):
    handler = sdk.PortHandler(str(mock.link))
    assert handler.setBaudRate(1_000_000)
    yield handler
    handler.closePort()


PACKETS = sdk.PacketHandler(1.0)


def ping(port, servo_id) -> int | None:
    for _ in range(ATTEMPTS):
        model, result, error = PACKETS.ping(port, servo_id)
        if result == sdk.COMM_SUCCESS:
            assert error == 0
            return model
        assert result == sdk.COMM_RX_TIMEOUT
    return None


def read(port, servo_id, address, size) -> list[int]:
    for _ in range(ATTEMPTS):
        data, result, error = PACKETS.readTxRx(port, servo_id, address, size)
        if result == sdk.COMM_SUCCESS:
            assert (error, len(data)) == (0, size)
            return data
    raise AssertionError(f"servo {servo_id} does not answer")


def write_byte(port, servo_id, address, value) -> int:
    for _ in range(ATTEMPTS):
        result, error = PACKETS.write1ByteTxRx(port, servo_id, address, value)
        if result == sdk.COMM_SUCCESS:
            return error
    raise AssertionError(f"servo {servo_id} does not answer")


def read_word(port, servo_id, address) -> int:
    low, high = read(port, servo_id, address, 2)
    return low | high << 8


def test_the_sdk_finds_the_servos_that_are_there(port):
    assert [i for i in range(1, 12) if ping(port, i) == 12] == [1, 2, 3, 9]


def test_the_sdk_reads_telemetry(port):
    position, speed, load = (read_word(port, 2, address) for address in (36, 38, 40))

    assert (position, speed, load) == (512, 0, 0)
    assert read(port, 2, 36, 8) == [0, 2, 0, 0, 0, 0, 111, 25]


def test_the_sdk_moves_servos_with_one_sync_write(port):
    goals = {1: 530, 3: 500}
    for servo_id in goals:
        assert write_byte(port, servo_id, 24, 1) == 0
    group = sdk.GroupSyncWrite(port, PACKETS, 30, 4)
    for servo_id, goal in goals.items():
        assert group.addParam(servo_id, bytes((goal & 0xFF, goal >> 8, 200, 0)))
    assert group.txPacket() == sdk.COMM_SUCCESS

    def arrived():
        return all(abs(read_word(port, i, 36) - goal) <= 4 for i, goal in goals.items())

    wait_for(arrived, 10.0, "the servos at their goals")
    assert [read_word(port, i, 30) for i in (1, 2, 3)] == [530, 512, 500]
    assert read_word(port, 2, 36) == 512


def test_the_sdk_sees_the_error_of_a_value_out_of_range(port):
    error = write_byte(port, 1, 25, 2)

    assert error == 8
    assert "range" in PACKETS.getRxPacketError(error)


def test_a_wrong_baud_rate_meets_silence_and_the_right_one_an_answer(port):
    assert port.setBaudRate(57_600)
    assert ping(port, 1) is None

    assert port.setBaudRate(1_000_000)
    assert ping(port, 1) == 12


def test_another_baud_rate_can_be_asked_for(tmp_path):
    mock = Mock(tmp_path / "bus", "--baud", "57600", "--ids", "4")
    handler = sdk.PortHandler(str(mock.link))
    assert handler.setBaudRate(57_600)
    try:
        assert ping(handler, 4) == 12
    finally:
        handler.closePort()
        mock.stop()


def test_it_ends_on_request_and_takes_its_link_away(mock):
    assert mock.stop() == 0
    assert not os.path.lexists(mock.link)


def test_other_servos_can_be_asked_for(tmp_path):
    mock = Mock(
        tmp_path / "bus", "--ids", "1,5", "--model", "AX-12W", "--wheel", "--degrees=-30,45",
        "--return-delay", "0", "--volt", "9.5", "--no-wire-time", "--permissive",
    )  # fmt: skip
    handler = sdk.PortHandler(str(mock.link))
    assert handler.setBaudRate(1_000_000)
    try:
        assert ping(handler, 5) == 300
        values = {}
        for address in (0, 5, 6, 8, 36, 42):
            for _ in range(ATTEMPTS):
                value, result, _ = PACKETS.read2ByteTxRx(handler, 5, address)
                if result == sdk.COMM_SUCCESS:
                    break
            values[address] = value
        # 45 degrees are 153.45 positions; the 5 carries the low byte of register 6 behind it.
        assert values == {0: 300, 5: 0, 6: 0, 8: 0, 36: 665, 42: 95 + (25 << 8)}
    finally:
        handler.closePort()
        mock.stop()


def test_a_scenario_runs_by_the_clock_of_the_servos(tmp_path):
    scenario = tmp_path / "faults.yaml"
    scenario.write_text("faults: [{at: 0.5, fault: unplug, duration: 0.5}]")
    mock = Mock(tmp_path / "bus", "--scenario", str(scenario))
    wait_for(lambda: not os.path.lexists(mock.link), 10.0, "the end of the port")
    wait_for(lambda: os.path.lexists(mock.link), 10.0, "the port's return")
    handler = sdk.PortHandler(str(mock.link))
    assert handler.setBaudRate(1_000_000)
    try:
        assert ping(handler, 1) == 12
    finally:
        handler.closePort()
        mock.process.terminate()
        output = mock.process.communicate(timeout=10.0)[0]
    assert "fault: unplug for 0.5 s\nfault over: unplug for 0.5 s\n" in output


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["--scenario", "{none}"], 1, "No such file"),
        (["--degrees", "170"], 2, "-150 to 150"),
        (["--degrees", "1,2"], 2, "give one angle, or 11 of them"),
        (["--volt", "90"], 2, "give 0 to 25.5"),
        (["--model", "AX-99"], 2, "AX-12W"),
    ],
)
def test_arguments_that_cannot_be_are_refused(tmp_path, arguments, code, text):
    given = [a.replace("{none}", str(tmp_path / "none.yaml")) for a in arguments]
    done = subprocess.run(
        [sys.executable, "-m", "snake_control.mock", "--port-link", str(tmp_path / "bus"), *given],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=30.0,
    )
    assert done.returncode == code
    assert text in done.stderr
    assert "Traceback" not in done.stderr


def test_an_occupied_path_is_one_line_of_error(tmp_path):
    path = tmp_path / "bus"
    path.write_text("keep me")
    done = subprocess.run(
        [sys.executable, "-m", "snake_control.mock", "--port-link", str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=30.0,
    )

    assert done.returncode == 1
    assert "no symbolic link" in done.stderr
    assert "Traceback" not in done.stderr
    assert path.read_text() == "keep me"


@pytest.mark.parametrize(
    ("text", "expected"), [("1-11", list(range(1, 12))), ("5", [5]), ("1,3-4,253", [1, 3, 4, 253])]
)
def test_ids_are_read(text, expected):
    assert ids(text) == expected


@pytest.mark.parametrize("text", ["", "x", "1-", "254", "3-1"])
def test_what_is_no_id_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError):
        ids(text)


@pytest.mark.parametrize(
    ("rate", "register"), [(1_000_000, 1), (500_000, 3), (115_200, 16), (57_600, 34), (9_600, 207)]
)
def test_rates_become_the_registers_of_the_manual(rate, register):
    assert baud_register(rate) == register
