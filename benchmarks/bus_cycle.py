"""A bus cycle of eleven servos: SYNC_WRITE of goals and speeds, then a READ of 8 bytes of each.

Against the mock with wire timing, in a process of its own. Three clients take turns, block by
block: the driver's bus, the plain SDK as its users write it (it waits in a busy loop), and a raw
client of reads and writes, whose time beyond the wire's is what mock and pseudo terminal cost.
"""

from __future__ import annotations

import os
import select
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import serial
from dynamixel_sdk import COMM_SUCCESS, GroupSyncWrite, PacketHandler, PortHandler

from snake_control.ax12.bus import Bus
from snake_control.ax12.port import SerialPort
from snake_control.cli.node_processes import NodeProcesses

IDS = tuple(range(1, 12))
GOAL = b"\x00\x02\x14\x00"
ADDRESS, LENGTH = 36, 8
RATE_HZ = 50.0
_BYTE_S = 10e-6
_ROOT = Path(__file__).parents[1]
_START_S = 30.0


def wire_bound(return_delay_raw: int) -> float:
    """Return the time that the bytes and the return delays take [s]."""
    sync_write = 8 + 5 * len(IDS)
    return (sync_write + len(IDS) * 22) * _BYTE_S + len(IDS) * return_delay_raw * 2e-6


@contextmanager
def ours(link: str) -> Iterator[Callable[[], None]]:
    """The driver's way."""
    bus = Bus(SerialPort(link, 1_000_000, 0.015), retries=1)
    goals = dict.fromkeys(IDS, GOAL)

    def cycle() -> None:
        bus.sync_write(30, goals)
        for servo_id in IDS:
            bus.read(servo_id, ADDRESS, LENGTH)

    try:
        yield cycle
    finally:
        bus.close()


@contextmanager
def plain(link: str) -> Iterator[Callable[[], None]]:
    """The SDK as it comes."""
    port, packets = PortHandler(link), PacketHandler(1.0)
    port.setBaudRate(1_000_000)
    group = GroupSyncWrite(port, packets, 30, 4)
    for servo_id in IDS:
        group.addParam(servo_id, list(GOAL))

    def cycle() -> None:
        group.txPacket()
        for servo_id in IDS:
            packets.readTxRx(port, servo_id, ADDRESS, LENGTH)

    try:
        yield cycle
    finally:
        port.closePort()


@contextmanager
def raw(link: str) -> Iterator[Callable[[], None]]:
    """Nothing but reads and writes of whole packets."""
    line = serial.Serial(link, 1_000_000, timeout=0)
    fd = line.fd

    def packet(servo_id: int, code: int, *parameters: int) -> bytes:
        body = bytes((servo_id, len(parameters) + 2, code, *parameters))
        return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))

    entries = [value for servo_id in IDS for value in (servo_id, *GOAL)]
    sync = packet(254, 0x83, 30, 4, *entries)
    reads = [packet(servo_id, 2, ADDRESS, LENGTH) for servo_id in IDS]

    def cycle() -> None:
        os.write(fd, sync)
        for read in reads:
            os.write(fd, read)
            missing = 14
            while missing > 0 and select.select([fd], [], [], 0.05)[0]:
                missing -= len(os.read(fd, missing))

    try:
        yield cycle
    finally:
        line.close()


CLIENTS = {"ours": ours, "plain_sdk": plain, "raw": raw}


@contextmanager
def _mock(directory: str, return_delay_raw: int) -> Iterator[str]:
    link = str(Path(directory) / f"bus_{return_delay_raw}")
    process = subprocess.Popen(
        [sys.executable, "-m", "snake_control.mock", "--port-link", link, "--ids", "1-11"]
        + ["--return-delay", str(return_delay_raw), "--punctual", "--step-hz", "100"],
        cwd=_ROOT,
        stdout=subprocess.DEVNULL,
    )
    try:
        deadline = time.monotonic() + _START_S
        while not os.path.lexists(link):
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError("the mock does not start")
            time.sleep(0.02)
        _answer(link)
        yield link
    finally:
        process.terminate()
        process.wait()


def _answer(link: str) -> None:
    """Check that the plain SDK gets what it asks for: a benchmark of silence would be quick."""
    port, packets = PortHandler(link), PacketHandler(1.0)
    port.setBaudRate(1_000_000)
    for servo_id in IDS:
        for _ in range(5):
            data, result, _ = packets.readTxRx(port, servo_id, ADDRESS, LENGTH)
            if result == COMM_SUCCESS and len(data) == LENGTH:
                break
        else:
            raise RuntimeError(f"the mock's servo {servo_id} does not answer")
    port.closePort()


def _cycles(link: str, blocks: int, calls: int) -> dict[str, list[list[float]]]:
    """Return the times of all cycles by client and block [s]."""
    times: dict[str, list[list[float]]] = {name: [] for name in CLIENTS}
    for _ in range(blocks):
        for name, client in CLIENTS.items():
            with client(link) as cycle:
                cycle()
                block = []
                for _ in range(calls):
                    begin = time.perf_counter()
                    cycle()
                    block.append(time.perf_counter() - begin)
                times[name].append(block)
    return times


def _cpu_share(link: str, client: Callable[[str], object], seconds: float) -> float:
    """Return the processor's share of cycles at 50 Hz in this process."""
    with client(link) as cycle:  # type: ignore[attr-defined]
        begin, cpu = time.perf_counter(), time.process_time()
        due = begin
        while due < begin + seconds:
            cycle()
            due += 1.0 / RATE_HZ
            time.sleep(max(0.0, due - time.perf_counter()))
        return (time.process_time() - cpu) / (time.perf_counter() - begin)


def measure(blocks: int, calls: int) -> dict[str, dict[str, float]]:
    """Measure cycles at return delays 250 and 0 and the processor's share at 50 Hz."""
    calls = max(1, calls // 2)
    found = {}
    with tempfile.TemporaryDirectory(prefix="bench_") as directory:
        for delay in (250, 0):
            bound = wire_bound(delay)
            with _mock(directory, delay) as link:
                times = _cycles(link, blocks, calls)
                p50 = {
                    name: statistics.median(t for block in of for t in block)
                    for name, of in times.items()
                }
                all_ours = [t for block in times["ours"] for t in block]
                ratios = [
                    statistics.median(a) / statistics.median(b)
                    for a, b in zip(times["ours"], times["plain_sdk"], strict=True)
                ]
                row = {
                    "wire_bound_ms": 1e3 * bound,
                    "p50_ms": 1e3 * p50["ours"],
                    "p99_ms": 1e3 * float(np.percentile(all_ours, 99)),
                    "to_wire_bound": p50["ours"] / bound,
                    "to_plain_sdk": statistics.median(ratios),
                    "plain_sdk_p50_ms": 1e3 * p50["plain_sdk"],
                    "mock_overhead_ms": 1e3 * (p50["raw"] - bound),
                }
                if delay == 250:
                    row["cpu_share_50_hz"] = _cpu_share(link, ours, 5.0)
                    row["plain_sdk_cpu_share_50_hz"] = _cpu_share(link, plain, 5.0)
                found[f"delay_{delay}"] = row
        found["whole_node"] = {"cpu_share_50_hz": _node_share(Path(directory), 8.0)}
    return found


def _node_share(directory: Path, seconds: float) -> float:
    """Return the processor's share of the whole bus_driver node, holding the mock robot."""
    environment = os.environ | {"PYTHONUNBUFFERED": "1", "ROS_LOG_DIR": str(directory)}
    processes = NodeProcesses(directory, environment)
    link = directory / "node_bus"
    common = ["--ros-args", "--params-file", str(_ROOT / "config" / "paper_robot.yaml")]
    try:
        for kind in ("mock_bus", "bus_driver"):
            processes.start(kind, [*common, "-p", f"{kind}:port:={link}"])
            deadline = time.monotonic() + _START_S
            ready = "servos at" if kind == "mock_bus" else "torque on"
            while ready not in processes.log(kind).read_text():
                processes.check()
                if time.monotonic() > deadline:
                    raise RuntimeError(f"{kind} does not get ready")
                time.sleep(0.1)
        pid = processes.pids()["bus_driver"]
        time.sleep(1.0)
        begin, cpu = time.perf_counter(), _cpu_seconds(pid)
        time.sleep(seconds)
        return (_cpu_seconds(pid) - cpu) / (time.perf_counter() - begin)
    finally:
        processes.stop(("bus_driver", "mock_bus"), 8.0)


def _cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
