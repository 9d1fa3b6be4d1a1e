"""What the head shall do, in time."""
