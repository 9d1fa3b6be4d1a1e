"""Control of head raising wheeled snake robots by kinematic redundancy."""

__version__ = "0.1.0"
