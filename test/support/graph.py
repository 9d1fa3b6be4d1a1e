"""A ROS graph of its own for one test: node processes, recorders, publishers, service calls.

with Graph() as graph:
    controller = graph.start("scp_controller", params_files=[PAPER_ROBOT])
    states = graph.subscribe(CONTROLLER_STATE)
    graph.wait_for(lambda: states.messages, 20.0, "the first controller_state")
"""

from __future__ import annotations

import fcntl
import json
import os
import random
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeVar

import rclpy
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from snake_control.nodes.transport import without_shared_memory
from support.process import Process

_ASK_AGAIN_S = 1.0
_LOOK_EVERY_S = 0.02

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"

_Result = TypeVar("_Result")


class _Service(NamedTuple):
    name: str
    type: Any


class Recorder:
    """Keeps every message of one topic, oldest first."""

    def __init__(self) -> None:
        self._messages: list[Any] = []

    @property
    def messages(self) -> list[Any]:
        """A copy of the messages received so far."""
        return list(self._messages)

    @property
    def last(self) -> Any:
        """The newest message, ``None`` before the first."""
        return self._messages[-1] if self._messages else None

    def clear(self) -> None:
        """Forget the messages received so far."""
        self._messages.clear()

    def _take(self, message: Any) -> None:
        self._messages.append(message)


class Graph:
    """Context manager around a ROS domain that nothing else on this machine uses.

    Attributes:
        node: a node of the test itself, spinning in a thread of its own.
        domain_id: ROS_DOMAIN_ID of this graph.
        environment: environment of the child processes.
    """

    def __enter__(self) -> Graph:
        self._directory = tempfile.TemporaryDirectory(prefix="snake_control_graph_")
        self.domain_id, self._lock = _reserve_domain()
        ours = {
            "ROS_DOMAIN_ID": str(self.domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": self._directory.name,
            "RCUTILS_COLORIZED_OUTPUT": "0",
            "PYTHONUNBUFFERED": "1",
        }
        self.environment = os.environ | ours
        self._processes: list[Process] = []
        self._pause = threading.Event()
        self._clients: dict[tuple[type, str], Any] = {}
        self._probes: dict[tuple[str, int, int], Any] = {}
        self._stop = threading.Event()
        # rcl reads these from the environment of the process while it initialises a context.
        before = {name: os.environ.get(name) for name in ours}
        os.environ.update(ours)
        try:
            self._context = rclpy.Context()
            with without_shared_memory():
                rclpy.init(
                    context=self._context,
                    domain_id=self.domain_id,
                    signal_handler_options=SignalHandlerOptions.NO,
                )
                self.node = rclpy.create_node("test_of_the_graph", context=self._context)
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="graph")
        self._spinning = self._threads.submit(self._spin)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.terminate()
        deadline = time.monotonic() + 10.0
        for process in self._processes:
            try:
                process.wait(max(0.1, deadline - time.monotonic()))
            except AssertionError:
                process.kill()
                process.wait()
        self._stop.set()
        # Something to do, for being woken alone does not end its turn.
        self._executor.create_task(lambda: None)
        self._threads.shutdown()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()
        self._directory.cleanup()
        self._lock.close()

    def start(
        self,
        kind: str,
        *,
        params_files: Sequence[str | Path] = (),
        params: Mapping[str, Any] | None = None,
        arguments: Sequence[str] = (),
    ) -> Process:
        """Start the node ``snake_control.nodes.<kind>`` as a process.

        Args:
            kind: ``bus_driver``, ``scp_controller``, ...
            params_files: given as ``--params-file``, in this order.
            params: single parameters, which win over the files.
            arguments: further ROS arguments, such as ``["-r", "__node:=other"]``.
        """
        ros = ["--ros-args"]
        for path in params_files:
            ros += ["--params-file", str(path)]
        for parameter, value in (params or {}).items():
            # JSON is YAML as rcl reads it.
            ros += ["-p", f"{parameter}:={json.dumps(value)}"]
        ros += arguments
        return self.run(f"snake_control.nodes.{kind}", ros, name=kind)

    def run(self, module: str, arguments: Sequence[str], name: str | None = None) -> Process:
        """Start any module of this project as a process inside this graph's domain."""
        name = name or module
        process = Process(
            name,
            [sys.executable, "-m", module, *arguments],
            log=Path(self._directory.name) / f"{len(self._processes)}_{name}.txt",
            cwd=ROOT,
            environment=self.environment,
        )
        self._processes.append(process)
        return process

    def subscribe(self, topic: Any) -> Recorder:
        """Record a topic (of ``snake_control.nodes.topics``) from now on."""
        recorder = Recorder()
        self.node.create_subscription(topic.type, topic.name, recorder._take, topic.qos)
        self._executor.wake()
        return recorder

    def publisher(self, topic: Any, wait: bool = False) -> Publisher:
        """A publisher on a topic; with ``wait`` somebody has subscribed when this returns."""
        publisher = self.node.create_publisher(topic.type, topic.name, topic.qos)
        if wait:
            subscribers = publisher.get_subscription_count
            self.wait_for(subscribers, 30.0, f"a subscriber of {topic.name}")
        return publisher

    def call(self, node_name: str, service: Any, request: Any, timeout_s: float = 30.0) -> Any:
        """Call a service (of ``snake_control.nodes.topics``) of a node and return the response."""
        name = service.name.replace("~", f"/{node_name}", 1)
        client = self._client(service.type, name)
        deadline = time.monotonic() + timeout_s
        self.wait_for(client.service_is_ready, timeout_s, f"service {name}")
        self._wait_until_known_to(node_name, timeout_s)
        future, replied = client.call_async(request), threading.Event()
        future.add_done_callback(lambda _: replied.set())
        left = max(1.0, deadline - time.monotonic())
        # At once: what tests measure begins with a reply.
        self.wait_for(future.done, left, f"a reply of {name}", wake=replied)
        return future.result()

    def _client(self, service: type, name: str) -> Any:
        """A client, the same one each time, for the test's node waits for all that it has."""
        key = service, name
        if key not in self._clients:
            self._clients[key] = self.node.create_client(service, name)
        return self._clients[key]

    def _probe(self, node_name: str) -> Any:
        """A client of a node that is newer than all others but probes, and than its process."""
        others = sum(client not in self._probes.values() for client in self.node.clients)
        key = node_name, others, len(self._processes)
        if key not in self._probes:
            name = f"/{node_name}/get_parameters"
            self._probes[key] = self.node.create_client(GetParameters, name)
        return self._probes[key]

    def _wait_until_known_to(self, node_name: str, timeout_s: float) -> None:
        """Wait until a node has discovered all clients made so far.

        A reply is lost while the server has not discovered its client, which the client cannot see.
        Clients are announced in order: when a newer one gets replies, the older ones will, too.
        """
        probe = self._probe(node_name)
        self.wait_for(probe.service_is_ready, timeout_s, f"parameters of {node_name}")
        questions: list[tuple[float, Any]] = []

        def answered() -> bool:
            if any(future.done() for _, future in questions):
                return True
            now = time.monotonic()
            if not questions or now - questions[-1][0] > _ASK_AGAIN_S:
                questions.append((now, probe.call_async(GetParameters.Request())))
            return False

        self.wait_for(answered, timeout_s, f"a reply of {node_name}")

    def set_parameters(self, node_name: str, **values: Any) -> dict[str, Any]:
        """Set parameters of a node while it runs (``controller__case=1`` for ``controller.case``).

        Returns:
            ``SetParametersResult`` of each, by the names given here.
        """
        request = SetParameters.Request()
        for name, value in values.items():
            parameter = Parameter(name.replace("__", "."), value=value)
            request.parameters.append(parameter.to_parameter_msg())
        service = _Service("~/set_parameters", SetParameters)
        return dict(zip(values, self.call(node_name, service, request).results, strict=True))

    def set_parameters_atomically(self, node_name: str, **values: Any) -> Any:
        """Set parameters at once, all or none; names as for ``set_parameters``."""
        request = SetParametersAtomically.Request()
        for name, value in values.items():
            parameter = Parameter(name.replace("__", "."), value=value)
            request.parameters.append(parameter.to_parameter_msg())
        service = _Service("~/set_parameters_atomically", SetParametersAtomically)
        return self.call(node_name, service, request).result

    def get_parameter(self, node_name: str, name: str) -> Any:
        """Value of a parameter of a node."""
        request = GetParameters.Request(names=[name])
        response = self.call(node_name, _Service("~/get_parameters", GetParameters), request)
        return parameter_value_to_python(response.values[0])

    def report(self) -> str:
        """State and end of the output of every process."""
        return "\n".join(process.report() for process in self._processes)

    def every(self, period_s: float, callback: Callable[[], None]) -> None:
        """Call ``callback`` periodically, in the thread of the test's node."""
        self.node.create_timer(period_s, callback)
        self._executor.wake()

    def in_its_thread(self, call: Callable[[], _Result]) -> _Result:
        """Call something in the thread of the test's node, and return what it returned."""
        task = self._executor.create_task(call)
        self._executor.wake()
        self.wait_for(task.done, 10.0, "the thread of the test's node")
        return task.result()

    def now_ns(self) -> int:
        """Time of the clock that stamps messages [ns]."""
        return self.node.get_clock().now().nanoseconds

    def wait_for(
        self,
        condition: Callable[[], _Result],
        timeout_s: float,
        what: str,
        wake: threading.Event | None = None,
    ) -> _Result:
        """Wait until ``condition()`` is true and return what it returned.

        It is looked at every 20 ms, and when ``wake`` is set.

        Raises:
            AssertionError: it was not within ``timeout_s``, or a process failed meanwhile; names
                ``what`` and shows the end of every process's output.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            if self._spinning.done():
                # Shows what a callback of the test raised.
                self._spinning.result()
            result = condition()
            if result:
                return result
            left = deadline - time.monotonic()
            crashed = [process.name for process in self._processes if process.crashed]
            if left <= 0 or crashed:
                why = f"{', '.join(crashed)} failed" if crashed else f"not within {timeout_s} s"
                raise AssertionError(f"{what}: {why}\n{self.report()}")
            # Not at every message: of a whole robot there are hundreds each second, and what the
            # test takes of the processor its nodes do not get.
            (wake or self._pause).wait(min(_LOOK_EVERY_S, left))

    def _spin(self) -> None:
        while not self._stop.is_set():
            # A time-out would cost a timer of its own at each message.
            self._executor.spin_once()


def _reserve_domain() -> tuple[int, IO[str]]:
    """A random ROS_DOMAIN_ID and the lock that keeps other tests of this machine off it."""
    for domain in random.SystemRandom().sample(range(1, 102), 101):
        path = Path(tempfile.gettempdir()) / f"snake_control_domain_{domain}.lock"
        try:
            lock = path.open("w")
        except OSError:
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        return domain, lock
    raise RuntimeError("every ROS domain from 1 to 101 is in use")
