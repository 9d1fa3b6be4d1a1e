"""What opening a port says when it does not work."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from snake_control.ax12.port import SerialPort, advice
from snake_control.errors import BusError
from support.scripted_servos import ScriptedServos


def test_a_missing_port_says_what_to_check(tmp_path: Path) -> None:
    with pytest.raises(BusError, match=r"no such port.*mock_bus") as caught:
        SerialPort(str(tmp_path / "none"), 1000000, 0.01)
    assert isinstance(caught.value, OSError)


def test_a_forbidden_port_names_the_group() -> None:
    text = advice("/dev/ttyUSB0", PermissionError(errno.EACCES, "Permission denied"))
    assert text.startswith("cannot open /dev/ttyUSB0: permission denied")
    assert "dialout" in text


def test_a_file_is_no_serial_port(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    with pytest.raises(BusError, match="not a serial port"):
        SerialPort(str(path), 1000000, 0.01)


def test_a_second_driver_is_told_that_the_port_is_in_use() -> None:
    with ScriptedServos([1]) as servos:
        first = SerialPort(servos.path, 1000000, 0.01)
        with pytest.raises(BusError, match="in use"):
            SerialPort(servos.path, 1000000, 0.01)
        first.close()
        SerialPort(servos.path, 1000000, 0.01).close()


def test_a_rate_the_sdk_does_not_know_is_refused() -> None:
    with ScriptedServos([1]) as servos, pytest.raises(BusError, match="200000"):
        SerialPort(servos.path, 200000, 0.01)


def test_closing_twice_is_harmless() -> None:
    with ScriptedServos([1]) as servos:
        port = SerialPort(servos.path, 1000000, 0.01)
        port.close()
        port.close()


def test_time_on_the_wire_is_added_to_the_reply_time() -> None:
    with ScriptedServos([1]) as servos:
        port = SerialPort(servos.path, 9600, 0.01)
        port.setPacketTimeout(14)
        assert not port.isPacketTimeout()
        assert port.readPort(6) == b""  # waits for 14 bytes at 9600 baud, and 10 ms
        assert port.readPort(6) == b""
        assert port.isPacketTimeout()
        port.close()
