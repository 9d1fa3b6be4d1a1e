"""Sub-tasks of the redundancy: what the shape controllable points work for (25)-(30)."""

from snake_control.control.sub_tasks.catalogue import BUILT_IN
from snake_control.control.sub_tasks.composition import Composition
from snake_control.control.sub_tasks.sub_task import SubTask

__all__ = ["BUILT_IN", "Composition", "SubTask"]
