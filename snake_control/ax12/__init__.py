"""AX-12 servos on a serial bus: registers, units, instructions, velocity, health. No ROS."""
