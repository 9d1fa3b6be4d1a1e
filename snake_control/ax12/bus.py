"""Instructions of Protocol 1.0 to servos, through dynamixel_sdk, with replies checked in full.

The SDK does not compare a reply's length with the request, so a short or an echoed packet would
pass for data; here a reply counts only if it is as long as asked. A reply that does not come is
a value (``None``), not an exception: the caller decides how many misses matter.

A late reply must not pass for data of the next one: see ``requests``.
"""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from dynamixel_sdk import (
    BROADCAST_ID,
    COMM_RX_CORRUPT,
    COMM_RX_TIMEOUT,
    COMM_SUCCESS,
    GroupSyncWrite,
    PacketHandler,
)

from snake_control.ax12.port import PORT_FAILURES, Port
from snake_control.ax12.requests import PING, WRITE, OwedReplies, Request, read_request
from snake_control.ax12.units import REFUSED_BITS, error_names
from snake_control.errors import BusError, ServoError

# FF FF id length error | parameters | checksum; length counts error, parameters and checksum.
_ID_INDEX, _LENGTH_INDEX, _ERROR_INDEX, _PARAMETERS = 2, 3, 4, 5

_LONGEST_PACKET = 250
_SYNC_WRITE_FRAME = 8

_ERROR_RATE_REQUESTS = 100

_PATIENT_TIMEOUT_S, _PATIENT_RETRIES = 0.05, 3


class Reply(NamedTuple):
    """A status packet: its parameters and its error bits."""

    data: bytes
    error_bits: int


@dataclasses.dataclass
class Counters:
    """What became of the requests to one servo; a retry that succeeds is a retry, not a miss.

    ``error_rate`` is the share of requests without a good reply at the first try, 0 to 1: an
    exponential mean over about the last hundred, two seconds at 50 Hz.
    """

    replies: int = 0
    retries: int = 0
    misses: int = 0
    corrupt_replies: int = 0
    misses_in_row: int = 0
    error_rate: float = 0.0

    def tried_first(self, good: bool) -> None:
        """Account for the first try of a request."""
        self.error_rate += ((0.0 if good else 1.0) - self.error_rate) / _ERROR_RATE_REQUESTS


class Bus:
    """The servos on one port. For one thread at a time.

    Attributes:
        counters: by servo id; an entry appears with the first read.
        echoes: how many "replies" were the sent packet itself.
    """

    def __init__(self, port: Port, retries: int = 1) -> None:
        self._port = port
        self._packets = PacketHandler(1.0)
        self._retries = retries
        self._groups: dict[tuple[int, int], GroupSyncWrite] = {}
        self._owed: dict[int, OwedReplies] = {}
        self._owner: int | None = None
        self.counters: dict[int, Counters] = {}
        self.echoes = 0

    def reset_counters(self) -> None:
        """Begin counting anew."""
        self.counters.clear()
        self.echoes = 0

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    @contextmanager
    def patient(self) -> Iterator[None]:
        """Wait longer and ask more often inside, where no cycle waits: at start, when arming."""
        timeout, retries = self._port.reply_timeout_s, self._retries
        self._port.reply_timeout_s = max(timeout, _PATIENT_TIMEOUT_S)
        self._retries = max(retries, _PATIENT_RETRIES)
        try:
            yield
        finally:
            self._port.reply_timeout_s, self._retries = timeout, retries

    def ping(self, servo_id: int, retries: int | None = None) -> Reply | None:
        """Ask whether a servo is there; ``None`` if nothing answered.

        Raises:
            BusError: the port failed (so do all methods).
        """
        return self._ask(servo_id, Request(PING), retries)

    def read(
        self, servo_id: int, address: int, length: int, retries: int | None = None
    ) -> Reply | None:
        """Read ``length`` bytes from ``address``; ``None`` if no complete reply came.

        Args:
            retries: how often to ask again; default as given to the constructor.
        """
        return self._ask(servo_id, read_request(address, length), retries)

    def write(self, servo_id: int, address: int, data: bytes) -> Reply | None:
        """Write ``data`` and return the acknowledgement, ``None`` if none came."""
        return self._ask(servo_id, Request(WRITE, (address, *data)), None)

    def write_verified(self, servo_id: int, address: int, data: bytes) -> None:
        """Write ``data``, read it back and compare.

        Raises:
            ServoError: refused, not acknowledged and not there, or read back otherwise.
        """
        acknowledged = self.write(servo_id, address, data)
        if acknowledged is not None and acknowledged.error_bits & REFUSED_BITS:
            names = ", ".join(error_names(acknowledged.error_bits & REFUSED_BITS))
            raise ServoError(
                [f"servo id {servo_id} refused {list(data)} at address {address}: {names} error"]
            )
        # One byte is never read alone: an error status without data could pass for it.
        length = max(2, len(data))
        present = self.read(servo_id, address, length)
        if present is None:
            raise ServoError([f"servo id {servo_id} does not answer at address {address}"])
        if present.data[: len(data)] != data:
            raise ServoError(
                [
                    f"servo id {servo_id} holds {list(present.data[: len(data)])} at address "
                    f"{address} instead of {list(data)}"
                ]
            )

    def sync_write(self, address: int, values: Mapping[int, bytes]) -> None:
        """Write the same registers of several servos in one packet; servos do not reply to it.

        More servos than a packet has room for, 48 with goal and speed, get several.

        Args:
            values: bytes by servo id, all of one length.

        Raises:
            ValueError: different lengths, or none.
        """
        lengths = {len(data) for data in values.values()}
        if len(lengths) != 1:
            raise ValueError(f"give bytes of one length for each servo, not {sorted(lengths)}")
        length = lengths.pop()
        at_once = (_LONGEST_PACKET - _SYNC_WRITE_FRAME) // (1 + length)
        entries = list(values.items())
        with self._port_use():
            group = self._groups.setdefault(
                (address, length), GroupSyncWrite(self._port, self._packets, address, length)
            )
            for start in range(0, len(entries), at_once):
                group.clearParam()
                for servo_id, data in entries[start : start + at_once]:
                    group.addParam(servo_id, list(data))
                result = group.txPacket()
                if result != COMM_SUCCESS:
                    break
        if result != COMM_SUCCESS:
            raise BusError(f"sync write failed: {self._packets.getTxRxResult(result)}")

    def _ask(self, servo_id: int, request: Request, retries: int | None) -> Reply | None:
        if not 0 <= servo_id < BROADCAST_ID:
            raise ValueError(f"no servo id: {servo_id}")
        counters = self.counters.setdefault(servo_id, Counters())
        owed = self._owed.setdefault(servo_id, OwedReplies())
        retries = self._retries if retries is None else retries
        for attempt in range(1 + retries):
            if attempt:
                counters.retries += 1
            avoid = owed.lengths()
            request = request.avoiding(avoid)
            reply = self._transact(counters, servo_id, request, may_be_late=bool(avoid))
            if reply is None:
                owed.missed(request.length)
            if not attempt:
                counters.tried_first(reply is not None)
            if reply is not None:
                counters.replies += 1
                counters.misses_in_row = 0
                return reply
        counters.misses += 1
        counters.misses_in_row += 1
        return None

    def _transact(
        self, counters: Counters, servo_id: int, request: Request, *, may_be_late: bool
    ) -> Reply | None:
        instruction, parameters = request.instruction, request.parameters
        sent = [0, 0, servo_id, len(parameters) + 2, instruction, *parameters, 0]
        echo = strange = False
        with self._port_use():
            received, result, _ = self._packets.txRxPacket(self._port, sent)
            while result == COMM_SUCCESS:
                if received[_ID_INDEX] == servo_id:
                    # A ping's echo looks like a reply with the voltage error bit; the READ after
                    # it tells.
                    echo = received == sent and instruction != PING
                    if echo or received[_LENGTH_INDEX] == request.length + 2:
                        break
                    strange = True
                # The right one may follow; the port's time goes on.
                received, result = self._packets.rxPacket(self._port)
        if result == COMM_SUCCESS and not echo:
            begin = _PARAMETERS + request.skipped
            return Reply(bytes(received[begin : begin + request.wanted]), received[_ERROR_INDEX])
        if result not in (COMM_SUCCESS, COMM_RX_TIMEOUT, COMM_RX_CORRUPT):
            raise BusError(f"instruction failed: {self._packets.getTxRxResult(result)}")
        self.echoes += echo
        if echo or result == COMM_RX_CORRUPT or (strange and not may_be_late):
            counters.corrupt_replies += 1
        return None

    @contextmanager
    def _port_use(self) -> Iterator[None]:
        thread = threading.get_ident()
        if self._owner is not None and self._owner != thread:
            raise RuntimeError("two threads use one bus")
        self._owner = thread
        try:
            yield
        except PORT_FAILURES as error:
            raise BusError(f"{self._port.port_name} stopped working: {error}") from error
        finally:
            self._owner = None
            # The SDK leaves it set when an exception passes, and then refuses every packet.
            self._port.is_using = False
