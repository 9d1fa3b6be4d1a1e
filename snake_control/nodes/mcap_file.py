"""Writes an MCAP file as rosbag2 does: serialised messages, schemas and offered QoS."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TypeVar

import yaml
from mcap.writer import CompressionType, Writer
from rclpy.duration import Duration
from rclpy.qos import QoSProfile

from snake_control.errors import ConfigError, SnakeError

_CHUNK_BYTES = 256 * 1024
_UINT32 = 2**32

_Result = TypeVar("_Result")


class RecordingError(SnakeError, OSError):
    """The file cannot be written any more."""


class McapFile:
    """A new file; every ``flush`` makes what was written until then readable, come what may."""

    def __init__(self, path: Path) -> None:
        """Make the file.

        Raises:
            ConfigError: there is one of this name, or none can be made.
        """
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = path.open("xb")
        except FileExistsError:
            raise ConfigError("file", str(path), "it exists; name one that does not") from None
        except OSError as error:
            raise ConfigError("file", str(path), f"it cannot be written: {error}") from error
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._schemas: dict[str, int] = {}
        self._try(lambda: self._writer.start(profile="ros2", library="snake_control"))

    def add_topic(
        self, topic: str, type_name: str, definition: str, metadata: Mapping[str, str]
    ) -> int:
        """Announce a topic and return the number of its channel.

        Args:
            topic: absolute name.
            type_name: ``package/msg/Name``.
            definition: text of the type with all that it needs.
            metadata: ``offered_qos_profiles`` and ``topic_type_hash``.
        """
        if type_name not in self._schemas:
            data = definition.encode()
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", data)
        return self._writer.register_channel(topic, "cdr", self._schemas[type_name], dict(metadata))

    def write(
        self, channel: int, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int
    ) -> None:
        """Append a serialised message.

        Raises:
            RecordingError: the disk is full, or gone.
        """
        self._try(
            lambda: self._writer.add_message(
                channel, log_time_ns, data, publish_time_ns, sequence % _UINT32
            )
        )

    def flush(self) -> None:
        """Hand everything to the system, so that it outlasts this process; raises as ``write``."""
        self._try(self._writer.flush)

    def finish(self, notes: Mapping[str, str]) -> None:
        """Write notes, index and summary, and close the file; raises as ``write``."""
        try:
            self._try(lambda: self._writer.add_metadata("snake_control", dict(notes)))
            self._try(self._writer.finish)
        finally:
            self._try(self._stream.close)

    def _try(self, action: Callable[[], _Result]) -> _Result:
        try:
            return action()
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be written: {error}") from error


def qos_text(profiles: Iterable[QoSProfile]) -> str:
    """Return offered profiles as rosbag2 writes them into a channel's ``offered_qos_profiles``."""
    return str(yaml.safe_dump([_qos(profile) for profile in profiles], sort_keys=False))


def _qos(profile: QoSProfile) -> dict[str, object]:
    return {
        "history": profile.history.name.lower(),
        "depth": profile.depth,
        "reliability": profile.reliability.name.lower(),
        "durability": profile.durability.name.lower(),
        "deadline": _time(profile.deadline),
        "lifespan": _time(profile.lifespan),
        "liveliness": profile.liveliness.name.lower(),
        "liveliness_lease_duration": _time(profile.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": profile.avoid_ros_namespace_conventions,
    }


def _time(duration: Duration) -> dict[str, int]:
    seconds, nanoseconds = divmod(duration.nanoseconds, 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}
