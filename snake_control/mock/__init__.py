"""AX-12 servos at byte level behind a pseudo terminal: a robot's bus without the robot.

A reading of the servo manual of its own: nothing is shared with the driver's room, so that a
mistake in one cannot hide behind the same mistake in the other.
"""
