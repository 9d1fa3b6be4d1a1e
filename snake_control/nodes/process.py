"""Runs one node as a process: checks its files first, stops it in order when it is signalled."""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Protocol

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from snake_control.config import load, namespace_and_name, parameter_files, parameters_of_node
from snake_control.errors import ConfigError, SnakeError
from snake_control.nodes.transport import without_shared_memory

EXIT_BAD_CONFIG = 2
EXIT_FAILED = 1

THREAD_SWITCH_S = 5e-4
"""How long a callback may keep a thread that serves a bus waiting for the interpreter (default
5 ms); for ``sys.setswitchinterval``."""

_LOOK_UP_S = 0.1

_LEAVING_S = 3.0
"""How long a process may take to leave the graph; ros2 launch kills after 10 s, without a word."""

_ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def _nothing() -> None:
    pass


class Runnable(Protocol):
    """What a node offers to ``run`` beyond rclpy's own methods."""

    def close(self) -> None:
        """Bring the hardware to rest and release it; ROS still works at this time."""


def end_soon() -> None:
    """End the process within 3 s, with exit code 1 and a traceback, unless it ends by itself.

    To be called when nothing is left that matters but to destroy nodes and to return: when many
    nodes leave at the same time, Fast DDS 2.14 can wait for ever in the destruction of a
    participant (a listener that is never free), at full load and with the interpreter's lock held.
    """
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            # Whoever read it may be gone.
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
    try:
        file = os.dup(sys.__stderr__.fileno())  # type: ignore[union-attr]
    except (AttributeError, OSError, ValueError):
        file = os.open(os.devnull, os.O_WRONLY)
    faulthandler.dump_traceback_later(_LEAVING_S, exit=True, file=file)


def run(make_node: Callable[..., Node], kind: str, arguments: Sequence[str] | None = None) -> int:
    """Make a node, spin it until a signal or a shutdown, close it; return the exit code.

    Files are validated before rcl reads them, because rcl aborts on some mistakes without saying
    which field is wrong. What they and ``-p`` give to this node is handed to it in the order of
    the command line (``parameters_of_node`` says why).

    Args:
        make_node: called with the keyword arguments that rclpy's ``Node`` takes for overrides.
        kind: name of the node unless the command line renames it.
        arguments: command line; ``None`` for the process's own.
    """
    arguments = list(sys.argv if arguments is None else arguments)
    stop = threading.Event()

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    # A closed terminal sends SIGHUP; the robot must come to rest then, too.
    for number in _ENDING_SIGNALS:
        signal.signal(number, on_signal)
    try:
        namespace, name = namespace_and_name(arguments, kind)
        load(*parameter_files(arguments), namespace=namespace, names={kind: name})
        given = parameters_of_node(arguments, kind)
    except SnakeError as error:
        print(f"configuration error: {error}", file=sys.stderr)
        return EXIT_BAD_CONFIG

    surroundings = contextlib.ExitStack()
    try:
        surroundings.enter_context(without_shared_memory())
        # rclpy's own handlers would shut the context down before the node can close in order.
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except (
        SnakeError,
        rclpy_implementation.RCLError,
        rclpy_implementation.UnknownROSArgsError,
    ) as error:
        surroundings.close()
        print(f"configuration error: {error}", file=sys.stderr)
        return EXIT_BAD_CONFIG
    node: Node | None = None
    executor: SingleThreadedExecutor | None = None
    try:
        with surroundings:
            node = make_node(
                parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
                # That is how parameters that nobody knows come to light.
                automatically_declare_parameters_from_overrides=True,
            )
        # What exists by now stays; searching it for garbage takes milliseconds at any moment.
        gc.collect()
        gc.freeze()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        # Python sees a signal when a wait ends. A time-out would do that, too, but rclpy makes a
        # timer of its own for each wait that has one, which every message would wait for.
        node.create_timer(_LOOK_UP_S, _nothing, clock=Clock(clock_type=ClockType.STEADY_TIME))
        while rclpy.ok() and not stop.is_set():
            executor.spin_once()
        return 0
    except ConfigError as error:
        print(f"configuration error: {error}", file=sys.stderr)
        return EXIT_BAD_CONFIG
    except SnakeError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_FAILED
    finally:
        if node is not None:
            node.close()  # type: ignore[attr-defined]
        end_soon()
        if node is not None:
            node.destroy_node()
        # A lifecycle node is in the graph for as long as anything refers to it.
        node = executor = None
        gc.unfreeze()
        gc.collect()
        rclpy.try_shutdown()
        # A terminal and a launch file may both send one; while Python itself ends, a second
        # signal would turn an orderly stop into a death by signal.
        for number in _ENDING_SIGNALS:
            signal.signal(number, signal.SIG_IGN)
