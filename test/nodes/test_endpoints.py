"""Who is at the other ends of a node's topics, under names that are remapped."""

from __future__ import annotations

import time

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from snake_control.cli.ros_domain import own_domain
from snake_control.nodes.endpoints import Endpoints
from snake_control.nodes.topics import Topic
from snake_control.nodes.transport import without_shared_memory

QOS = QoSProfile(depth=1)


def test_names_are_remapped_once():
    with own_domain():
        context = Context()
        # Swapped: remapping the remapped name would lead back to the first one.
        swapped = ["--ros-args", "-r", "a:=b", "-r", "b:=a", "-r", "__ns:=/robot"]
        with without_shared_memory():
            rclpy.init(args=swapped, context=context)
            node = rclpy.create_node("own", context=context)
        ends = Endpoints(node)
        heard = ends.subscription(Topic("a", String, QOS), print)
        said = ends.publisher(Topic("~/said", String, QOS))
        other = rclpy.create_node(
            "other", context=context, namespace="robot", use_global_arguments=False
        )
        other.create_publisher(String, "b", QOS)
        other.create_subscription(String, "/robot/own/said", print, QOS)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        try:
            deadline = time.monotonic() + 20.0
            while not (ends.ends(heard).fitting and ends.ends(said).fitting):
                assert time.monotonic() < deadline, (ends.ends(heard), ends.ends(said))
                executor.spin_once(timeout_sec=0.1)
            assert heard.topic_name == "/robot/b"
            assert (ends.ends(heard).problem, ends.ends(said).problem) == ("", "")
        finally:
            executor.shutdown()
            for each in (node, other):
                each.destroy_node()
            context.try_shutdown()
