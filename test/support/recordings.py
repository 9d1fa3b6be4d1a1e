"""Reads recordings back with the public readers."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NamedTuple

import pytest

pytest.importorskip("mcap_ros2", reason="needs pip install mcap-ros2-support")

from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from zstandard import ZstdError


class Recorded(NamedTuple):
    """One message of a recording."""

    schema: Schema
    channel: Channel
    message: Message
    decoded: Any


def read(path: Path) -> list[Recorded]:
    """Return every message of a finished file, in order of log time."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [Recorded(*found) for found in reader.iter_decoded_messages()]


def recover(path: Path) -> list[Recorded]:
    """Return what can be read of a file that breaks off."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    found: list[Recorded] = []
    factory = DecoderFactory()
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream, record_size_limit=None).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    schema = schemas[channel.schema_id]
                    decoder = factory.decoder_for(channel.message_encoding, schema)
                    assert decoder is not None
                    found.append(Recorded(schema, channel, record, decoder(record.data)))
        except (EndOfFile, struct.error, ZstdError):
            pass
    return found
