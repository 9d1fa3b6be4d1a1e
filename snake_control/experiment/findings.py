"""What the paper states about its three cases, each set against what came out here.

Every statement is judged by numbers of the recorded series; nothing is known beforehand. What a
run cannot show (a case that was not run, a run too short) is not shown, and said to be so.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from snake_control.config import RobotConfig
from snake_control.experiment.cases import CASES
from snake_control.experiment.facts import END_S, RUN_IN_S, SINGULAR_SHARE, WINDOW_S, Facts
from snake_control.experiment.summary import finite

_LEFT_BEHIND_M = 0.010
_TRACKED_M, _TRACKED_RAD = 0.005, 0.02
_STEADY_M = 0.001
_OSCILLATES_RAD, _EXPLAINED = 0.05, 0.5
_OTHER_SHAPE = 0.1
_SAME_HEAD = 0.02
_PAPER_FELL_S = {1: 24.8, 2: 45.7}


class Verdict(enum.Enum):
    """How a run compares with a statement of the paper."""

    AS_IN_PAPER = "as in the paper"
    DIFFERS = "differs"
    NOT_SHOWN = "not shown"


@dataclasses.dataclass(frozen=True)
class Finding:
    """One statement and what became of it.

    Attributes:
        cases: the cases it is about.
        paper: what the paper states, with its figure or section.
        found: what came out, in words with numbers.
        verdict: how the two compare.
        numbers: the figures behind the verdict, units in their names.
        why: for what differs, what is known about the reason.
    """

    cases: tuple[int, ...]
    paper: str
    found: str
    verdict: Verdict
    numbers: Mapping[str, Any]
    why: str = ""


def findings(runs: Mapping[int, Facts]) -> list[Finding]:
    """Judge every statement by the runs there are.

    What the paper states about its own robot (when it fell, how its joints swung) is one finding
    together for another robot: none of it applies.

    Args:
        runs: facts of a run for each case that was run.
    """
    robots = [facts.run.config.robot for facts in runs.values()]
    if all(map(is_papers_robot, robots)):
        return [statement.judge(runs) for statement in _STATEMENTS]
    planar = any(robot.planar for robot in robots)
    left = [s for s in _STATEMENTS if not (s.of_its_robot or (planar and s.needs_head))]
    found = (
        f"Not this robot: {len(_STATEMENTS) - len(left)} of {len(_STATEMENTS)} statements, about "
        "when the paper's robot fell and how its joints and its head moved, do not apply."
    )
    apart = Finding(CASES, "What the paper saw on its own robot.", found, Verdict.NOT_SHOWN, {})
    return [*(statement.judge(runs) for statement in left), apart]


def is_papers_robot(robot: RobotConfig) -> bool:
    """Whether a robot has the paper's links, axes and SCPs."""
    paper = RobotConfig()
    names = ("links", "head_links", "wheelless_links", "head_scp_joints", "joint_axes")
    return all(getattr(robot, name) == getattr(paper, name) for name in names)


def as_json(found: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return findings ready for JSON."""
    return [
        {
            "cases": list(finding.cases),
            "paper": finding.paper,
            "found": finding.found,
            "verdict": finding.verdict.value,
            "numbers": finite(finding.numbers),
            "why": finding.why,
        }
        for finding in found
    ]


# Whether the statement holds, what came out, its numbers, and why if it does not; or only why this
# robot cannot show it.
_Judged = tuple[bool, str, dict[str, Any], str] | str


@dataclasses.dataclass(frozen=True)
class _Statement:
    judge: Callable[[Mapping[int, Facts]], Finding]
    of_its_robot: bool
    needs_head: bool


_STATEMENTS: list[_Statement] = []


def _statement(
    cases: tuple[int, ...],
    paper: str,
    window: bool = False,
    of_its_robot: bool = False,
    needs_head: bool = False,
    refuted_after_s: float = 0.0,
    shown_after_s: float = 0.0,
) -> Callable[[Callable[..., _Judged]], Callable[..., _Judged]]:
    """Register a judge of one statement.

    Args:
        cases: whose facts the judge gets, in this order.
        paper: the statement.
        window: whether it needs enough of ``WINDOW_S``.
        of_its_robot: whether it is about the paper's robot alone.
        needs_head: whether it is about the raised head part.
        refuted_after_s: a run that ends before this time cannot refute it [s].
        shown_after_s: a run that ends before this time cannot confirm it [s].
    """

    def register(judge: Callable[..., _Judged]) -> Callable[..., _Judged]:
        def statement(runs: Mapping[int, Facts]) -> Finding:
            lacking = _lacking(runs, cases, window)
            if lacking:
                return Finding(cases, paper, lacking, Verdict.NOT_SHOWN, {})
            judged = judge(*(runs[case] for case in cases))
            if isinstance(judged, str):
                return Finding(cases, paper, judged, Verdict.NOT_SHOWN, {})
            holds, found, numbers, why = judged
            end_s = min(runs[case].end_s for case in cases)
            if end_s < (shown_after_s if holds else refuted_after_s):
                found = f"{found} The run ended at {end_s:.1f} s."
                return Finding(cases, paper, found, Verdict.NOT_SHOWN, numbers)
            verdict = Verdict.AS_IN_PAPER if holds else Verdict.DIFFERS
            return Finding(cases, paper, found, verdict, numbers, "" if holds else why)

        _STATEMENTS.append(_Statement(statement, of_its_robot, needs_head))
        return judge

    return register


def _lacking(runs: Mapping[int, Facts], cases: tuple[int, ...], window: bool) -> str:
    missing = [case for case in cases if case not in runs]
    if missing:
        return f"{_cases(missing)} {'was' if len(missing) == 1 else 'were'} not run."
    if window:
        short = [case for case in cases if not runs[case].has_window]
        if short:
            return (
                f"{_cases(short)} ended too soon: this is judged over "
                f"{WINDOW_S[0]:.0f} to {WINDOW_S[1]:.0f} s."
            )
    return ""


def _cases(numbers: Sequence[int]) -> str:
    """Return "Case 1", "Cases 1 and 2", "Cases 1, 2 and 3"."""
    *first, last = map(str, numbers)
    return f"Cases {', '.join(first)} and {last}" if first else f"Case {last}"


@_statement(
    (1,),
    "V_b1 became zero: the robot turned singular before it fell at 24.8 s (Fig. 14).",
    refuted_after_s=31.0,
    of_its_robot=True,
)
def _turns_singular(facts: Facts) -> _Judged:
    at = facts.singular_at_s
    share = facts.least_V_b1_share
    course = ", ".join(
        f"{facts.V_b1_at(t):.1e} at {t:.0f} s" for t in (0, 10, 20, 30, 60) if t <= facts.end_s
    )
    fell = "never fell" if at is None else f"fell at {at:.1f} s"
    found = (
        f"V_b1 {fell} below {SINGULAR_SHARE:.0%} of its start and came down to {share:.2g} of it: "
        f"{course}. The nearness of a singular shape (0 to 1, Fig. 5) rose to {facts.nearness}."
    )
    numbers = {
        "below_2_percent_at_s": at,
        "min_V_b1_over_start": share,
        "max_singular_nearness": facts.run.summary["max_singular_nearness"],
    }
    return at is not None, found, numbers, "The run ended before, or the SCPs were not still."


@_statement(
    (1,), "x_h therefore left its target (Fig. 8).", refuted_after_s=31.0, of_its_robot=True
)
def _left_behind(facts: Facts) -> _Judged:
    error = float(facts.off_law[0])
    found = (
        f"Over the last {END_S:.0f} s x_h was up to {_mm(error)} off the error that {facts.law} "
        f"promises ({_LEFT_BEHIND_M * 1e3:.0f} mm or more would count as left)."
    )
    why = (
        "In a singular posture the wheels no longer tell how far the robot rolls (A_hat loses "
        "rank), so that the smallest slip carries the head off. Here the wheels slip by "
        f"{1e3 * facts.largest_slip:.2g} mm/s at most; the largest joint "
        f"angle is {facts.largest_angle:.2f} rad (an AX-12 ends at 2.62)."
    )
    return error >= _LEFT_BEHIND_M, found, {"x_h_error_max_m": error}, why


def _fall(facts: Facts, case: int) -> tuple[bool, str, dict[str, Any], str]:
    at = facts.fell_at_s
    least = int(np.nanargmin(facts.d_min))
    margin, margin_at = float(facts.d_min[least]), float(facts.t[least])
    fell = "did not fall" if at is None else f"fell at {at:.1f} s"
    found = f"The robot {fell}; the smallest d_min was {_mm(margin)}, at {margin_at:.1f} s."
    why = (
        "Nothing shakes here and no joint has play: the robot falls only when P_G leaves the "
        f"support polygon. The hardware fell at {_PAPER_FELL_S[case]} s with d_min near zero."
    )
    numbers = {"fell_at_s": at, "min_d_min_m": margin, "min_d_min_at_s": margin_at}
    return at is not None, found, numbers, why


@_statement((1,), "The robot fell at 24.8 s (Fig. 14).", refuted_after_s=24.8, of_its_robot=True)
def _case_1_falls(facts: Facts) -> _Judged:
    return _fall(facts, 1)


@_statement(
    (2,),
    "V_b1 did not go to zero: the robot avoided the singularity (Fig. 14).",
    shown_after_s=45.0,
)
def _avoids_singularity(facts: Facts) -> _Judged:
    share = facts.least_V_b1_share
    found = (
        f"V_b1 stayed above {share:.2g} of its start (smallest {np.nanmin(facts.V_b1):.1e}); the "
        f"nearness of a singular shape rose to {facts.nearness}."
    )
    return facts.singular_at_s is None, found, {"min_V_b1_over_start": share}, ""


@_statement(
    (1, 2), "The SCPs vibrated periodically though nobody gave them a wave (Fig. 13).", window=True
)
def _scps_oscillate(still: Facts, facts: Facts) -> _Judged:
    joints = facts.run.config.robot.base_scp_joints
    if not joints:
        return "This robot has no B-SCP."
    numbers: dict[str, Any] = {}
    found, moving = [], []
    for joint in joints:
        o = facts.oscillation_of(joint)
        moving.append(
            o.peak_to_peak > _OSCILLATES_RAD and o.turns >= 2 and o.explained > _EXPLAINED
        )
        numbers |= {
            f"phi_{joint}_peak_to_peak_rad": o.peak_to_peak,
            f"phi_{joint}_period_s": o.period_s,
            f"phi_{joint}_explained_by_sine": o.explained,
        }
        period = "no period" if o.period_s is None else f"period {o.period_s:.1f} s"
        found.append(f"phi_{joint} {o.peak_to_peak:.2f} rad peak to peak, {period}")
    rest = max(still.oscillation_of(joint).peak_to_peak for joint in joints)
    numbers["largest_in_case_1_rad"] = rest
    return (
        all(moving),
        f"{'; '.join(found)}. In Case 1 the same joints moved by {rest:.2g} rad.",
        numbers,
        "The sub-tasks found a posture to rest in, or move without a period.",
    )


@_statement(
    (2,), "The wave grows towards the tail: phi_7 < phi_9 < phi_11.", window=True, of_its_robot=True
)
def _grows_towards_tail(facts: Facts) -> _Judged:
    sizes = _base_sizes(facts)
    found = " < ".join(f"{size:.2f}" for size in sizes.values())
    rising = all(
        a < b for a, b in zip(list(sizes.values()), list(sizes.values())[1:], strict=False)
    )
    if not rising:
        found = ", ".join(f"{size:.2f}" for size in sizes.values())
    names = ", ".join(f"phi_{joint}" for joint in sizes)
    numbers = {f"phi_{joint}_peak_to_peak_rad": size for joint, size in sizes.items()}
    return rising, f"Peak to peak of {names}: {found} rad.", numbers, ""


def _tracking(facts: Facts) -> _Judged:
    position = facts.error_at_end[:3]
    off = facts.off_law[3:]
    found = (
        f"Over the last {END_S:.0f} s x, y, z were within {', '.join(map(_mm, position))}, and "
        f"R, P, Y within {off.max():.4f} rad of what {facts.law} promises."
    )
    numbers = {
        "position_error_max_m": position.tolist(),
        "off_law_max_rad": off.tolist(),
    }
    holds = bool(position.max() < _TRACKED_M and off.max() < _TRACKED_RAD)
    return holds, found, numbers, ""


@_statement((2,), "w tracked its target until the robot fell (Fig. 9).", window=True)
def _case_2_tracks(facts: Facts) -> _Judged:
    return _tracking(facts)


@_statement(
    (2,), "V_h increased, the sub-task of the H-SCP (Fig. 13).", window=True, needs_head=True
)
def _case_2_V_h(facts: Facts) -> _Judged:
    growth = facts.V_h_growth
    found = (
        f"From {facts.V_h[0]:.2e} to {growth:.2f} times that (median; largest "
        f"{facts.V_h.max():.2e}). In the end it is what the wanted pose of the head allows."
    )
    return growth > 1.0, found, {"V_h_over_start": growth}, ""


@_statement(
    (2,),
    "V_b2 = d_min went down to almost zero and the robot fell at 45.7 s (Fig. 14).",
    refuted_after_s=45.7,
    of_its_robot=True,
)
def _case_2_falls(facts: Facts) -> _Judged:
    return _fall(facts, 2)


@_statement((3,), "The robot did not fall (Fig. 14).", shown_after_s=45.0)
def _case_3_stands(facts: Facts) -> _Judged:
    fell, found, numbers, _ = _fall(facts, 1)
    return not fell, found, numbers, "P_G left the support polygon."


@_statement((2, 3), "V_b2 = d_min is larger than in Case 2 (Fig. 14).", window=True)
def _case_3_margin(two: Facts, three: Facts) -> _Judged:
    median = [facts.d_min_percentile(50) for facts in (two, three)]
    tenth = [facts.d_min_percentile(10) for facts in (two, three)]
    found = (
        f"Median {_mm(median[0])} in Case 2, {_mm(median[1])} in Case 3; lowest tenth "
        f"{_mm(tenth[0])} and {_mm(tenth[1])}."
    )
    numbers = {
        "case_2_median_m": median[0],
        "case_3_median_m": median[1],
        "case_2_lowest_tenth_m": tenth[0],
        "case_3_lowest_tenth_m": tenth[1],
    }
    return median[1] > median[0] and tenth[1] > tenth[0], found, numbers, ""


@_statement((3,), "V_h and V_b1 increased (Figs. 13, 14).", window=True, needs_head=True)
def _case_3_costs(facts: Facts) -> _Judged:
    V_b1 = facts.V_b1_median / float(facts.V_b1[0])
    found = f"V_h to {facts.V_h_growth:.2f} and V_b1 to {V_b1:.2f} times its start (medians)."
    numbers = {"V_h_over_start": facts.V_h_growth, "V_b1_over_start": V_b1}
    return facts.V_h_growth > 1.0 and V_b1 > 1.0, found, numbers, ""


@_statement((3,), "All of w but y_h tracked its target (Fig. 10).", window=True)
def _case_3_tracks(facts: Facts) -> _Judged:
    return _tracking(facts)


@_statement((3,), "A small steady error in y_h remained (Fig. 10).", window=True, of_its_robot=True)
def _steady_y_error(facts: Facts) -> _Judged:
    mean = float(facts.mean_error_at_end[1])
    found = (
        f"The mean error of y_h over the last {END_S:.0f} s is {1e3 * mean:+.2f} mm, the largest "
        f"{_mm(float(facts.error_at_end[1]))}."
    )
    why = (
        "The authors blame the wheels' sideslip. Here wheels slip only as far as the joint "
        f"velocities contradict each other: {1e3 * facts.usual_slip:.2f} mm/s (root mean square)."
    )
    return abs(mean) >= _STEADY_M, found, {"y_h_mean_error_m": mean}, why


@_statement(
    (1, 2, 3), "The joint velocities of Case 3 were larger than the others' (Fig. 11).", window=True
)
def _case_3_fastest(one: Facts, two: Facts, three: Facts) -> _Judged:
    peaks = [float(np.abs(f.u[f.t >= RUN_IN_S]).max()) for f in (one, two, three)]
    usual = [f.usual_speed for f in (one, two, three)]
    found = (
        f"Largest after the first {RUN_IN_S:.0f} s: {_list(peaks)} rad/s in Cases 1, 2, 3. Root "
        f"mean square over 25 to 60 s: {_list(usual)} rad/s."
    )
    numbers = {"largest_rad_s": peaks, "root_mean_square_rad_s": usual}
    return peaks[2] > max(peaks[:2]), found, numbers, ""


@_statement((2, 3), "The motion of Case 3 differs from that of Case 2 (Section 5).", window=True)
def _other_motion(two: Facts, three: Facts) -> _Judged:
    sizes = _base_sizes(two), _base_sizes(three)
    change = max(abs(sizes[1][j] - sizes[0][j]) / max(sizes[0][j], 1e-9) for j in sizes[0])
    names = ", ".join(f"phi_{joint}" for joint in sizes[0])
    found = (
        f"Peak to peak of {names}: {_list(sizes[0].values())} rad in Case 2, "
        f"{_list(sizes[1].values())} rad in Case 3."
    )
    numbers = {"largest_relative_change": change}
    return change > _OTHER_SHAPE, found, numbers, ""


@_statement(
    (2, 3),
    "The motion of the B-SCPs does not affect the head part (Sections 2, 6).",
    needs_head=True,
)
def _head_unaffected(two: Facts, three: Facts) -> _Judged:
    n_h = two.run.config.robot.head_links
    steps = min(len(two.t), len(three.t))
    heads = two.phi[:steps, :n_h], three.phi[:steps, :n_h]
    most = float(np.abs(heads[0] - heads[1]).max(initial=0.0))
    way = float(np.ptp(heads[0], axis=0).max(initial=0.0))
    found = (
        f"The joints of the head part moved by up to {way:.2f} rad and ran alike in Cases 2 and 3, "
        f"whose B-SCPs move differently: they are {most:.1e} rad apart at most."
    )
    why = (
        "Speed limits scale all joints together, and the two cases meet them at different times; "
        "slipping wheels move the head, too."
    )
    numbers = {"largest_difference_rad": most, "peak_to_peak_rad": way}
    return most < _SAME_HEAD * way, found, numbers, why


def _base_sizes(facts: Facts) -> dict[int, float]:
    """Peak to peak of the base joints that are no SCPs."""
    robot = facts.run.config.robot
    joints = range(robot.head_links + 1, robot.joints + 1)
    others = [joint for joint in joints if joint not in robot.scp_joints]
    return {joint: facts.oscillation_of(joint).peak_to_peak for joint in others}


def _mm(value: float) -> str:
    return f"{1e3 * value:.1f} mm"


def _list(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.2f}" for value in values)
