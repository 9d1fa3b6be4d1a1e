"""Conditions 1 to 5 and the Assumptions of the paper that a configuration can break.

With no head links the robot is a planar snake, as in the paper's references [9, 10]: all links lie
on the floor and w is [x, y, Y]. The same reasons then give other conditions:

* Link 1 has no wheels. Its wheels would be a constraint row that no joint enters, so B_tilde would
  have no inverse (this stands in for Conditions 2, 3 and 5, which are about head joints).
* Condition 1 and Assumption 2 hold as they are: the tail has wheels, all joints are yaw.
* Condition 4, fewer controlled components than inputs, is 1 <= m and 3 + m < n - 1. Link 1 gives
  no B-SCP: no joint lies in front of it.
"""

from __future__ import annotations

from collections.abc import Sequence

from snake_control.errors import ConfigError


def check_conditions(
    links: int,
    head_links: int,
    wheelless_links: Sequence[int],
    head_scp_joints: Sequence[int],
    joint_axes: Sequence[str],
) -> None:
    """Check a robot's structure against the paper's Section 2.

    Args:
        links: n, number of links.
        head_links: n_h, number of links of the raised head part; 0 for a planar snake.
        wheelless_links: links of the base part without wheels, counted from the head, from 1.
        head_scp_joints: the n_h - 4 joints of the head part used as H-SCPs; none if planar.
        joint_axes: ``pitch`` or ``yaw`` for joints 1 .. n-1.

    Raises:
        ConfigError: names the Condition or Assumption, the value and what would satisfy it.
    """
    if head_links == 0:
        _check_planar(links, wheelless_links, head_scp_joints, joint_axes)
        return
    if head_links < 4:
        raise ConfigError(
            "robot.head_links",
            head_links,
            "Condition 5: at least 4 head links, or the head cannot take any position and "
            "attitude; or 0 for a planar snake",
        )
    if links < head_links + 2:
        raise ConfigError(
            "robot.links",
            links,
            f"the base needs at least two links behind the {head_links} of the head: "
            f"{head_links + 2} or more",
        )
    _check_axes(links, head_links, joint_axes)
    _check_wheelless(links, head_links, wheelless_links)
    _check_head_scps(head_links, head_scp_joints, joint_axes)
    _check_redundancy(links, head_links, wheelless_links)


def _check_planar(
    links: int,
    wheelless_links: Sequence[int],
    head_scp_joints: Sequence[int],
    joint_axes: Sequence[str],
) -> None:
    _check_axes(links, 0, joint_axes)
    if len(head_scp_joints):
        raise ConfigError(
            "robot.head_scp_joints",
            list(head_scp_joints),
            "a planar snake (robot.head_links = 0) has no H-SCPs: give [0]",
        )
    field = "robot.wheelless_links"
    given = list(wheelless_links)
    if 1 not in given:
        raise ConfigError(
            field,
            given,
            "full rank of B_tilde: link 1 of a planar snake must have no wheels, or no joint could "
            "turn the head",
        )
    _check_tail(links, given)
    _check_within(given, 1, links - 1)
    m = len(given) - 1
    if not 1 <= m < links - 4:
        raise ConfigError(
            field,
            given,
            f"Condition 4 of a planar snake: 1 <= m and 3 + m < n - 1 with m = wheelless links "
            f"without link 1; here m = {m} and n - 1 = {links - 1}, so the number of wheelless "
            f"links must be 2 to {links - 4}",
        )


def _check_redundancy(links: int, head_links: int, wheelless_links: Sequence[int]) -> None:
    m = head_links - 4 + len(wheelless_links)
    if 1 <= m < links - 7:
        return
    condition = "Condition 4: 1 <= m < n - 7 with m = (n_h - 4) + wheelless links"
    fewest, most = max(0, 5 - head_links), links - 8 - (head_links - 4)
    if most < fewest:
        raise ConfigError(
            "robot.links",
            links,
            f"{condition}: {head_links} head links need {fewest + head_links + 4} links or more",
        )
    raise ConfigError(
        "robot.wheelless_links",
        list(wheelless_links),
        f"{condition}; here m = {m} and n - 7 = {links - 7}, so the number of wheelless links must "
        f"be {fewest} to {most}",
    )


def _check_axes(links: int, head_links: int, joint_axes: Sequence[str]) -> None:
    field = "robot.joint_axes"
    if len(joint_axes) != links - 1:
        raise ConfigError(field, list(joint_axes), f"give {links - 1} axes, one for each joint")
    for joint, axis in enumerate(joint_axes, start=1):
        if axis not in ("pitch", "yaw"):
            raise ConfigError(
                f"{field}[{joint - 1}]", axis, f"Assumption 1: joint {joint} is pitch or yaw"
            )
        if joint > head_links and axis != "yaw":
            raise ConfigError(
                f"{field}[{joint - 1}]",
                axis,
                f"Assumption 2: joint {joint} belongs to the base part and must be yaw",
            )
    if head_links == 0:
        return
    if joint_axes[head_links - 1] != "pitch":
        raise ConfigError(
            f"{field}[{head_links - 1}]",
            joint_axes[head_links - 1],
            f"Assumption 2: joint {head_links} joins head and base and must be pitch",
        )
    if len(set(joint_axes[:head_links])) < 2:
        raise ConfigError(
            field,
            list(joint_axes[:head_links]),
            "Condition 2: the joints of the head part must not all turn about the same axis",
        )


def _check_wheelless(links: int, head_links: int, wheelless_links: Sequence[int]) -> None:
    field = "robot.wheelless_links"
    given = list(wheelless_links)
    if head_links + 1 in given:
        raise ConfigError(
            field,
            given,
            f"Assumption 5: link {head_links + 1}, the first of the base part, needs wheels",
        )
    _check_tail(links, given)
    _check_within(given, head_links + 2, links - 1)


def _check_tail(links: int, given: list[int]) -> None:
    if links in given:
        raise ConfigError(
            "robot.wheelless_links", given, f"Condition 1: link {links}, the tail, needs wheels"
        )


def _check_within(given: list[int], first: int, last: int) -> None:
    field = "robot.wheelless_links"
    if sorted(set(given)) != given:
        raise ConfigError(field, given, "give each link once, in rising order")
    for link in given:
        if not first <= link <= last:
            raise ConfigError(
                field,
                given,
                f"link {link} is not a link of the base part that may go without wheels: {first} "
                f"to {last}",
            )


def _check_head_scps(
    head_links: int, head_scp_joints: Sequence[int], joint_axes: Sequence[str]
) -> None:
    field = "robot.head_scp_joints"
    given = list(head_scp_joints)
    if len(given) != head_links - 4:
        raise ConfigError(
            field, given, f"give m_h = n_h - 4 = {head_links - 4} joints of the head part"
        )
    if sorted(set(given)) != given or any(not 1 <= joint <= head_links for joint in given):
        raise ConfigError(field, given, f"give different joints in rising order, 1 to {head_links}")
    rest = {axis for j, axis in enumerate(joint_axes[:head_links], start=1) if j not in given}
    if len(rest) < 2:
        raise ConfigError(
            field,
            given,
            "Condition 3: the head joints that are no H-SCPs must not all turn about one axis",
        )
    _check_neck(head_links, given, joint_axes)


def _check_neck(head_links: int, head_scp_joints: list[int], joint_axes: Sequence[str]) -> None:
    """Refuse heads for which Conditions 2 and 3 hold and B_tilde has no inverse all the same.

    Parallel joints next to the base move it in one plane; the wheels and the floor see two
    directions of that (v_z and one component of omega), so a third such joint adds nothing.
    """
    first = head_links
    while first > 1 and joint_axes[first - 2] == "pitch":
        first -= 1
    used = [joint for joint in range(first, head_links + 1) if joint not in head_scp_joints]
    if len(used) > 2:
        raise ConfigError(
            "robot.head_scp_joints",
            head_scp_joints,
            f"Condition 3 (full rank of B_tilde): of the pitch joints next to the base, {first} to "
            f"{head_links}, all but two must be H-SCPs, or one of them a yaw joint",
        )
