"""Whether those who publish a topic can be heard: their types and qualities of service."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription


class PublisherWatch:
    """Looks at the publishers of one subscription.

    The middleware tells of an incompatible quality of service when it meets one, and not every
    middleware tells of an incompatible type; what the graph says can be read at any time.

    Attributes:
        fitting: publishers that can be heard.
        problem: what keeps others from being heard, in words; empty if nothing does.
    """

    def __init__(self, node: Node, type_name: str) -> None:
        """Watch nothing yet; ``look`` does.

        Args:
            node: on whose graph.
            type_name: the type that is expected (``geometry_msgs/msg/PoseStamped``).
        """
        self._node = node
        self._type_name = type_name
        self.fitting = 0
        self.problem = ""

    def look(self, subscription: Subscription) -> None:
        """Look at who publishes now."""
        self.fitting = 0
        problems = []
        for info in self._node.get_publishers_info_by_topic(subscription.topic_name):
            who = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            if info.topic_type != self._type_name:
                problems.append(
                    f"{who} publishes {subscription.topic_name} as {info.topic_type}, not as "
                    f"{self._type_name} (see the parameter source)"
                )
                continue
            fits, why = qos_check_compatible(info.qos_profile, subscription.qos_profile)
            if fits == QoSCompatibility.ERROR:
                problems.append(
                    f"{who} cannot be heard, its quality of service does not fit: {why}"
                )
            else:
                self.fitting += 1
        self.problem = "; ".join(sorted(problems))


def type_name(message_type: type) -> str:
    """Return the name of a message type as the graph spells it."""
    package, kind, *_ = message_type.__module__.split(".")
    return f"{package}/{kind}/{message_type.__name__}"
