"""Serial port for dynamixel_sdk that waits in the kernel instead of spinning.

Differences to the SDK's own PortHandler, each with its reason:

* while a reply is due, the thread sleeps in select(); the SDK reads in a busy loop;
* time-outs use the monotonic clock and a configured reply time, not time.time() and 34 ms;
* old input is really discarded before each packet; SDK 4.0.3 only flushed its output there;
* the port is opened once, locked against a second driver, and a blocked write ends;
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

from dynamixel_sdk import PortHandler

from snake_control.errors import BusError

PORT_FAILURES = (OSError, termios.error)
"""What a failing port raises; termios.error is no OSError, serial.SerialException is one."""

_WRITE_TIMEOUT_S = 0.1
_BITS_PER_BYTE = 10


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
            self.ser.exclusive = True
            self.ser.write_timeout = _WRITE_TIMEOUT_S
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

    def closePort(self) -> None:
        """Close the port."""
        self.close()

    def clearPort(self) -> None:
        """Discard everything received so far."""
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
            self._unread = os.read(self._fd, 4096)
            if not self._unread:
                raise OSError(errno.EIO, "device reports ready to read but returns no data")
        data, self._unread = self._unread[:length], self._unread[length:]
        return data

    def writePort(self, packet: list[int]) -> int:
        """Send a packet; return the number of bytes accepted."""
        now = time.monotonic()
        duration = len(packet) * self._byte_time_s
        self._wire_free_at = max(now, self._wire_free_at) + duration
        written: int = self.ser.write(bytes(packet))
        return written

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
        name = Path(os.path.realpath(path)).name
        timer = Path("/sys/bus/usb-serial/devices") / name / "latency_timer"
        try:
            latency_ms = int(timer.read_text())
        except (OSError, ValueError):
            return
        if latency_ms > 1:
            self.reply_timeout_s = max(self.reply_timeout_s, 2e-3 * latency_ms)
            self.warnings.append(
                f"{path}: latency timer is {latency_ms} ms, so every reply takes that long; write "
                f"1 to {timer} or add the udev rule "
                'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", '
                'ATTR{latency_timer}="1"'
            )


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
