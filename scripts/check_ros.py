"""Says in one line which packages of package.xml an installed ROS 2 Jazzy still lacks."""

from __future__ import annotations

import importlib.util
import sys

# module: package of apt
NEEDED = {
    "rclpy": "ros-jazzy-rclpy",
    "std_srvs": "ros-jazzy-std-srvs",
    "tf2_msgs": "ros-jazzy-tf2-msgs",
    "geometry_msgs": "ros-jazzy-geometry-msgs",
    "sensor_msgs": "ros-jazzy-sensor-msgs",
    "nav_msgs": "ros-jazzy-nav-msgs",
    "diagnostic_msgs": "ros-jazzy-diagnostic-msgs",
    "trajectory_msgs": "ros-jazzy-trajectory-msgs",
    "visualization_msgs": "ros-jazzy-visualization-msgs",
    "dynamixel_sdk": "ros-jazzy-dynamixel-sdk",
    "pinocchio": "ros-jazzy-pinocchio",
    "rosidl_generator_py": "ros-jazzy-rosidl-default-generators",
    "numpy": "python3-numpy",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
    "serial": "python3-serial",
    "matplotlib": "python3-matplotlib",
    "tqdm": "python3-tqdm",
    "colcon_core": "python3-colcon-common-extensions",
}


def main() -> int:
    """Return 1, with the packages to install on standard error, if something is missing."""
    missing = [
        package for module, package in NEEDED.items() if not importlib.util.find_spec(module)
    ]
    if missing:
        print(f"Missing; install: sudo apt install {' '.join(missing)}", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
