"""Spoilt replies against the driver's receive path: the real SDK on a port in memory."""

from __future__ import annotations

import random

from fuzz.generate import frames, mutated, of_the_wanted
from snake_control.ax12.bus import Bus, Reply
from snake_control.errors import BusError, ServoError
from snake_control.mock.servo import Servo
from support.packets import status
from support.simulated_bus import MemoryPort, World

RETRIES = 1
TIMEOUT_S = 0.015
_LONGEST_S = (1 + RETRIES) * (TIMEOUT_S + 0.02)


class DriverFuzz:
    """Asks servos over a line that spoils replies, and checks what the driver believes.

    Attributes:
        requests, believed, missed: how many, and what became of them.
    """

    def __init__(self, seed: int) -> None:
        self._rng = random.Random(seed)
        self._world = World([Servo(i) for i in (1, 2, 3)])
        self._port = MemoryPort(self._world, TIMEOUT_S)
        self._port.alter = self._spoil
        self._bus = Bus(self._port, RETRIES)
        self.requests = self.believed = self.missed = 0

    def _spoil(self, replies: list[tuple[float, bytes]]) -> list[tuple[float, bytes]]:
        rng = self._rng
        found = []
        for at, data in replies:
            dice = rng.random()
            if dice < 0.25:
                pass
            elif dice < 0.65:
                data = mutated(rng, data)
            elif dice < 0.72:
                data = status(rng.choice((1, 2, 3)), rng.randrange(128), *rng.randbytes(3))
            elif dice < 0.79:
                # A good frame that is too short or too long.
                data = status(data[2], rng.randrange(128), *rng.randbytes(rng.randrange(12)))
            elif dice < 0.84:
                at += rng.uniform(0.0, 0.04)
            elif dice < 0.9:
                data = rng.randbytes(rng.randrange(60))
            elif dice < 0.95:
                continue
            else:
                found.append((at, rng.randbytes(4)))
                at += 0.0005
            if data:
                found.append((at, data))
        if rng.random() < 0.02:
            # Somebody babbles.
            now = self._world.now
            found += [(now + 0.0003 * k, rng.randbytes(30)) for k in range(60)]
        return found

    def step(self) -> None:
        """Ask something and check the answer.

        Raises:
            AssertionError: a reply was believed that nobody sent, or it took too long.
        """
        rng = self._rng
        servo_id = rng.choice((1, 2, 3))
        before = self._world.now
        self._port.received = b""
        self.requests += 1
        kind = rng.randrange(4)
        try:
            if kind == 0:
                self._judge(servo_id, 0, 0, self._bus.ping(servo_id))
            elif kind == 1:
                goal = rng.randrange(1024).to_bytes(2, "little")
                self._judge(servo_id, 0, 0, self._bus.write(servo_id, 30, goal))
            elif kind == 2:
                address, length = rng.choice(((36, 2), (36, 6), (36, 8), (0, 19), (24, 26)))
                reply = self._bus.read(servo_id, address, length)
                self._judge(servo_id, address, length, reply)
            else:
                self._bus.write_verified(servo_id, 25, bytes((rng.randrange(2),)))
        except (BusError, ServoError):
            self.missed += 1
        else:
            if kind == 3:
                self.believed += 1
        took = self._world.now - before
        assert took <= (2 if kind == 3 else 1) * _LONGEST_S, f"{took} s"
        assert not self._port.is_using

    def _judge(self, servo_id: int, address: int, length: int, reply: Reply | None) -> None:
        if reply is None:
            self.missed += 1
            return
        self.believed += 1
        assert len(reply.data) == length
        line, asked = self._port.received, self._port.sent
        assert reply in of_the_wanted(frames(line), asked, servo_id, address, length), (
            f"believed {reply.data.hex(' ')} of servo {servo_id}, asked with {asked.hex(' ')}; "
            f"the line had {line.hex(' ')}"
        )


class LateFuzz:
    """Reads servos whose replies get lost, late and doubled, and checks which ones are believed.

    Every reply is given the number of the request that it answers.

    Attributes:
        requests, believed, late: how many reads, how many of them answered, and how many replies
            came when they were not expected any more.
    """

    def __init__(self, seed: int) -> None:
        self._rng = random.Random(seed)
        self._world = World([Servo(i) for i in (1, 2)])
        self._port = MemoryPort(self._world, TIMEOUT_S)
        self._port.alter = self._delay
        self._bus = Bus(self._port, RETRIES)
        self._number = 0
        self.requests = self.believed = self.late = 0

    def _delay(self, replies: list[tuple[float, bytes]]) -> list[tuple[float, bytes]]:
        rng = self._rng
        self._number = (self._number + 1) % 65536
        found = []
        for at, data in replies:
            # Twice the number and no more: the shortest read is of four bytes.
            marked = 2 * self._number.to_bytes(2, "little") + bytes(len(data) - 10)
            data = status(data[2], 0, *marked)
            dice = rng.random()
            if dice < 0.15:
                continue
            if dice < 0.45:
                self.late += 1
                at += rng.uniform(TIMEOUT_S, 4 * TIMEOUT_S)
            found.append((at, data))
        return found

    def step(self) -> None:
        """Read something and check which request its answer belongs to.

        Raises:
            AssertionError: it is another one than the last.
        """
        rng = self._rng
        servo_id = rng.choice((1, 1, 2))
        address, length = rng.choice(((36, 6), (36, 8), (24, 12)))
        self.requests += 1
        reply = self._bus.read(servo_id, address, length, rng.randrange(3))
        if reply is not None:
            self.believed += 1
            start, asked = self._port.sent[5], self._port.sent[6]
            marked = 2 * self._number.to_bytes(2, "little") + bytes(asked - 4)
            assert reply.data == marked[address - start :][:length], (
                f"after {self.requests} reads: {reply.data.hex(' ')} is not the answer to "
                f"request {self._number}"
            )
        if rng.random() < 0.3:
            self._world.pass_until(self._world.now + rng.uniform(0.0, 0.02))
