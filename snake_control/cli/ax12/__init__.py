"""The bring-up tool: ``ros2 run snake_control ax12``."""
