"""Servos that answer from plain memory and misbehave on request: the other end of a pty.

They neither move nor check anything. What they answer with is written here byte by byte, so that a
mistake of the driver's own framing cannot cancel out.
"""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Callable, Iterable

PING, READ, WRITE, SYNC_WRITE = 1, 2, 3, 0x83

Answer = Callable[[bytes, bytes], bytes]
"""(instruction packet, right answer) -> answer to send."""


def checksum(body: bytes) -> int:
    return ~sum(body) & 0xFF


def packet(*body: int) -> bytes:
    """A packet from id, length, instruction or error, and parameters."""
    return bytes((0xFF, 0xFF, *body, checksum(bytes(body))))


def ax12_memory(servo_id: int, position: int = 512) -> bytearray:
    """Power-on values of an AX-12A (e-manual), standing at ``position``."""
    memory = bytearray(50)
    memory[0:19] = bytes(
        (12, 0, 24, servo_id, 1, 250, 0, 0, 0xFF, 3, 0, 70, 60, 140, 0xFF, 3, 2, 36, 36)
    )
    memory[24:36] = bytes((0, 0, 1, 1, 32, 32, *position.to_bytes(2, "little"), 0, 0, 0xFF, 3))
    memory[36:50] = bytes((*position.to_bytes(2, "little"), 0, 0, 0, 0, 111, 40, 0, 0, 0, 0, 32, 0))
    return memory


class ScriptedServos:
    """Context manager: servos behind a pseudo terminal.

    Attributes:
        path: what to open.
        memory: control table by id; change it at will.
        packets: instruction packets received.
        error_bits: by id, sent with each status.
        answer: changes what is answered, ``None`` for the right thing.
    """

    def __init__(self, ids: Iterable[int]) -> None:
        self.memory = {servo_id: ax12_memory(servo_id) for servo_id in ids}
        self.packets: list[bytes] = []
        self.error_bits: dict[int, int] = {}
        self.answer: Answer | None = None

    def __enter__(self) -> ScriptedServos:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def unplug(self) -> None:
        """Close the far end, as pulling the adapter does; harmless a second time."""
        if self._thread.is_alive():
            os.write(self._wake_write, b"x")
            self._thread.join()
            os.close(self._master)
            os.close(self._slave)

    def instructions(self, instruction: int) -> list[bytes]:
        """The packets received with this instruction."""
        return [p for p in self.packets if p[4] == instruction]

    def _serve(self) -> None:
        received = b""
        while True:
            ready, _, _ = select.select([self._master, self._wake_read], [], [])
            if self._wake_read in ready:
                return
            received += os.read(self._master, 4096)
            while len(received) >= 4 and len(received) >= received[3] + 4:
                length = received[3] + 4
                self._take(received[:length])
                received = received[length:]

    def _take(self, instruction: bytes) -> None:
        assert instruction[:2] == b"\xff\xff"
        assert instruction[-1] == checksum(instruction[2:-1])
        self.packets.append(instruction)
        servo_id, code, parameters = instruction[2], instruction[4], instruction[5:-1]
        if code == SYNC_WRITE:
            start, size = parameters[0], parameters[1]
            for i in range(2, len(parameters), size + 1):
                memory = self.memory.get(parameters[i])
                if memory is not None:
                    memory[start : start + size] = parameters[i + 1 : i + 1 + size]
            return
        memory = self.memory.get(servo_id)
        if memory is None:
            reply = b""
        else:
            data = b""
            if code == READ:
                data = bytes(memory[parameters[0] : parameters[0] + parameters[1]])
            elif code == WRITE:
                memory[parameters[0] : parameters[0] + len(parameters) - 1] = parameters[1:]
            reply = packet(servo_id, len(data) + 2, self.error_bits.get(servo_id, 0), *data)
        if self.answer is not None:
            reply = self.answer(instruction, reply)
        if reply:
            os.write(self._master, reply)
