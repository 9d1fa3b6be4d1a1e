"""Serial port for dynamixel_sdk that waits in the kernel instead of spinning.

Differences to the SDK's own PortHandler, each with its reason:

* while a reply is due, the thread sleeps in select(); the SDK reads in a busy loop;
* time-outs use the monotonic clock and a configured reply time, not time.time() and 34 ms;
* old input is really discarded before each packet; SDK 4.0.3 only flushed its output there;
* the port is opened once, locked against a second driver, and a blocked write ends;
* a USB adapter's latency timer is lowered where that is allowed, else there is advice;
* every failure is a ``BusError`` that says what to do.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import termios
import time
from pathlib import Path
from typing import Protocol

import serial
from dynamixel_sdk import PortHandler

from snake_control.errors import BusError

PORT_FAILURES = (OSError, termios.error)
"""What a failing port raises; termios.error is no OSError, serial.SerialException is one."""

_WRITE_TIMEOUT_S = 0.1
_BITS_PER_BYTE = 10
_CHUNK = 4096

USB_SERIAL_DEVICES = Path("/sys/bus/usb-serial/devices")
"""Where the system keeps the settings of USB adapters that have a driver of their own."""

UDEV_RULE = 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
"""Line of a file in /etc/udev/rules.d that sets the latency timer of every FTDI adapter."""


class Port(Protocol):
    """What ``Bus`` needs of a port, besides what the SDK does (``dynamixel_sdk.PortHandler``).

    Attributes:
        port_name: its path.
        is_using: the SDK's mark that a packet is under way.
        reply_timeout_s: how long to wait for a reply beyond the time its bytes take on the wire.
    """

    port_name: str
    is_using: bool
    reply_timeout_s: float

    def close(self) -> None:
        """Close it; harmless when it is closed already."""


class SerialPort(PortHandler):  # type: ignore[misc]
    """An open serial port.

    Attributes:
        reply_timeout_s: how long to wait for a reply beyond the time its bytes take on the wire.
        warnings: findings about the port that slow it down, one sentence each.
    """

    def __init__(self, path: str, baud_rate: int, reply_timeout_s: float) -> None:
        """Open the port.

        Raises:
            BusError: it is missing, not permitted, in use, no serial port, or refuses the rate.
        """
        super().__init__(path)
        self.reply_timeout_s = reply_timeout_s
        self.warnings: list[str] = []
        self._byte_time_s = _BITS_PER_BYTE / baud_rate
        self._wire_free_at = 0.0
        self._deadline = 0.0
        self._read_after_deadline = False
        self._unread = b""
        try:
            if not self.setBaudRate(baud_rate):
                raise BusError(f"{path}: dynamixel_sdk does not open ports at {baud_rate} baud")
        except BusError:
            raise
        except (*PORT_FAILURES, ValueError) as error:
            self.close()
            raise BusError(advice(path, error)) from error
        self._fd: int = self.ser.fd
        self._lower_latency(path)

    def close(self) -> None:
        """Close the port; harmless when it is closed already or its device is gone."""
        self.is_open = False
        if self.ser is not None:
            with contextlib.suppress(*PORT_FAILURES):
                self.ser.close()

    # What the SDK calls. Its names.

    def setupPort(self, cflag_baud: int) -> bool:
        """Open the port, locked before its rate is set.

        The rate belongs to the device and not to whoever opened it: setting it first, as the SDK
        does, would take the line from a driver that holds the lock.
        """
        self.closePort()
        self.ser = serial.Serial(
            port=self.port_name, baudrate=self.baudrate, timeout=0, exclusive=True
        )
        self.is_open = True
        self.ser.reset_input_buffer()
        return True

    def closePort(self) -> None:
        """Close the port."""
        self.close()

    def clearPort(self) -> None:
        """Discard everything received so far."""
        if not self.is_open:
            # Its number may be another file's by now.
            raise OSError(errno.EBADF, "the port is closed")
        self._unread = b""
        termios.tcflush(self._fd, termios.TCIFLUSH)

    def readPort(self, length: int) -> bytes:
        """Return up to ``length`` bytes; wait for the first of them until the time-out."""
        if length <= 0:
            return b""
        if not self._unread:
            remaining = self._deadline - time.monotonic()
            if remaining <= 0:
                # Once: a reply may have come while this process was not running. Not twice: the
                # SDK would listen to a babbling bus for ever.
                if self._read_after_deadline:
                    return b""
                self._read_after_deadline = True
            ready, _, _ = select.select([self._fd], [], [], max(0.0, remaining))
            if not ready:
                return b""
            self._unread = os.read(self._fd, _CHUNK)
            if not self._unread:
                raise OSError(errno.EIO, "device reports ready to read but returns no data")
        data, self._unread = self._unread[:length], self._unread[length:]
        return data

    def writePort(self, packet: list[int]) -> int:
        """Send a packet, all of it; return its length.

        Raises:
            TimeoutError: the device does not take it.
        """
        data = bytes(packet)
        now = time.monotonic()
        self._wire_free_at = max(now, self._wire_free_at) + len(data) * self._byte_time_s
        sent = self._write_some(data)
        # Seldom: only a line that is slower than its driver keeps bytes waiting.
        while sent < len(data):
            remaining = now + _WRITE_TIMEOUT_S - time.monotonic()
            _, ready, _ = select.select([], [self._fd], [], max(0.0, remaining))
            if not ready:
                raise TimeoutError(
                    errno.ETIMEDOUT, f"the device took {sent} of {len(data)} bytes and no more"
                )
            sent += self._write_some(data[sent:])
        return sent

    def _write_some(self, data: bytes) -> int:
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start waiting for a reply: what is still to be sent, the reply itself, the reply time."""
        start = max(time.monotonic(), self._wire_free_at)
        self._deadline = start + packet_length * self._byte_time_s + self.reply_timeout_s
        self._read_after_deadline = False

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start waiting for a given time [ms]."""
        self._deadline = time.monotonic() + msec / 1000.0
        self._read_after_deadline = False

    def isPacketTimeout(self) -> bool:
        """Whether the reply is overdue."""
        return self._read_after_deadline and not self._unread and time.monotonic() >= self._deadline

    def _lower_latency(self, path: str) -> None:
        # Only USB serial adapters with a timer know it.
        with contextlib.suppress(*PORT_FAILURES, ValueError):
            self.ser.set_low_latency_mode(True)
        timer = USB_SERIAL_DEVICES / Path(os.path.realpath(path)).name / "latency_timer"
        latency_ms = lower_latency_timer(timer)
        if latency_ms is not None and latency_ms > 1:
            self.reply_timeout_s = max(self.reply_timeout_s, 2e-3 * latency_ms)
            self.warnings.append(
                f"{path}: latency timer is {latency_ms} ms, so every reply takes that long; set it "
                f"(echo 1 | sudo tee {timer}), or for good put {UDEV_RULE} into "
                "/etc/udev/rules.d/99-dynamixel-latency.rules and plug the adapter in again"
            )


def lower_latency_timer(timer: Path) -> int | None:
    """Set an adapter's latency timer to 1 ms if it is longer and that is allowed.

    Args:
        timer: the adapter's file ``latency_timer``.

    Returns:
        The timer in force now [ms], ``None`` if the adapter has none.
    """
    try:
        latency_ms = int(timer.read_text())
        if latency_ms > 1:
            with contextlib.suppress(OSError):
                timer.write_text("1")
            latency_ms = int(timer.read_text())
    except (OSError, ValueError):
        return None
    return latency_ms


def advice(path: str, error: BaseException) -> str:
    """Return what to do about a port that could not be opened."""
    number = _error_number(error)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        text = (
            "no such port: is the adapter plugged in (ls /dev/serial/by-id), or, without hardware, "
            "does mock_bus run and is its port the same path?"
        )
    elif number in (errno.EACCES, errno.EPERM):
        text = (
            "permission denied: add yourself to the group dialout (sudo usermod -aG dialout $USER, "
            'then log in again) or add a udev rule with SUBSYSTEM=="tty", MODE="0666"'
        )
    elif number in (errno.EAGAIN, errno.EBUSY):
        text = "in use by another program: stop the other driver or tool first"
    elif number in (errno.ENOTTY, errno.EINVAL):
        text = "not a serial port"
    else:
        text = str(error)
    return f"cannot open {path}: {text}"


def _error_number(error: BaseException | None) -> int | None:
    """Return errno of an exception or of its cause; pyserial does not always pass it on."""
    while error is not None:
        number = getattr(error, "errno", None) or next(iter(error.args), None)
        if isinstance(number, int):
            return number
        error = error.__context__
    return None
