"""Judges one scenario from what was recorded; pure functions, no clock, no ROS."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faults.scenario import Expect, Scenario
from snake_control.config import Config

Array = NDArray[np.float64]

TICK = math.radians(300.0 / 1023.0)
AT_REST_RAD_S = 0.03
ACCELERATION_RAD_S2 = 60.0
OVERLOAD_S = 2.0

MEASURED_WITHIN_S = 0.06
"""Ground truth comes every 20 ms, from a body that moves in steps of 10 ms; the fault begins
between two of them, and the clocks of three processes meet here."""

_LATE_S = 0.4

_MOVING, _STOPPED, _EMERGENCY = 2, 4, 5


@dataclasses.dataclass(frozen=True)
class Record:
    """What was seen of a scenario; times on one clock [s].

    Attributes:
        fault_at: when the fault was in force.
        until: end of the time in which it was watched.
        time, phi, phi_dot: ground truth, (k,), (k, joints), (k, joints).
        states: time, state and all texts of each bus_state.
        speed: largest commanded speed before the fault, of each joint [rad/s].
        died: processes that ended though nobody ended them.
    """

    fault_at: float
    until: float
    time: Array
    phi: Array
    phi_dot: Array
    states: Sequence[tuple[float, int, str]]
    speed: Array
    died: Sequence[str] = ()


@dataclasses.dataclass
class Outcome:
    """What came out.

    Attributes:
        did: what the driver said.
        stop_s: from the fault to rest; NaN if the robot did not stop.
        travel: largest travel of a joint that is under torque, from the fault (faulty joints) or
            from the stop (the others) on [rad].
        recovered: what brought motion back; empty if nothing had to, "no" if nothing did.
        violations: what must not be.
        stalled_s: how long the simulated robot stood still in the time that was watched [s].
        timeline: what was heard around the fault, for whoever looks for the cause of a violation.
    """

    did: str = ""
    stop_s: float = math.nan
    travel: float = math.nan
    recovered: str = ""
    violations: list[str] = dataclasses.field(default_factory=list)
    stalled_s: float = 0.0
    timeline: list[str] = dataclasses.field(default_factory=list)

    def __str__(self) -> str:
        """Violations with all that was heard, or that there are none."""
        return "\n".join([*self.violations, *self.timeline]) if self.violations else "holds"


def stalled(record: Record) -> float:
    """Return how long the simulated robot stood still in the time that was watched [s].

    The mock leaves out most of the time in which its machine withholds the processor: a record with
    such a gap is of no robot.
    """
    watched = record.time[record.time >= record.fault_at]
    return float(np.diff(watched, prepend=record.fault_at, append=record.until).max())


def timeouts(config: Config) -> dict[str, float]:
    """Return the time-outs that scenarios name [s]."""
    driver, controller = config.bus_driver, config.scp_controller
    period = 1.0 / driver.rate_hz
    joints = len(config.servos.ids)
    return {
        "none": 0.0,
        "command": driver.command_timeout_s,
        # Believed last just before the fault, in the cycle after the time-out found missing.
        "feedback": driver.unheard_timeout_s + 2 * period,
        # Two replies in a row with the alarm.
        "alarm": 2 * period,
        "overload": OVERLOAD_S + 2 * period,
        # One servo's settings every 0.1 s.
        "settings": 0.1 * (joints + 1),
        "settings_of_all": 0.1 + period,
        # A window under way may hold motion from before the fault.
        "follow": 2 * driver.follow_timeout_s + period,
        "head": controller.head_timeout_s + driver.command_timeout_s,
        "reference": controller.reference_timeout_s + driver.command_timeout_s,
    }


def look_ahead_bound(config: Config, speed: Array) -> Array:
    """Return how far each joint may run when no command reaches it any more [rad]."""
    servos, driver = config.servos, config.bus_driver
    compliance = np.array(servos.compliance_margin_ticks) + np.array(servos.compliance_slope)
    # Moving Speed is whole units: a fraction of one is dithered to the next above.
    unit = 0.111 * math.tau / 60.0
    late = 1.0 / driver.rate_hz + MEASURED_WITHIN_S
    return (compliance + 3) * TICK + (speed + unit) * (driver.look_ahead_s + late)


def judge(scenario: Scenario, record: Record, config: Config) -> Outcome:
    """Return the outcome with every criterion that does not hold."""
    outcome = Outcome(stalled_s=stalled(record), timeline=_timeline(record))
    wrong = outcome.violations
    wrong += [f"{name} died" for name in record.died]
    _check_ranges(scenario, record, config, wrong)
    after = [(t, state, text) for t, state, text in record.states if t >= record.fault_at]
    if scenario.reported:
        said = next((text for _, _, text in after if re.search(scenario.reported, text)), None)
        if said is None:
            wrong.append(f"not reported: nothing like {scenario.reported!r}")
    stops = [
        (t, text)
        for t, state, text in after
        if state in (_STOPPED, _EMERGENCY) and t <= record.until
    ]
    outcome.did = _did(scenario, after, stops)
    if scenario.expect is Expect.STOPS and not stops:
        wrong.append("did not stop")
    if scenario.expect in (Expect.GOES_ON, Expect.RESTS) and stops:
        wrong.append(f"stopped: {stops[0][1]}")
    if scenario.expect is Expect.GOES_ON and scenario.situation == "motion":
        _check_motion(record, wrong)
    _check_rest(scenario, record, config, outcome, bool(stops))
    _check_travel(scenario, record, config, outcome, stops[0][0] if stops else None)
    return outcome


def _timeline(record: Record) -> list[str]:
    """One line for each new text and state, and the time of the last motion of each joint."""
    lines = []
    said: dict[bool, str] = {}
    for t, state, text in record.states:
        driver = state >= 0
        words = f"{state} {text.split(' | ')[0]}" if driver else text
        if t >= record.fault_at - 0.1 and said.get(driver) != words:
            said[driver] = words
            who = "driver" if driver else "controller"
            lines.append(f"{t - record.fault_at:+.3f} s {who}: {words}")
    moving = np.abs(record.phi_dot) > AT_REST_RAD_S
    for i in range(moving.shape[1]):
        if moving[:, i].any():
            last = record.time[moving[:, i]][-1] - record.fault_at
            lines.append(f"{last:+.3f} s joint_{i + 1} moved last")
    return [*lines, f"simulated time stood still for at most {stalled(record):.3f} s"]


def _did(
    scenario: Scenario,
    after: Sequence[tuple[float, int, str]],
    stops: Sequence[tuple[float, str]],
) -> str:
    if stops:
        return stops[0][1].split(" | ")[0]
    if scenario.reported:
        for _, _, text in after:
            if re.search(scenario.reported, text):
                return text
    states = [text.split(" | ")[0] for _, _, text in after]
    return states[-1] if states else ""


def _check_motion(record: Record, wrong: list[str]) -> None:
    """Whether the driver still executes commands at the end, and the joints they are for move."""
    states = [(state, text) for t, state, text in record.states if state >= 0 and t <= record.until]
    if not states or states[-1][0] != _MOVING:
        wrong.append(f"does not go on: {states[-1][1] if states else 'nothing heard'}")
    late = record.time > record.until - _LATE_S
    moved = np.abs(record.phi_dot[late]).max(axis=0, initial=0.0)
    still = (record.speed > AT_REST_RAD_S) & (moved < AT_REST_RAD_S)
    wrong += [f"joint_{i + 1} does not go on" for i in np.flatnonzero(still)]


def _check_ranges(scenario: Scenario, record: Record, config: Config, wrong: list[str]) -> None:
    for i, servo_id in enumerate(config.servos.ids):
        lower, upper = config.robot.joint_range(i + 1)
        lowest, highest = record.phi[:, i].min(), record.phi[:, i].max()
        if servo_id not in scenario.limp and not (lower <= lowest and highest <= upper):
            wrong.append(f"joint_{i + 1} left its range: {lowest:.3f}..{highest:.3f} rad")


def _led(scenario: Scenario, config: Config) -> NDArray[np.bool_]:
    """Which joints commands still reach."""
    out = set(scenario.limp) | set(scenario.faulty)
    if scenario.line_dead:
        out |= set(config.servos.ids)
    return np.array([servo_id not in out for servo_id in config.servos.ids])


def _check_rest(
    scenario: Scenario, record: Record, config: Config, outcome: Outcome, stopped: bool
) -> None:
    """Whether all joints with torque came to rest, in time where a command can bring that about."""
    if scenario.expect in (Expect.GOES_ON, Expect.SAFE) and not stopped:
        return
    limp = np.array([servo_id in scenario.limp for servo_id in config.servos.ids])
    until = record.until
    if scenario.expect is Expect.RESTS and scenario.duration:
        until = min(until, record.fault_at + scenario.duration)
    watched = (record.time >= record.fault_at) & (record.time <= until)
    time = record.time[watched]
    speed = np.abs(record.phi_dot[watched])

    def rest_at(chosen: NDArray[np.bool_]) -> float:
        moving = time[(speed[:, chosen] > AT_REST_RAD_S).any(axis=1)] if chosen.any() else time[:0]
        return float(moving[-1]) - record.fault_at if len(moving) else 0.0

    outcome.stop_s = rest_at(~limp)
    if len(time) and outcome.stop_s > time[-1] - record.fault_at - 0.1:
        outcome.violations.append("never came to rest")
        return
    led = _led(scenario, config)
    if scenario.expect not in (Expect.STOPS, Expect.RESTS) or not led.any():
        return
    bound = (
        timeouts(config)[scenario.timeout]
        + 2.0 / config.bus_driver.rate_hz
        + float(record.speed.max()) / ACCELERATION_RAD_S2
        + MEASURED_WITHIN_S
    )
    took = rest_at(led)
    if took > bound:
        outcome.violations.append(f"rest after {took:.2f} s, allowed {bound:.2f} s")


def _check_travel(
    scenario: Scenario, record: Record, config: Config, outcome: Outcome, stop_at: float | None
) -> None:
    led = _led(scenario, config)
    limp = np.array([servo_id in scenario.limp for servo_id in config.servos.ids])
    bound = look_ahead_bound(config, record.speed)
    largest = 0.0
    for i in range(len(led)):
        start = record.fault_at
        if limp[i]:
            continue
        if led[i]:
            # A joint that commands reach moves as commanded until the robot is stopped.
            if stop_at is None:
                continue
            start = stop_at
        seen = (record.time >= start) & (record.time <= record.until)
        if not seen.any():
            continue
        phi = record.phi[seen, i]
        travel = float(np.abs(phi - phi[0]).max())
        largest = max(largest, travel)
        if travel > bound[i]:
            outcome.violations.append(
                f"joint_{i + 1} went {travel:.3f} rad, allowed {bound[i]:.3f} rad"
            )
    outcome.travel = largest
