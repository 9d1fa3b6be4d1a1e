"""Reads recordings (MCAP files of the node ``record``) without ROS; needs mcap-ros2-support."""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Collection
from pathlib import Path
from typing import Any

from snake_control.errors import SnakeError


class RecordingFileError(SnakeError, ValueError):
    """A file that is no recording, or cannot be read here."""


@dataclasses.dataclass
class Topic:
    """What a recording has of one topic.

    Attributes:
        type: ``package/msg/Name``.
        times_ns: when each message was published [ns].
        messages: decoded, of the topics that were asked for; else empty.
    """

    type: str
    times_ns: list[int] = dataclasses.field(default_factory=list)
    messages: list[Any] = dataclasses.field(default_factory=list)


@dataclasses.dataclass
class Recording:
    """The contents of a file.

    Attributes:
        topics: by name.
        lost: messages that the recorder missed, by topic; ``None`` if it did not come to say so.
    """

    topics: dict[str, Topic] = dataclasses.field(default_factory=dict)
    lost: dict[str, int] | None = None

    @property
    def span_ns(self) -> tuple[int, int]:
        """Time of the first and the last message [ns]; twice 0 if there is none."""
        times = [t for topic in self.topics.values() for t in topic.times_ns]
        return (min(times), max(times)) if times else (0, 0)


def read_recording(path: Path, decoded: Collection[str] = ()) -> Recording:
    """Read a file; of one that breaks off, what there is.

    Args:
        path: the file.
        decoded: names of the topics whose messages shall be decoded.

    Raises:
        RecordingFileError: no MCAP file, or the packages for it are missing.
        OSError: it cannot be opened.
    """
    try:
        # Here, because robots do without them.
        from mcap.exceptions import EndOfFile, McapError
        from mcap.records import Channel, Message, Metadata, Schema
        from mcap.stream_reader import StreamReader
        from mcap_ros2.decoder import DecoderFactory
        from zstandard import ZstdError
    except ModuleNotFoundError as error:
        raise RecordingFileError(
            f"the Python package {error.name} is missing: pip install mcap-ros2-support"
        ) from error

    found = Recording()
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    factory = DecoderFactory()
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Metadata) and record.name == "snake_control":
                    found.lost = _lost(record.metadata)
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    schema = schemas[channel.schema_id]
                    topic = found.topics.setdefault(channel.topic, Topic(schema.name))
                    topic.times_ns.append(record.publish_time)
                    if channel.topic in decoded:
                        decode = factory.decoder_for(channel.message_encoding, schema)
                        topic.messages.append(decode(record.data) if decode else None)
        except (EndOfFile, struct.error, ZstdError):
            # Its recorder was killed, maybe in the middle of a record.
            pass
        except McapError as error:
            raise RecordingFileError(f"{path} is no MCAP file: {error}") from error
    return found


def _lost(notes: dict[str, str]) -> dict[str, int]:
    prefix = "lost "
    return {k.removeprefix(prefix): int(v) for k, v in notes.items() if k.startswith(prefix)}
