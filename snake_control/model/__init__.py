"""The robot's mathematics: geometry, velocity constraints, redundancy, stability."""
