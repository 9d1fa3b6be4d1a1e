"""One self-contained HTML page: the paper's statements against what came out."""

from __future__ import annotations

import base64
import dataclasses
import html
import importlib.resources
import io
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import jinja2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.style import context

from snake_control.config import RobotConfig
from snake_control.experiment import comparison, style
from snake_control.experiment.facts import END_S, RUN_IN_S, SINGULAR_SHARE, WINDOW_S, Facts
from snake_control.experiment.figures import CASE_NAMES
from snake_control.experiment.findings import Finding, Verdict, is_papers_robot
from snake_control.experiment.internal_motion import InternalMotion, describe
from snake_control.experiment.internal_motion import draw as draw_internal_motion
from snake_control.experiment.motion import motion
from snake_control.experiment.series import HEAD_COMPONENTS, Series
from snake_control.experiment.summary import software_versions

_TEMPLATE = "report.html.j2"
_DPI = 110
_UNKNOWN = "-"
_SYMBOL = re.compile(r"\b(phi|eta|V|N|P|d|w|x|y|z)_([A-Za-z]?[A-Za-z0-9]{0,3})\b")
_POWER = re.compile(r"(\d)e([+-]\d+)")
_PLURAL = {Verdict.DIFFERS: "differ"}
_GREEK = {"phi": "&phi;", "eta": "&eta;"}


@dataclasses.dataclass(frozen=True)
class Picture:
    """A figure of the report: its caption, and the image as a data URI."""

    caption: str
    source: str


@dataclasses.dataclass(frozen=True)
class Row:
    """A row of the table of figures: what, and a text for each case."""

    name: str
    values: Sequence[str]


def write_report(
    runs: Mapping[int, Facts],
    found: Sequence[Finding],
    internal: Sequence[InternalMotion],
    path: str | Path,
) -> None:
    """Write the report.

    Args:
        runs: facts of each case that was run, at least one.
        found: the paper's statements, judged.
        internal: internal motions of the robot, for the picture of (4)-(6); may be empty.
        path: the HTML file.

    Raises:
        OSError: it cannot be written.
    """
    any_run = next(iter(runs.values())).run
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["symbols"] = symbols
    template = importlib.resources.files(__package__).joinpath(_TEMPLATE).read_text("utf-8")
    text = environment.from_string(template).render(
        robot=_robot_words(any_run.config.robot),
        is_papers_robot=is_papers_robot(any_run.config.robot),
        how=_how(any_run.settings.parameters),
        runs=[
            (CASE_NAMES[case], facts.run.summary["ended"]) for case, facts in sorted(runs.items())
        ],
        counts=[(_PLURAL.get(v, v.value), sum(f.verdict is v for f in found)) for v in Verdict],
        findings=found,
        css_class={Verdict.AS_IN_PAPER: "same", Verdict.DIFFERS: "differs"},
        window=WINDOW_S,
        cases=[f"Case {case}" for case in sorted(runs)],
        rows=figures_of_merit([facts for _, facts in sorted(runs.items())]),
        pictures=_pictures(runs),
        internal=[describe(each) for each in internal],
        internal_picture=_internal_picture(internal, any_run.config.robot),
        parameters=any_run.summary["parameters"],
        software=software_versions(),
    )
    Path(path).write_text(text, encoding="utf-8")


def symbols(text: str) -> str:
    """Return ``text`` as HTML with the paper's symbols set as such: phi_7, V_b1, d_min, x_h.

    Powers of ten, too: 2.5e+08.
    """
    return _POWER.sub(_set_power, _SYMBOL.sub(_set_symbol, html.escape(text)))


def _set_symbol(match: re.Match[str]) -> str:
    name = _GREEK.get(match[1], match[1])
    return f"<i>{name}</i><sub>{match[2]}</sub>"


def _set_power(match: re.Match[str]) -> str:
    return f"{match[1]}&middot;10<sup>{int(match[2])}</sup>"


def figures_of_merit(runs: Sequence[Facts]) -> list[Row]:
    """Return the table of figures side by side, one text for each run."""
    robot = runs[0].run.config.robot
    window = f"{WINDOW_S[0]:.0f}..{WINDOW_S[1]:.0f} s"
    end = f"last {END_S:.0f} s"

    def row(name: str, value: Callable[[Facts], str], needs_window: bool = False) -> Row:
        texts = [_UNKNOWN if needs_window and not f.has_window else value(f) for f in runs]
        return Row(name, texts)

    rows = [
        row("fell", lambda f: "no" if f.fell_at_s is None else f"at {f.fell_at_s:.1f} s"),
        row("d_min, smallest", lambda f: _mm(f.d_min.min())),
        row(f"d_min, median {window}", lambda f: _mm(f.d_min_percentile(50)), True),
        row(f"d_min, lowest tenth {window}", lambda f: _mm(f.d_min_percentile(10)), True),
        row("V_b1, smallest", lambda f: f"{np.nanmin(f.V_b1):.2g}"),
        row(f"V_b1, median {window}", lambda f: f"{f.V_b1_median:.2g}", True),
        row(f"V_b1 below {SINGULAR_SHARE:.0%} of its start", _singular_text),
        row("nearness of a singular shape, largest", lambda f: f.nearness),
        row(f"V_h, median {window} over start", lambda f: f"{f.V_h_growth:.2f}", True),
    ]
    rows += [
        row(f"phi_{joint}, peak to peak {window}", _peak_to_peak(joint), True)
        for joint in range(robot.head_links + 1, robot.joints + 1)
    ]
    rows += [
        row(f"phi_{joint} (B-SCP), period", _period(joint), True) for joint in robot.base_scp_joints
    ]
    rows += [
        row(f"{name} error, largest {end}", _error(i)) for i, name in enumerate(HEAD_COMPONENTS)
    ]
    rows += [
        row("largest joint angle", lambda f: f"{f.largest_angle:.2f} rad"),
        row("largest joint speed", lambda f: f"{f.largest_speed:.2f} rad/s"),
        row("steps scaled to the speed limit", _scaled),
        row(
            f"wheel slip after {RUN_IN_S:.0f} s, largest",
            lambda f: f"{1e3 * f.largest_slip:.3g} mm/s",
        ),
    ]
    return rows


def _peak_to_peak(joint: int) -> Callable[[Facts], str]:
    return lambda facts: f"{facts.oscillation_of(joint).peak_to_peak:.2f} rad"


def _period(joint: int) -> Callable[[Facts], str]:
    def text(facts: Facts) -> str:
        period = facts.oscillation_of(joint).period_s
        return _UNKNOWN if period is None else f"{period:.1f} s"

    return text


def _error(component: int) -> Callable[[Facts], str]:
    def text(facts: Facts) -> str:
        value = float(facts.error_at_end[component])
        return _mm(value) if component < 3 else f"{value:.4f} rad"

    return text


def _singular_text(facts: Facts) -> str:
    return "never" if facts.singular_at_s is None else f"from {facts.singular_at_s:.1f} s"


def _scaled(facts: Facts) -> str:
    limits = facts.run.summary["limits"]
    return f"{limits['speed_limit_steps']} of {facts.run.summary['control']['steps']}"


def _mm(value: float) -> str:
    return f"{1e3 * value:.1f} mm"


def _pictures(runs: Mapping[int, Facts]) -> list[Picture]:
    series = {case: facts.run.series for case, facts in runs.items()}
    drawn: list[tuple[str, Callable[[], Figure]]] = [
        (
            "V_b1 and d_min (Fig. 14), and how near a singular shape of Fig. 5 is (0 to 1).",
            lambda: comparison.base_costs(series),
        ),
        ("SCPs and V_h (Fig. 13).", lambda: comparison.scps(series)),
        ("Dependent joint angles (Fig. 12).", lambda: comparison.theta_bar(series)),
        ("Joint velocities (Fig. 11).", lambda: comparison.joint_velocities(series)),
        ("Head pose w and its target w_d (Figs. 8 to 10).", lambda: comparison.head_poses(series)),
    ]
    for case, one in sorted(series.items()):
        drawn.append((f"Motion of the robot, {CASE_NAMES[case]} (Fig. 15).", _motion_of(one)))
    with context(style.RC):
        return [Picture(caption, data_uri(make())) for caption, make in drawn]


def _motion_of(series: Series) -> Callable[[], Figure]:
    return lambda: motion(series)


def _internal_picture(motions: Sequence[InternalMotion], robot: RobotConfig) -> str:
    if not motions:
        return ""
    with context(style.RC):
        return data_uri(draw_internal_motion(list(motions), robot))


def data_uri(figure: Figure) -> str:
    """Return a figure as a PNG in a data URI."""
    buffer = io.BytesIO()
    # Without the version of matplotlib, so that the same run gives the same bytes.
    figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def _robot_words(robot: RobotConfig) -> str:
    def words(numbers: Sequence[int]) -> str:
        return ", ".join(map(str, numbers)) or "none"

    return (
        f"{robot.links} links, {robot.head_links} of them raised; without wheels: "
        f"{words(robot.wheelless_links)}; H-SCP: {words(robot.head_scp_joints)}; "
        f"B-SCP: {words(robot.base_scp_joints)}"
    )


def _how(parameters: Mapping[str, object]) -> str:
    """Say how the runs were made: rate, servos, plant."""
    rate = f"{parameters['control_rate_hz']:g} control cycles a second"
    if parameters["controller"] == "torque":
        return (
            f"torque control (21), {rate}; joints take any torque at once. The body is made of "
            "rigid links on massless wheels that never slip and a floor that holds it"
        )
    if parameters["servos"] == "perfect":
        servos = "perfect servos: joints follow at once, without limits of speed or range"
    else:
        carried = "carried on" if parameters["carry_remainder"] else "lost"
        servos = (
            "limited servos: whole position ticks (0.29 degrees) and speed units (0.111 rpm, "
            f"remainder {carried}), limits of speed and range, one cycle of delay"
        )
    return (
        f"velocity control (22), {rate}; {servos}. The body is a chain on wheels without inertia; "
        "where joints and wheels contradict each other, least squares decide how the wheels slip"
    )
