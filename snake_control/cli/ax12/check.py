"""``ax12 check``: whether port and servos are as the parameters need them, with advice."""

from __future__ import annotations

import argparse
import dataclasses
import math

from snake_control.ax12 import control_table as ct
from snake_control.ax12.bus import Bus
from snake_control.ax12.eeprom import servo_info
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.port import SerialPort
from snake_control.ax12.startup import Inspection, cycle_duration, inspect
from snake_control.ax12.units import error_names, raw_to_volt
from snake_control.cli.ax12.common import add_json, add_port, config_of, joints_of, print_json
from snake_control.cli.common import EXIT_FAILED, EXIT_OK
from snake_control.config import Config
from snake_control.model.statics import holding_torques

HELP = "check port and servos against the parameters; writes nothing"

ERROR, WARNING, ADVICE = "error", "warning", "advice"
_READ_SHARE = 0.85


@dataclasses.dataclass(frozen=True)
class Line:
    """One finding: how bad, about what, and what to do."""

    level: str
    about: str
    text: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_port(parser)
    add_json(parser)


def run(given: argparse.Namespace) -> int:
    """Check everything; return the exit code: 1 if the driver would refuse to start."""
    config = config_of(given)
    driver, joints = config.bus_driver, joints_of(config)
    path, rate = given.port or driver.port, given.baud or driver.baud_rate
    port = SerialPort(path, rate, driver.reply_timeout_s)
    lines = [Line(WARNING, path, text) for text in port.warnings]
    bus = Bus(port, retries=2)
    try:
        found = inspect(bus, joints, config.servos.accepted_models)
        lines += _of_inspection(found, path, rate)
        for joint, block in zip(joints, found.blocks, strict=True):
            if block is not None:
                lines += _now(bus, joint, block, config)
    finally:
        bus.close()
    lines += _of_robot(config, joints, found, rate)
    failed = any(line.level == ERROR for line in lines)
    if given.json:
        print_json({"ok": not failed, "findings": [dataclasses.asdict(line) for line in lines]})
    else:
        for line in sorted(lines, key=lambda line: (ERROR, WARNING, ADVICE).index(line.level)):
            print(f"{line.level:8} {line.about}: {line.text}")
        answered = sum(block is not None for block in found.blocks)
        verdict = "not ready to drive" if failed else "ready to drive"
        print(f"{answered} of {len(joints)} servos answer on {path}: {verdict}")
    return EXIT_FAILED if failed else EXIT_OK


def _of_inspection(found: Inspection, path: str, rate: int) -> list[Line]:
    lines = []
    for finding in found.findings:
        level = ERROR if finding.error else ADVICE if finding.advice else WARNING
        about = path if finding.joint is None else str(finding.joint)
        lines.append(Line(level, about, finding.text))
    if not any(found.blocks):
        lines.append(
            Line(
                ADVICE, path, f"nothing at {rate} bit/s: `ax12 scan --port {path}` tries all rates"
            )
        )
    return lines


def _now(bus: Bus, joint: JointSetup, block: bytes, config: Config) -> list[Line]:
    """What the servo measures now."""
    with bus.patient():
        reply = bus.read(joint.servo_id, *ct.FEEDBACK_BLOCK)
    if reply is None:
        return [Line(ERROR, str(joint), "does not answer any more")]
    driver, start = config.bus_driver, ct.PRESENT_POSITION.address
    lines = []
    if reply.error_bits:
        names = ", ".join(error_names(reply.error_bits))
        lines.append(Line(ERROR, str(joint), f"reports {names}: put that right first"))
    voltage = raw_to_volt(ct.PRESENT_VOLTAGE.decode(reply.data, start))
    if not driver.voltage_low_warn_v <= voltage <= driver.voltage_high_warn_v:
        lines.append(
            Line(
                WARNING,
                str(joint),
                f"{voltage:.1f} V, wanted are {driver.voltage_low_warn_v:g} to "
                f"{driver.voltage_high_warn_v:g} V: check the supply and its cables",
            )
        )
    temperature = ct.PRESENT_TEMPERATURE.decode(reply.data, start)
    limit = min(driver.temperature_warn_c, ct.TEMPERATURE_LIMIT.decode(block, 0))
    if temperature >= limit:
        lines.append(Line(WARNING, str(joint), f"{temperature} degC: let it cool down"))
    return lines


def _of_robot(
    config: Config, joints: tuple[JointSetup, ...], found: Inspection, rate: int
) -> list[Line]:
    lines = []
    driver = config.bus_driver
    of_id = {
        joint.servo_id: servo_info(joint, block)
        for joint, block in zip(joints, found.blocks, strict=True)
        if block is not None
    }
    infos = list(of_id.values())
    shortest = cycle_duration(infos, rate)
    if infos and shortest > _READ_SHARE / driver.rate_hz:
        lines.append(
            Line(
                WARNING,
                "bus",
                f"a cycle takes {1e3 * shortest:.1f} ms at least, too long for rate_hz = "
                f"{driver.rate_hz:g}: `ax12 configure --return-delay 0`, or lower rate_hz",
            )
        )
    versions = sorted({info.firmware for info in infos})
    if len(versions) > 1:
        of = {v: [str(i) for i, info in of_id.items() if info.firmware == v] for v in versions}
        text = "; ".join(f"{v}: id {', '.join(ids)}" for v, ids in of.items())
        lines.append(
            Line(ADVICE, "bus", f"firmware differs ({text}): servos may differ in what they do")
        )
    start = config.robot.start_joint_angles_rad
    for name, torque in zip(
        config.robot.joint_names, holding_torques(config.robot, start), strict=True
    ):
        if math.fabs(torque) > driver.torque_warn_n_m:
            lines.append(
                Line(
                    WARNING,
                    name,
                    f"carries {abs(torque):.2f} N m in the start posture, an AX-12 should carry "
                    f"{driver.torque_warn_n_m:g} N m for long",
                )
            )
    return lines
