"""Controllers: from a head reference to joint velocities."""
