"""Replies that can be told apart by their lengths."""

from __future__ import annotations

import pytest

from snake_control.ax12.control_table import TABLE_END
from snake_control.ax12.requests import PING, READ, OwedReplies, Request, read_request


def test_nothing_more_is_asked_for_while_nothing_is_owed() -> None:
    assert read_request(36, 8) == Request(READ, (36, 8), 8, 8, 0)
    assert read_request(36, 8).avoiding({9, 6}) == read_request(36, 8)


@pytest.mark.parametrize("wanted", [1, 2, 6, 8, 14, 26, 49])
def test_the_bytes_wanted_are_within_those_asked_for(wanted: int) -> None:
    avoid: set[int] = set()
    for address in range(TABLE_END + 1 - wanted):
        avoid.clear()
        for _ in range(5):
            request = read_request(address, wanted, avoid)
            start, length = request.parameters
            assert (length, request.wanted) == (request.length, wanted)
            assert start + request.skipped == address
            assert 0 <= start <= address
            assert address + wanted <= start + length <= TABLE_END
            assert length not in avoid or length == wanted
            avoid.add(length)


def test_where_the_table_has_no_more_the_request_stays() -> None:
    assert read_request(0, TABLE_END, {TABLE_END}) == read_request(0, TABLE_END)
    # Beyond the table a servo answers with an error, and is to do so.
    assert read_request(45, 10, {10}) == read_request(45, 10)


def test_an_instruction_without_data_cannot_be_told_apart() -> None:
    assert Request(PING).avoiding({0}) == Request(PING)


def test_a_reply_is_owed_for_a_hundred_requests() -> None:
    owed = OwedReplies()
    owed.lengths()
    owed.missed(8)
    for _ in range(100):
        assert 8 in owed.lengths()
    assert 8 not in owed.lengths()


def test_of_many_owed_replies_the_oldest_is_forgotten() -> None:
    owed = OwedReplies()
    for length in (8, 9, 10, 8, 11, 12, 13, 14):
        owed.lengths()
        owed.missed(length)
    assert set(owed.lengths()) == {10, 8, 11, 12, 13, 14}
