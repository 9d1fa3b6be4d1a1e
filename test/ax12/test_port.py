"""What opening a port says when it does not work."""

from __future__ import annotations

import errno
import os
import pty
import termios
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from snake_control.ax12.bus import Bus
from snake_control.ax12.port import SerialPort, advice, lower_latency_timer
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


def test_a_second_program_does_not_change_the_rate_of_the_first() -> None:
    with ScriptedServos([1]) as servos:
        first = SerialPort(servos.path, 57600, 0.01)
        with pytest.raises(BusError, match="in use"):
            SerialPort(servos.path, 1000000, 0.01)
        _, _, _, _, at, _, _ = termios.tcgetattr(first.ser.fd)
        assert at == termios.B57600
        first.close()


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


@contextmanager
def _line() -> Iterator[tuple[str, int]]:
    """A pseudo terminal: what to open, and the descriptor of its far end."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    try:
        yield os.ttyname(slave), master
    finally:
        os.close(slave)
        os.close(master)


def test_a_line_that_takes_nothing_ends_a_write() -> None:
    with _line() as (path, _):
        bus = Bus(SerialPort(path, 1000000, 0.01), retries=0)
        goals = {servo_id: bytes(4) for servo_id in range(40)}

        def fill() -> None:
            for _ in range(1000):
                bus.sync_write(30, goals)

        begin = time.monotonic()
        with pytest.raises(BusError, match="the device took"):
            fill()
        assert time.monotonic() - begin < 5.0
        bus.close()


def test_a_line_that_takes_a_part_gets_the_rest() -> None:
    with _line() as (path, master):
        port = SerialPort(path, 1000000, 0.01)
        packet = list(range(250))
        sent = 0
        os.set_blocking(master, False)
        # Fill it to the brim, then read on the other side while the next packet waits.
        filler = b"\xaa" * 997
        while True:
            try:
                sent += os.write(port.ser.fd, filler)
            except BlockingIOError:
                break
        received = bytearray()
        done = threading.Event()

        def read_on() -> None:
            while len(received) < sent + len(packet) and not done.wait(0.0005):
                try:
                    received.extend(os.read(master, 64))
                except BlockingIOError:
                    continue

        reader = threading.Thread(target=read_on)
        reader.start()
        try:
            assert port.writePort(packet) == len(packet)
            reader.join(10.0)
        finally:
            done.set()
            reader.join()
        assert bytes(received[sent:]) == bytes(packet)
        port.close()


@pytest.mark.parametrize("noise", [b"\x55" * 64, b"\xff" * 64, b"\xff\xff\x07\x02\x00\xf6" * 10])
def test_a_line_that_babbles_for_ever_is_a_miss_in_time(noise: bytes) -> None:
    with _line() as (path, master):
        os.set_blocking(master, False)
        done = threading.Event()

        def babble() -> None:
            while not done.wait(0.0001):
                try:
                    os.write(master, noise)
                except BlockingIOError:
                    continue

        babbler = threading.Thread(target=babble)
        babbler.start()
        try:
            bus = Bus(SerialPort(path, 1000000, 0.02), retries=1)
            for _ in range(3):
                begin = time.monotonic()
                assert bus.read(1, 36, 8) is None
                assert time.monotonic() - begin < 5.0
            bus.close()
        finally:
            done.set()
            babbler.join()


def test_a_closed_port_says_so() -> None:
    with _line() as (path, _):
        bus = Bus(SerialPort(path, 1000000, 0.01), retries=0)
        bus.close()
        with pytest.raises(BusError, match="closed"):
            bus.ping(1)
        with pytest.raises(BusError, match="closed"):
            bus.sync_write(30, {1: bytes(4)})


def test_a_long_latency_timer_is_lowered(tmp_path: Path) -> None:
    timer = tmp_path / "latency_timer"
    timer.write_text("16\n")
    assert lower_latency_timer(timer) == 1
    assert timer.read_text() == "1"


def test_a_latency_timer_that_must_not_be_written_is_told() -> None:
    # A number that nobody may write, not even root.
    assert lower_latency_timer(Path("/proc/sys/kernel/ngroups_max")) == 65536


def test_an_adapter_without_latency_timer_needs_no_advice(tmp_path: Path) -> None:
    assert lower_latency_timer(tmp_path / "latency_timer") is None


def test_a_port_with_a_long_latency_waits_longer_and_names_the_rule(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with _line() as (path, _):
        device = tmp_path / Path(path).name
        device.mkdir()
        (device / "latency_timer").symlink_to("/proc/sys/kernel/ngroups_max")
        monkeypatch.setattr("snake_control.ax12.port.USB_SERIAL_DEVICES", tmp_path)
        port = SerialPort(path, 1000000, 0.01)
        (warning,) = port.warnings
        assert (
            'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
            in warning
        )
        assert port.reply_timeout_s == pytest.approx(2 * 65.536)
        port.close()
