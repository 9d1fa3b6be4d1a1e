"""Requests to one servo, and how to tell their replies apart.

A status packet carries no number: a reply that comes late looks like that to the next request. What
differs is its length. So a servo that owes a reply is asked for a few bytes more than needed.
Replies without data (to PING and WRITE) cannot be told apart: what matters is read back.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from snake_control.ax12.control_table import TABLE_END

PING, READ, WRITE = 1, 2, 3

_OWED_REQUESTS, _MOST_OWED = 100, 6


class Request(NamedTuple):
    """An instruction to one servo, and how many bytes of data answer it.

    Of these the caller wants ``wanted``, behind ``skipped`` ones.
    """

    instruction: int
    parameters: tuple[int, ...] = ()
    length: int = 0
    wanted: int = 0
    skipped: int = 0

    def avoiding(self, lengths: Collection[int]) -> Request:
        """Return the same request, answered by another number of bytes than those, if there is."""
        if self.instruction != READ or self.length not in lengths:
            return self
        return read_request(self.parameters[0] + self.skipped, self.wanted, lengths)


def read_request(address: int, wanted: int, avoid: Collection[int] = ()) -> Request:
    """Return a READ of ``wanted`` bytes from ``address``, or of more around them.

    Args:
        avoid: lengths that are not to be asked for; in vain where the table has no others.
    """
    for length in range(wanted, TABLE_END + 1):
        start = min(address, TABLE_END - length)
        if length not in avoid and address + wanted <= start + length:
            return Request(READ, (start, length), length, wanted, address - start)
    return Request(READ, (address, wanted), wanted, wanted)


class OwedReplies:
    """Lengths of the replies that one servo owes, and may send when others are expected.

    A reply counts as owed for the next hundred requests; of more than six the oldest are forgotten.
    """

    def __init__(self) -> None:
        """Owe nothing."""
        self._until: dict[int, int] = {}
        self._requests = 0

    def lengths(self) -> Collection[int]:
        """Return them, at the time of one more request."""
        self._requests += 1
        if self._until:
            self._until = {k: end for k, end in self._until.items() if end >= self._requests}
        return self._until.keys()

    def missed(self, length: int) -> None:
        """Take note that the reply to this request did not come, or not legibly."""
        self._until.pop(length, None)
        if len(self._until) == _MOST_OWED:
            del self._until[next(iter(self._until))]
        self._until[length] = self._requests + _OWED_REQUESTS
