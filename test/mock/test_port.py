import os
import select
import termios

import pytest
import serial

from snake_control.errors import BusError
from snake_control.mock.port import PtyPort


def readable(port: PtyPort) -> bool:
    return bool(select.select([port], [], [], 5.0)[0])


def test_the_link_leads_to_a_port_that_carries_every_byte(tmp_path):
    every_byte = bytes(range(256))
    with PtyPort(tmp_path / "bus") as port:
        assert os.readlink(port.link) == port.device
        with serial.Serial(str(port.link), 1_000_000, timeout=5.0) as client:
            client.write(every_byte)
            assert readable(port)
            assert port.read() == every_byte
            port.write(every_byte)
            assert client.read(256) == every_byte


def test_nothing_to_read_is_no_bytes(tmp_path):
    with PtyPort(tmp_path / "bus") as port:
        assert port.read() == b""


@pytest.mark.parametrize("rate", [9600, 57600, 115200, 500_000, 1_000_000])
def test_the_rate_of_the_client_is_seen(tmp_path, rate):
    with PtyPort(tmp_path / "bus") as port, serial.Serial(str(port.link), rate):
        assert port.baud_rate == rate


def test_clients_may_come_and_go(tmp_path):
    with PtyPort(tmp_path / "bus") as port:
        for _ in range(3):
            with serial.Serial(str(port.link), 1_000_000) as client:
                client.write(b"x")
                assert readable(port)
                assert port.read() == b"x"
            assert port.read() == b""


def test_a_client_that_does_not_read_blocks_nobody(tmp_path):
    with PtyPort(tmp_path / "bus") as port, serial.Serial(str(port.link), 1_000_000):
        for _ in range(100):
            port.write(bytes(1000))


def test_closing_removes_the_link_and_may_be_repeated(tmp_path):
    port = PtyPort(tmp_path / "bus")
    port.close()
    port.close()

    assert list(tmp_path.iterdir()) == []


def test_a_stale_link_is_replaced(tmp_path):
    link = tmp_path / "bus"
    link.symlink_to("/dev/pts/gone")
    with PtyPort(link) as port:
        assert os.readlink(link) == port.device


def test_a_younger_port_keeps_its_link_when_the_older_one_closes(tmp_path):
    old = PtyPort(tmp_path / "bus")
    with PtyPort(tmp_path / "bus") as young:
        old.close()
        assert os.readlink(tmp_path / "bus") == young.device


@pytest.mark.parametrize("kind", ["file", "directory"])
def test_what_is_no_link_is_never_replaced(tmp_path, kind):
    path = tmp_path / "bus"
    if kind == "file":
        path.write_text("keep me")
    else:
        path.mkdir()

    with pytest.raises(BusError, match=r"no symbolic link.*bus"):
        PtyPort(path)
    assert path.is_dir() or path.read_text() == "keep me"


def test_a_directory_that_is_not_there_is_named(tmp_path):
    before = len(os.listdir("/proc/self/fd"))

    with pytest.raises(BusError, match="nowhere/bus"):
        PtyPort(tmp_path / "nowhere" / "bus")
    assert len(os.listdir("/proc/self/fd")) == before


def test_unplugged_it_is_gone_and_whoever_has_it_open_gets_errors(tmp_path):
    link = tmp_path / "bus"
    with PtyPort(link) as port, serial.Serial(str(link), 1_000_000) as client:
        port.unplug()
        assert not os.path.lexists(link)
        with pytest.raises((OSError, termios.error)):
            client.reset_input_buffer()
        port.write(b"lost")
        port.unplug()


def test_replugged_it_is_back_behind_the_same_link(tmp_path):
    link = tmp_path / "bus"
    with PtyPort(link) as port:
        port.unplug()
        port.replug()
        port.replug()
        with serial.Serial(str(link), 1_000_000, timeout=5.0) as client:
            port.write(b"here")
            assert client.read(4) == b"here"
    port.replug()
    assert not os.path.lexists(link)
