"""A pseudo terminal that looks like a serial adapter, behind a symbolic link with a fixed name."""

from __future__ import annotations

import contextlib
import errno
import os
import pty
import termios
import tty
from pathlib import Path
from types import TracebackType

from snake_control.errors import BusError

_CHUNK = 4096
_RATES: dict[int, int] = {
    getattr(termios, name): int(name[1:])
    for name in dir(termios)
    if name.startswith("B") and name[1:].isdigit()
}


class PtyPort:
    """The servos' end of a serial line; it can be unplugged, as a USB adapter can.

    Attributes:
        link: the path that a client opens.
        device: the device that the link leads to.
        plugged: whether it is there.
    """

    def __init__(self, link: str | Path) -> None:
        """Open the pseudo terminal and put the link in place, over an older link if there is one.

        Raises:
            BusError: something else than a symbolic link stands at ``link``, or it cannot be made.
        """
        self.link = Path(link)
        if os.path.lexists(self.link) and not self.link.is_symlink():
            raise BusError(
                errno.EEXIST, "exists and is no symbolic link; it is not replaced", str(link)
            )
        self._open = True
        self._plug()

    def _plug(self) -> None:
        self._master, self._slave = pty.openpty()
        self.plugged = True
        try:
            # Echo and line editing would garble a binary protocol until the client sets the port.
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.device = os.ttyname(self._slave)
            self._put_link()
        except OSError as error:
            self._close_descriptors()
            raise BusError(
                error.errno, f"cannot be made a link to a port: {error.strerror}", str(self.link)
            ) from error

    def unplug(self) -> None:
        """Vanish: the link and the device go, and whoever has the port open gets errors."""
        if self.plugged:
            self._remove_link()
            self._close_descriptors()

    def replug(self) -> None:
        """Come back behind the same link.

        Raises:
            BusError: the link cannot be made.
        """
        if self._open and not self.plugged:
            self._plug()

    def __enter__(self) -> PtyPort:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def fileno(self) -> int:
        """File descriptor that becomes readable when a client has written; not while unplugged."""
        return self._master

    @property
    def baud_rate(self) -> int:
        """Rate that the client has set [bit/s], 0 if it is none of the known ones."""
        return _RATES.get(termios.tcgetattr(self._slave)[5], 0)

    def read(self) -> bytes:
        """Return what clients wrote, nothing if that is nothing."""
        try:
            return os.read(self._master, _CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        """Send bytes to the client; what a client that does not read leaves no room for is lost."""
        if not self.plugged:
            return
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)

    def close(self) -> None:
        """Remove the link, if it is still this port's, and close the pseudo terminal."""
        self._open = False
        self.unplug()

    def _remove_link(self) -> None:
        with contextlib.suppress(OSError):
            if os.readlink(self.link) == self.device:
                self.link.unlink()

    def _put_link(self) -> None:
        # Renaming is atomic: a client finds the old port or the new one, never none.
        new = self.link.with_name(f"{self.link.name}.{os.getpid()}.new")
        os.symlink(self.device, new)
        try:
            os.replace(new, self.link)
        except OSError:
            new.unlink()
            raise

    def _close_descriptors(self) -> None:
        self.plugged = False
        # An open slave keeps the master readable while no client is there; it goes last.
        os.close(self._master)
        os.close(self._slave)
