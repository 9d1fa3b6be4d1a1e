"""A node's publishers and subscriptions, and whether those at the other ends fit them.

rclpy gives every publisher and subscription two handlers for events of the middleware (another
quality of service, another type), which the executor asks at every message it waits for. Without
them what a pose needs to the bus beside waiting is some 20 % shorter (docs/performance.md). What
they tell can be read from the graph at any time, also where a middleware does not tell it; so the
graph is looked at, one topic at a time.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.duration import Infinite
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import LivelinessPolicy, QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from snake_control.nodes.message_definitions import type_name
from snake_control.nodes.topics import Topic

_LOOK_S = 0.25
"""From one topic to the next: each look takes time that commands might be waiting for."""
_SAID_AGAIN_S = 60.0
_UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""What rcl calls a node of which only the topics are known yet."""
_NO_ANSWER = (AssertionError, RuntimeError, TypeError, ValueError)  # RCLError is a RuntimeError


@dataclasses.dataclass
class Ends:
    """Those at the other ends of one topic.

    Attributes:
        fitting: how many fit.
        problems: what is wrong with the others, in words.
    """

    fitting: int = 0
    problems: frozenset[str] = frozenset()

    @property
    def problem(self) -> str:
        """All problems in one sentence; empty if there are none."""
        return "; ".join(sorted(self.problems))


class Endpoints:
    """Makes publishers and subscriptions, and warns of every other end that does not fit."""

    def __init__(self, node: Node) -> None:
        """Begin without any; ``node`` looks by a timer of a steady clock."""
        self._node = node
        self._watched: dict[Publisher | Subscription, tuple[Topic, str, Ends]] = {}
        self._turns = itertools.count()
        node.create_timer(_LOOK_S, self._take_turn, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publisher(self, topic: Topic) -> Publisher:
        """Return a publisher of a topic."""
        made = self._node.create_publisher(
            topic.type,
            topic.name,
            topic.qos,
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        )
        self._watched[made] = topic, "", Ends()
        return made

    def subscription(
        self,
        topic: Topic,
        callback: Callable[[Any], None],
        qos: QoSProfile | None = None,
        *,
        overriding: bool = False,
        hint: str = "",
    ) -> Subscription:
        """Return a subscription of a topic.

        Args:
            topic: name, type and, unless ``qos`` is given, quality of service.
            callback: takes each message.
            qos: quality of service.
            overriding: whether parameters ``qos_overrides`` change it.
            hint: what to do about another type, in words.
        """
        made = self._node.create_subscription(
            topic.type,
            topic.name,
            callback,
            topic.qos if qos is None else qos,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=(
                QoSOverridingOptions.with_default_policies() if overriding else None
            ),
        )
        self._watched[made] = topic, hint, Ends()
        return made

    def ends(self, endpoint: Publisher | Subscription) -> Ends:
        """Return who was at the other ends when they were looked at last."""
        return self._watched[endpoint][2]

    def _take_turn(self) -> None:
        if not self._watched:
            return
        endpoint = list(self._watched)[next(self._turns) % len(self._watched)]
        try:
            self._look(endpoint)
        except _NO_ANSWER as error:
            # What strangers announce, or do not, must not end a node that drives a robot.
            self._node.get_logger().warning(
                f"who is at the other end of {endpoint.topic_name} cannot be seen: {error!r}",
                throttle_duration_sec=_SAID_AGAIN_S,
            )

    def _look(self, endpoint: Publisher | Subscription) -> None:
        own, hint, ends = self._watched[endpoint]
        topic, type_ = endpoint.topic_name, type_name(own.type)
        hears = isinstance(endpoint, Subscription)
        look = self._node.get_publishers_info_by_topic
        if not hears:
            look = self._node.get_subscriptions_info_by_topic
        fitting, problems = 0, set()
        # By the name as it was given: it is remapped here, too.
        for info in look(own.name):
            if info.node_name == _UNKNOWN:
                continue
            who = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            if info.topic_type != type_:
                does = "publishes" if hears else "subscribes to"
                problems.add(f"{who} {does} {topic} as {info.topic_type}, not as {type_}{hint}")
                continue
            if hears:
                fits, why = qos_check_compatible(info.qos_profile, endpoint.qos_profile)
            else:
                fits, why = qos_check_compatible(_offered(endpoint), info.qos_profile)
            if fits == QoSCompatibility.ERROR:
                does = "cannot be heard" if hears else "cannot hear"
                problems.add(f"{who} {does} on {topic}, its quality of service does not fit: {why}")
            else:
                fitting += 1
        for problem in sorted(problems - ends.problems):
            self._node.get_logger().warning(problem)
        ends.fitting, ends.problems = fitting, frozenset(problems)


def _offered(publisher: Publisher) -> QoSProfile:
    """Return a publisher's quality of service as the graph has it: what is not set is no limit."""
    own = publisher.qos_profile
    return QoSProfile(
        history=own.history,
        depth=own.depth,
        reliability=own.reliability,
        durability=own.durability,
        lifespan=own.lifespan if own.lifespan.nanoseconds else Infinite,
        deadline=own.deadline if own.deadline.nanoseconds else Infinite,
        liveliness=own.liveliness or LivelinessPolicy.AUTOMATIC,
        liveliness_lease_duration=(
            own.liveliness_lease_duration if own.liveliness_lease_duration.nanoseconds else Infinite
        ),
    )
