"""A ROS clock that a test can set, for nodes with ``use_sim_time``."""

from __future__ import annotations

from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from snake_control.nodes.conversions import header
from support.graph import Graph


class SettableClock:
    """Publishes ``/clock``: the system's time plus an offset, until it is frozen.

    Attributes:
        offset_s: change it to set the clock [s].
    """

    def __init__(self, graph: Graph) -> None:
        self.offset_s = 0.0
        self._frozen_ns: int | None = None
        self._graph = graph
        self._publisher: Publisher = graph.node.create_publisher(Clock, "/clock", 1)
        graph.every(0.01, self._publish)

    def now_ns(self) -> int:
        """Time of this clock [ns]."""
        if self._frozen_ns is not None:
            return self._frozen_ns
        return self._graph.now_ns() + round(self.offset_s * 1e9)

    def freeze(self) -> None:
        """Let the clock stand, as a timer sees one that was set back."""
        self._frozen_ns = self.now_ns()

    def wait_for_listener(self) -> None:
        """Wait until a node hears this clock."""
        self._graph.wait_for(self._publisher.get_subscription_count, 30.0, "a node on /clock")

    def _publish(self) -> None:
        self._publisher.publish(Clock(clock=header(self.now_ns()).stamp))
