"""Thin ROS 2 nodes: messages in and out; the mathematics and the protocol live elsewhere."""
