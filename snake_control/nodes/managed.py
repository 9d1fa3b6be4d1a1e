"""A lifecycle node that answers "no" to a transition that its state does not have.

rclpy lets the exception pass, which would end the process, and with it the hold of the robot.
"""

from __future__ import annotations

from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode


class ManagedNode(LifecycleNode):
    """``LifecycleNode`` whose service ``~/change_state`` refuses what cannot be."""

    def __init__(self, name: str, **overrides: Any) -> None:
        """Make the node; arguments as ``LifecycleNode`` takes them."""
        super().__init__(name, **overrides)
        for service in self.services:
            if service.srv_type is ChangeState:
                self._change_state = service.callback
                service.callback = self._change_state_if_possible

    def _change_state_if_possible(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return self._change_state(request, response)
        except rclpy_implementation.RCLError as error:
            self.get_logger().warning(f"transition {request.transition.id} refused: {error}")
            response.success = False
            return response
