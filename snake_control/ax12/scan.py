"""Looks for servos on a port: every rate, every id; it only asks."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

from snake_control.ax12 import control_table as ct
from snake_control.ax12 import eeprom
from snake_control.ax12.bus import Bus
from snake_control.ax12.joint import JOINT_MODE, WHEEL_MODE
from snake_control.ax12.port import SerialPort
from snake_control.config.nodes import SDK_BAUD_RATES

RATES = tuple(sorted(SDK_BAUD_RATES, reverse=True))
ALL_IDS = range(254)
MODEL_NAMES = {12: "AX-12", 18: "AX-18", 300: "AX-12W"}

_REPLY_TIMEOUT_S = 0.004


@dataclasses.dataclass(frozen=True)
class Found:
    """One id that answered.

    Attributes:
        servo_id: its id.
        baud_rate: rate at which it answered.
        legible: whether it could be read; if not, two servos may share the id.
        model, firmware, mode, return_delay_us: what it says; 0 and empty if not legible.
    """

    servo_id: int
    baud_rate: int
    legible: bool = True
    model: int = 0
    firmware: int = 0
    mode: str = ""
    return_delay_us: int = 0

    @property
    def model_name(self) -> str:
        """The model in words."""
        return MODEL_NAMES.get(self.model, f"model {self.model}")


def scan(
    path: str,
    rates: Sequence[int],
    ids: Sequence[int],
    progress: Callable[[int, int], None] = lambda *_: None,
    retries: int = 0,
) -> list[Found]:
    """Ask every id at every rate.

    Args:
        path: the port.
        rates: [bit/s], of those that the SDK opens.
        ids: 0 to 253.
        progress: called with the rate and how many ids were asked at it.
        retries: how often an id that is silent is asked again.

    Returns:
        What answered, by rate in the order given, then by id.

    Raises:
        BusError: the port cannot be opened, or failed.
    """
    found = []
    for rate in rates:
        # A byte at 9600 takes 1 ms; the wait for the reply's own bytes is added by the port.
        bus = Bus(SerialPort(path, rate, _REPLY_TIMEOUT_S), retries=retries)
        try:
            for number, servo_id in enumerate(ids, 1):
                one = look_at(bus, servo_id, rate)
                if one is not None:
                    found.append(one)
                progress(rate, number)
        finally:
            bus.close()
    return found


def look_at(bus: Bus, servo_id: int, rate: int) -> Found | None:
    """Return what one id says, ``None`` if nothing answers to it."""
    answered = bus.ping(servo_id) is not None
    if not answered and not bus.counters[servo_id].corrupt_replies:
        return None
    with bus.patient():
        reply = bus.read(servo_id, 0, eeprom.LENGTH)
    if reply is None:
        return Found(servo_id, rate, legible=False)
    block = reply.data
    wheel = ct.CW_ANGLE_LIMIT.decode(block, 0) == 0 == ct.CCW_ANGLE_LIMIT.decode(block, 0)
    return Found(
        servo_id,
        rate,
        model=ct.MODEL_NUMBER.decode(block, 0),
        firmware=ct.FIRMWARE_VERSION.decode(block, 0),
        mode=WHEEL_MODE if wheel else JOINT_MODE,
        return_delay_us=2 * ct.RETURN_DELAY_TIME.decode(block, 0),
    )
