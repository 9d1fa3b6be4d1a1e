"""Random and mutated packets of Protocol 1.0, the same ones for the same seed."""

from __future__ import annotations

import random

from support.packets import instruction

IDS = (1, 1, 1, 2, 2, 3, 0, 77, 253, 254, 254)
CODES = (1, 2, 2, 3, 3, 3, 3, 4, 5, 6, 8, 0x83, 0x83, 0x92)


def valid(rng: random.Random) -> bytes:
    """An instruction with a good frame; what it says may be nonsense."""
    code = rng.choice(CODES) if rng.random() < 0.95 else rng.randrange(256)
    servo_id = rng.choice(IDS) if rng.random() < 0.9 else rng.randrange(255)
    address = rng.randrange(50) if rng.random() < 0.9 else rng.randrange(256)
    if code == 2:
        parameters = [address, rng.randrange(1, 16) if rng.random() < 0.9 else rng.randrange(256)]
    elif code in (3, 4):
        parameters = [address, *_values(rng, rng.choice((1, 1, 2, 2, 4, 6)))]
    elif code == 0x83:
        length = rng.choice((1, 2, 2, 4))
        parameters = [address, length]
        for _ in range(rng.randrange(4)):
            parameters += [rng.choice(IDS), *_values(rng, length)]
        servo_id = 254 if rng.random() < 0.9 else servo_id
    else:
        parameters = _values(rng, rng.choice((0, 0, 0, 1, 3)))
    return instruction(servo_id, code, *parameters)


def _values(rng: random.Random, count: int) -> list[int]:
    # Small high bytes make words that registers take.
    return [
        rng.randrange(256) if k % 2 == 0 else rng.choice((0, 1, 2, 3, 255)) for k in range(count)
    ]


def mutated(rng: random.Random, packet: bytes) -> bytes:
    """The packet with something wrong about it."""
    spoilt = bytearray(packet)
    kind = rng.randrange(7)
    if not spoilt:
        return rng.randbytes(rng.randrange(8))
    if kind == 0:
        for _ in range(rng.randrange(1, 4)):
            spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
    elif kind == 1:
        del spoilt[rng.randrange(len(spoilt)) :]
    elif kind == 2:
        spoilt[-1] ^= 1 << rng.randrange(8)
    elif kind == 3 and len(spoilt) > 3:
        spoilt[3] = rng.randrange(256)
    elif kind == 4:
        spoilt[:0] = rng.randbytes(rng.randrange(1, 6))
    elif kind == 5:
        spoilt += rng.choice((rng.randbytes(rng.randrange(1, 9)), bytes(packet), b"\xff" * 5))
    else:
        at = rng.randrange(len(spoilt))
        spoilt[at:at] = rng.choice((b"\xff", b"\xff\xff", rng.randbytes(2)))
    return bytes(spoilt)


def anything(rng: random.Random) -> bytes:
    """What may come over a line: packets, spoilt packets, noise."""
    dice = rng.random()
    if dice < 0.5:
        return valid(rng)
    if dice < 0.9:
        return mutated(rng, valid(rng))
    return rng.randbytes(rng.randrange(1, 40))


def frames(data: bytes) -> list[tuple[int, int, bytes]]:
    """All status frames with a good checksum that stand anywhere in the bytes, one by one."""
    found = []
    for start in range(len(data) - 5):
        if data[start : start + 2] != b"\xff\xff":
            continue
        length = data[start + 3]
        end = start + 4 + length
        if length < 2 or end > len(data):
            continue
        body = data[start + 2 : end - 1]
        if (~sum(body)) & 0xFF == data[end - 1]:
            found.append((body[0], body[2], bytes(body[3:])))
    return found


def of_the_wanted(
    found: list[tuple[int, int, bytes]], asked: bytes, servo_id: int, address: int, length: int
) -> list[tuple[bytes, int]]:
    """What may be believed: data and error bits out of frames that answer a request.

    Args:
        found: frames, as ``frames`` returns them.
        asked: the request; a READ may ask for more than is wanted.
        servo_id, address, length: what is wanted; length 0 for an acknowledgement.
    """
    assert asked[2] == servo_id
    start, count = (asked[5], asked[6]) if asked[4] == 2 else (address, 0)
    assert start <= address
    assert address + length <= start + count or count == 0
    return [
        (data[address - start :][:length], error)
        for sender, error, data in found
        if sender == servo_id and len(data) == count
    ]
