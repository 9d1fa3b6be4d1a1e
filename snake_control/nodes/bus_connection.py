"""From the configuration to servos that were checked: the port and what stands on it."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence

from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import Motion, ServoChain
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.port import SerialPort
from snake_control.ax12.startup import cycle_duration, handshake
from snake_control.config import BusDriverConfig

READ_SHARE = 0.85
"""Part of the period after which reads are left to the next cycle."""


def open_bus(driver: BusDriverConfig, warn: Callable[[str], None]) -> Bus:
    """Open the port.

    Raises:
        BusError: it cannot be opened.
    """
    port = SerialPort(driver.port, driver.baud_rate, driver.reply_timeout_s)
    for text in port.warnings:
        warn(text)
    return Bus(port, driver.retries)


def check_servos(
    bus: Bus,
    joints: Sequence[JointSetup],
    models: Collection[int],
    driver: BusDriverConfig,
    warn: Callable[[str], None],
) -> ServoChain:
    """Return the servos, all of them as configured; nothing is written.

    Raises:
        ServoError: everything that is missing or wrong.
        BusError: the port failed.
    """
    period = 1.0 / driver.rate_hz
    motion = Motion(
        period, driver.look_ahead_s, driver.acceleration_limit_rad_s2, driver.lost_after_misses
    )
    bus.reset_counters()
    found = handshake(bus, joints, models)
    chain = ServoChain(bus, joints, found.servos, motion, time.monotonic)
    chain.look_for_torque()
    bus.reset_counters()
    for text in found.warnings:
        warn(text)
    shortest = cycle_duration(found.servos, driver.baud_rate)
    if shortest > READ_SHARE * period:
        warn(
            f"a bus cycle takes {1e3 * shortest:.1f} ms at least, too long for rate_hz = "
            f"{driver.rate_hz:g}: not every servo is read in every cycle; lower Return Delay "
            "Time or rate_hz, or raise the baud rate"
        )
    return chain
