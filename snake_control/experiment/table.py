"""The summary of an experiment as a table for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from snake_control.experiment.series import HEAD_COMPONENTS, HEAD_UNITS
from snake_control.experiment.summary import SETTLED_FROM_S


def format_summary(summary: Mapping[str, Any]) -> str:
    """Return the most important lines of a summary, aligned, for a terminal 80 characters wide."""
    lines = [
        _line("case", str(summary["case"])),
        _line("ended", summary["ended"]),
        _line("duration", _number(summary["duration_s"], "s", 1)),
        _line("fell", _fell(summary)),
        "",
        *_tracking(summary),
        "",
        _line("min d_min", _at(_number(summary["min_d_min_m"], "mm", 1, 1e3), summary, "d_min")),
        _line("min V_b1", _at(_exponential(summary["min_V_b1"]), summary, "V_b1")),
        _line("  of its start", _number(summary["min_V_b1_over_start"], "%", 2, 100.0)),
        _line("singular shape", _singular(summary)),
        *_limits(summary["limits"]),
        *_control(summary["control"]),
        *_bus(summary["bus"]),
        *_memory(summary.get("memory")),
        *_processor(summary.get("processor")),
    ]
    return "\n".join(lines)


def _tracking(summary: Mapping[str, Any]) -> list[str]:
    from_40 = f"from_{SETTLED_FROM_S:.0f}_s"
    rows = (
        ("rms", summary["tracking_error_rms"]),
        ("final", summary["tracking_error_final"]),
        (f"max from {SETTLED_FROM_S:.0f} s", summary[f"tracking_error_max_{from_40}"]),
        ("off exp(-K t)", summary[f"error_from_exponential_max_{from_40}"]),
    )
    header = "".join(
        f"{f'{name} [mm]' if unit == 'm' else f'{name} [rad]':>10}"
        for name, unit in zip(HEAD_COMPONENTS, HEAD_UNITS, strict=True)
    )
    lines = [f"{'tracking error':18}{header}"]
    for label, values in rows:
        cells = ""
        for name, unit in zip(HEAD_COMPONENTS, HEAD_UNITS, strict=True):
            value = values.get(f"{name}_{unit}")
            scale, digits = (1e3, 2) if unit == "m" else (1.0, 4)
            cells += f"{'' if value is None else f'{scale * value:.{digits}f}':>10}"
        lines.append(f"  {label:16}{cells}")
    return lines


def _limits(limits: Mapping[str, Any]) -> list[str]:
    joint = limits["first_joint_at_range_end"]
    if joint is None:
        reached = "none"
    else:
        when = _number(limits["first_joint_at_range_end_at_s"], "s", 1)
        reached = f"joint_{joint} first, at {when}; {limits['joint_limit_steps']} steps in all"
    return [
        _line("joint range ends", reached),
        _line("speed limit", f"{limits['speed_limit_steps']} steps scaled"),
    ]


def _control(control: Mapping[str, Any]) -> list[str]:
    return [
        _line(
            "control loop",
            f"{_number(control['rate_hz'], 'Hz', 2)}; period p50 "
            f"{_number(control['period_p50_s'], 'ms', 2, 1e3)}, "
            f"p99 {_number(control['period_p99_s'], 'ms', 2, 1e3)}",
        )
    ]


def _bus(bus: Mapping[str, Any] | None) -> list[str]:
    if bus is None:
        return []
    lost = ", ".join(f"joint_{joint}" for joint in bus["servos_lost_joints"]) or "none"
    return [
        _line(
            "bus",
            f"{_number(bus['rate_hz'], 'Hz', 2)}; cycle p50 "
            f"{_number(bus['cycle_time_p50_s'], 'ms', 2, 1e3)}, "
            f"p99 {_number(bus['cycle_time_p99_s'], 'ms', 2, 1e3)}",
        ),
        _line(
            "  missed replies",
            f"{bus['missed_replies']} of {bus['replies'] + bus['missed_replies']} "
            f"({_number(bus['missed_replies_fraction'], '%', 3, 100.0)}); "
            f"retries {bus['retries']}, corrupt {bus['corrupt_replies']}",
        ),
        _line("  servos lost", lost),
    ]


def _memory(memory: Mapping[str, Any] | None) -> list[str]:
    if not memory:
        return []
    name, most = max(memory.items(), key=lambda item: float(item[1]["growth_bytes"]))
    growth = _number(most["growth_bytes"], "MB", 2, 1e-6)
    return [_line("memory", f"grew most in {name}: {growth} after the first 20 s")]


def _processor(processor: Mapping[str, float] | None) -> list[str]:
    if not processor:
        return []
    name, most = max(processor.items(), key=lambda item: item[1])
    total = _number(sum(processor.values()), "% of one core", 0, 100.0)
    mock = processor.get("mock_bus")
    of_it = "" if mock is None else f" (the mock {_number(mock, '%', 0, 100.0)})"
    return [_line("processor", f"{total}{of_it}; {name} {_number(most, '%', 0, 100.0)}")]


def _fell(summary: Mapping[str, Any]) -> str:
    return f"at {_number(summary['fell_at_s'], 's', 1)}" if summary["fell"] else "no"


def _singular(summary: Mapping[str, Any]) -> str:
    nearness = summary["max_singular_nearness"]
    if nearness is None:
        return "-"
    text = _at(
        f"nearness up to {nearness:.3f} ({summary['max_singular_nearness_shape']})",
        summary,
        "singular_nearness",
        "max",
    )
    since = summary["singular_at_s"]
    return text if since is None else f"{text}; singular from {since:.1f} s"


def _line(name: str, value: str) -> str:
    return f"{name:20}{value}"


def _number(value: float | None, unit: str, digits: int, scale: float = 1.0) -> str:
    return "-" if value is None else f"{scale * value:.{digits}f} {unit}"


def _exponential(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _at(text: str, summary: Mapping[str, Any], name: str, extreme: str = "min") -> str:
    when = summary[f"{extreme}_{name}_at_s"]
    return text if when is None else f"{text} at {when:.1f} s"
