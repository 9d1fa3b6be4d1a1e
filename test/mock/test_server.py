import os
import time

import pytest
import serial

from snake_control.errors import BusError, ModelError
from snake_control.mock.bus import Bus
from snake_control.mock.port import PtyPort
from snake_control.mock.server import Server
from snake_control.mock.servo import Servo
from snake_control.mock.simulation import Simulation
from support.packets import PING, READ, instruction, status
from support.waiting import wait_for


class Broken(Simulation):
    def step_if_due(self, now):
        raise ModelError("the body broke")


@pytest.fixture
def port(tmp_path):
    with PtyPort(tmp_path / "bus") as made:
        yield made


@pytest.fixture
def client(port):
    with serial.Serial(str(port.link), 1_000_000, timeout=5.0) as made:
        yield made


def serve(port, servos, simulation=Simulation):
    server = Server(port, Bus(servos), simulation(servos, 0.005, time.monotonic()), time.monotonic)
    server.start()
    return server


def test_no_reply_comes_before_its_time_on_the_wire(port, client):
    server = serve(port, [Servo(1)])
    for _ in range(20):
        before = time.monotonic()
        client.write(instruction(1, READ, 36, 8))
        assert len(client.read(14)) == 14
        assert time.monotonic() - before >= 22 * 10e-6 + 500e-6
    server.stop()


def test_bytes_of_one_write_and_of_many_are_answered_alike(port, client):
    server = serve(port, [Servo(1), Servo(2)])
    client.write(instruction(1, PING) + instruction(2, PING))
    assert client.read(12) == status(1) + status(2)
    for byte in b"noise" + instruction(2, PING):
        client.write(bytes((byte,)))
    assert client.read(6) == status(2)
    server.stop()


def test_time_passes_for_the_servos(port):
    servo = Servo(1)
    for name, value in (("torque_enable", 1), ("moving_speed", 200), ("goal_position", 1023)):
        servo.store(name, value)
    server = serve(port, [servo])

    wait_for(lambda: servo.motion.angle_rad > 0.5, 10.0, "the servo moving")
    server.check()
    server.stop()


def test_waiting_costs_hardly_any_processor_time(port):
    server = serve(port, [])
    before, start = time.process_time(), time.monotonic()
    wait_for(lambda: time.monotonic() > start + 1.0, 10.0, "a second")
    used = time.process_time() - before
    server.stop()

    assert used < 0.5


def test_what_ended_the_thread_is_told(port):
    server = serve(port, [Servo(1)], Broken)

    def told():
        try:
            server.check()
        except BusError as error:
            return str(error)
        return ""

    assert "the body broke" in wait_for(told, 10.0, "the failure")
    server.stop()


def test_stopping_leaves_no_descriptor_open(port):
    before = len(os.listdir("/proc/self/fd"))
    server = serve(port, [Servo(1)])
    server.stop()

    assert len(os.listdir("/proc/self/fd")) == before
