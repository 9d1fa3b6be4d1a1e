"""One link of a bare rclpy relay: ``python -m benchmarks.relay IN OUT``, or ``IN --times FILE``.

It passes poses on, as little as rclpy lets it; the last one writes, as JSON, when each was stamped
and how old it came [s].
"""

from __future__ import annotations

import argparse
import json
import signal
from pathlib import Path
from types import FrameType

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions


def main() -> int:
    """Run until SIGINT."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("heard")
    parser.add_argument("said", nargs="?")
    parser.add_argument("--times", type=Path)
    given = parser.parse_args()
    stopped: list[int] = []

    def on_signal(number: int, _frame: FrameType | None) -> None:
        stopped.append(number)

    signal.signal(signal.SIGINT, on_signal)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(f"relay_of_{given.heard}")
    ages: list[tuple[float, float]] = []
    if given.said is None:
        clock = node.get_clock()

        def take(message: PoseStamped) -> None:
            stamp = message.header.stamp
            stamp_ns = stamp.sec * 10**9 + stamp.nanosec
            ages.append((stamp_ns * 1e-9, (clock.now().nanoseconds - stamp_ns) * 1e-9))
    else:
        take = node.create_publisher(PoseStamped, given.said, qos_profile_sensor_data).publish
    node.create_subscription(PoseStamped, given.heard, take, qos_profile_sensor_data)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not stopped:
        executor.spin_once(timeout_sec=0.1)
    if given.times is not None:
        given.times.write_text(json.dumps(ages))
    node.destroy_node()
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
