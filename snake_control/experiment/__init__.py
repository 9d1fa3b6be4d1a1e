"""Experiments: the recorded series, its summary and the figures of the paper (no ROS)."""
