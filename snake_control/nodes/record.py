"""Node ``record``: writes every topic of one robot into an MCAP file.

    ros2 run snake_control record --ros-args -p file:=run.mcap

For Foxglove, PlotJuggler, ``ros2 bag`` and the ``mcap`` readers. Messages are taken as they come,
serialised; nothing is decoded. What was heard up to the last second before is in the file even if
this process is killed. At the end it says what was lost.
"""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile

from snake_control.errors import ConfigError
from snake_control.nodes import topics
from snake_control.nodes.message_definitions import definition, type_name
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.process import run

_LOOK_PERIOD_S = 0.2
_GATHER_PERIOD_S, _GATHER_S = 0.05, 0.04
_BEHIND_NS = 150_000_000
_LAST_MESSAGES_S = 0.05
_LAST_MESSAGES_AT_MOST_S = 2.0


@dataclasses.dataclass
class _Heard:
    """What was heard of one topic.

    Attributes:
        channel: its number in the file; ``None`` before the first message.
        messages: how many were written.
        sequence: publisher's number of the last message; ``None`` if it does not count.
        gaps: numbers that were left out.
        reported: losses that the middleware reported.
        several: several publishers count on their own, so the numbers tell nothing.
    """

    channel: int | None = None
    messages: int = 0
    sequence: int | None = None
    gaps: int = 0
    reported: int = 0
    several: bool = False

    @property
    def lost(self) -> int:
        """How many messages were sent, but not received."""
        return self.reported if self.several else max(self.gaps, self.reported)


class Record(Node):
    """Subscribes to all topics of ``topics.ALL`` in its namespace and writes what comes."""

    def __init__(self, **overrides: Any) -> None:
        """Open the file and subscribe.

        Raises:
            ConfigError: the package ``mcap`` is missing, or the file is there already.
        """
        super().__init__("record", **overrides)
        self._own = own = NodeParameters(self, "record").config.record
        self._writer = _writer()
        path = Path(own.file or time.strftime("snake_%Y%m%d_%H%M%S.mcap"))
        self._file = self._writer.McapFile(path)
        self._heard: dict[str, _Heard] = {}
        self._open_names: dict[str, list[topics.Topic]] = {}
        self._closed = self._behind = False
        by_name: dict[str, list[topics.Topic]] = {}
        for topic in topics.ALL:
            by_name.setdefault(topic.name, []).append(topic)
        for name, choices in by_name.items():
            if len(choices) == 1:
                self._subscribe(choices[0])
            else:
                self._open_names[name] = choices
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(own.flush_period_s, self._file.flush, clock=steady)
        self.create_timer(_LOOK_PERIOD_S, self._look, clock=steady)
        self.create_timer(_GATHER_PERIOD_S, self._gather, clock=steady)
        self.get_logger().info(f"recording to {self._file.path}")

    def _look(self) -> None:
        """Subscribe to names that may have one of several types once somebody publishes there."""
        for name in list(self._open_names):
            offered = {i.topic_type for i in self.get_publishers_info_by_topic(name)}
            for topic in self._open_names[name]:
                if type_name(topic.type) in offered:
                    del self._open_names[name]
                    self._subscribe(topic)
                    break

    def _gather(self) -> None:
        """Let messages gather and take them together: half the work of one by one.

        The middleware's threads receive, and stamp, meanwhile.
        """
        if not self._behind:
            time.sleep(_GATHER_S)
        self._behind = False

    def _subscribe(self, topic: topics.Topic) -> None:
        name = self.resolve_topic_name(topic.name)
        heard = self._heard.setdefault(name, _Heard())

        def take(data: bytes, information: dict[str, int | None]) -> None:
            self._take(name, topic.type, heard, data, information)

        def count_lost(information: Any) -> None:
            heard.reported = information.total_count

        self.create_subscription(
            topic.type,
            topic.name,
            take,
            QoSProfile(
                history=HistoryPolicy.KEEP_LAST,
                depth=self._own.queue,
                reliability=topic.qos.reliability,
                durability=topic.qos.durability,
            ),
            event_callbacks=SubscriptionEventCallbacks(message_lost=count_lost),
            raw=True,
        )

    def _take(
        self,
        name: str,
        message_type: type,
        heard: _Heard,
        data: bytes,
        information: dict[str, int | None],
    ) -> None:
        if heard.channel is None:
            heard.channel = self._announce(name, message_type)
        received = information["received_timestamp"] or time.time_ns()
        self._behind |= time.time_ns() - received > _BEHIND_NS
        sequence = information["publication_sequence_number"]
        if sequence is not None:
            self._follow(name, heard, sequence)
        self._file.write(
            heard.channel,
            data,
            received,
            information["source_timestamp"] or received,
            heard.messages if sequence is None else sequence,
        )
        heard.messages += 1

    def _announce(self, name: str, message_type: type) -> int:
        offered = self.get_publishers_info_by_topic(name)
        metadata = {"offered_qos_profiles": self._writer.qos_text(i.qos_profile for i in offered)}
        if offered:
            metadata["topic_type_hash"] = str(offered[0].topic_type_hash)
        type_ = type_name(message_type)
        own = f"{self.get_namespace().rstrip('/')}/"
        if self._own.strip_namespace and name.startswith(own):
            name = f"/{name.removeprefix(own)}"
        return self._file.add_topic(name, type_, definition(type_), metadata)

    def _follow(self, name: str, heard: _Heard, sequence: int) -> None:
        """Count the numbers that a publisher's messages leave out."""
        before, heard.sequence = heard.sequence, sequence
        if heard.several or before is None or sequence == before + 1:
            return
        if self.count_publishers(name) > 1:
            heard.several = True
        elif sequence > before:
            heard.gaps += sequence - before - 1
        # Else a new publisher counts from 1.

    def close(self) -> None:
        """Take what has arrived, finish the file and say what is in it."""
        if self._closed:
            return
        self._closed = True
        self._take_the_rest()
        written = {name: heard for name, heard in self._heard.items() if heard.messages}
        lost = {name: heard.lost for name, heard in self._heard.items() if heard.lost}
        notes = {f"lost {name}": str(count) for name, count in lost.items()}
        self._file.finish({"lost": str(sum(lost.values())), **notes})
        total = sum(heard.messages for heard in written.values())
        text = f"{total} messages of {len(written)} topics in {self._file.path}"
        if lost:
            which = ", ".join(f"{count} of {name}" for name, count in lost.items())
            self.get_logger().warning(f"{text}; lost: {which}")
        else:
            self.get_logger().info(f"{text}; none lost")

    def _take_the_rest(self) -> None:
        if self.executor is None:
            return
        deadline = time.monotonic() + _LAST_MESSAGES_AT_MOST_S
        before = -1
        while before < (now := self._count()) and time.monotonic() < deadline:
            before = now
            self.executor.spin_once(timeout_sec=_LAST_MESSAGES_S)

    def _count(self) -> int:
        return sum(heard.messages for heard in self._heard.values())


def _writer() -> Any:
    """Return the module that writes the files.

    Raises:
        ConfigError: the package ``mcap`` is missing.
    """
    try:
        # Here, because robots do without it unless they record this way.
        from snake_control.nodes import mcap_file
    except ModuleNotFoundError as error:
        raise ConfigError(
            "record",
            error.name,
            "not installed: pip install mcap, or record with ros2 bag record -s mcap",
        ) from error
    return mcap_file


def main() -> int:
    """Run the node."""
    return run(Record, "record")


if __name__ == "__main__":
    raise SystemExit(main())
