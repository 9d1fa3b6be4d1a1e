"""The kinematics once more with as many digits as asked for, straight from the conventions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpmath import mp

from snake_control.config import RobotConfig

Vector = list[Any]


def _cross(a: Vector, b: Vector) -> Vector:
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def _dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _turn(frame: list[Vector], axis: str, angle: Any) -> list[Vector]:
    """Axes of a frame (x, y, z in the world) after a turn about its own y or z axis."""
    x, y, z = frame
    c, s = mp.cos(angle), mp.sin(angle)
    if axis == "pitch":
        return [
            [c * a - s * b for a, b in zip(x, z, strict=True)],
            y,
            [s * a + c * b for a, b in zip(x, z, strict=True)],
        ]
    return [
        [c * a + s * b for a, b in zip(x, y, strict=True)],
        [c * b - s * a for a, b in zip(x, y, strict=True)],
        z,
    ]


def constraint_rows(robot: RobotConfig, q: Sequence[Any]) -> list[list[Any]]:
    """G(q) of (1)-(3): rows of wheels, then the floor's."""
    half = mp.mpf(robot.half_length_m)
    yaw, pitch, roll = q[5], q[4], q[3]
    unit = [[mp.mpf(int(i == j)) for j in range(3)] for i in range(3)]
    yawed = _turn(unit, "yaw", yaw)
    pitched = _turn(yawed, "pitch", pitch)
    x, y, z = pitched
    c, s = mp.cos(roll), mp.sin(roll)
    frame = [
        x,
        [c * a + s * b for a, b in zip(y, z, strict=True)],
        [c * b - s * a for a, b in zip(y, z, strict=True)],
    ]
    point = list(q[:3])
    # Axis and pivot of each turning coordinate: R, P, Y, then the joints.
    turns = [(x, point), (yawed[1], point), (unit[2], point)]
    frames, centers = [frame], []
    for joint, axis in enumerate(robot.joint_axes):
        centers.append([p - half * d for p, d in zip(point, frame[0], strict=True)])
        point = [p - 2 * half * d for p, d in zip(point, frame[0], strict=True)]
        turns.append((frame[1] if axis == "pitch" else frame[2], point))
        frame = _turn(frame, axis, q[6 + joint])
        frames.append(frame)
    centers.append([p - half * d for p, d in zip(point, frame[0], strict=True)])

    def velocity_row(link: int, direction: Vector) -> list[Any]:
        row = list(direction)
        for coordinate, (axis, pivot) in enumerate(turns):
            if coordinate < link + 2:
                arm = [a - b for a, b in zip(centers[link - 1], pivot, strict=True)]
                row.append(_dot(direction, _cross(axis, arm)))
            else:
                row.append(mp.zero)
        return row

    rows = [velocity_row(link, frames[link - 1][1]) for link in robot.wheeled_links]
    first = robot.head_links + 1
    rows.append(velocity_row(first, unit[2]))
    for i in range(2):
        row = [mp.zero] * 3
        row += [axis[i] if k < first + 2 else mp.zero for k, (axis, _) in enumerate(turns)]
        rows.append(row)
    return rows


def F_bar(robot: RobotConfig, q: Sequence[Any]) -> Any:
    """F_bar (8) as a matrix, by LU of the head block and substitution along the body."""
    rows = constraint_rows(robot, q)
    scp = [joint - 1 for joint in robot.scp_joints]
    theta = [joint for joint in range(robot.joints) if joint not in scp]
    inputs = [*range(6), *(6 + joint for joint in scp)]
    head_rows, head = [0, *range(len(rows) - 3, len(rows))], theta[:4]
    block = mp.matrix([[-rows[r][6 + j] for j in head] for r in head_rows])
    right = mp.matrix([[rows[r][c] for c in inputs] for r in head_rows])
    found = (mp.inverse(block) * right).tolist()
    for r, joint in enumerate(theta[4:], start=1):
        row = []
        for i, c in enumerate(inputs):
            known = sum(rows[r][6 + j] * found[k][i] for k, j in enumerate(theta[: r + 3]))
            row.append(-(rows[r][c] + known) / rows[r][6 + joint])
        found.append(row)
    return mp.matrix(found)


def log_V_b1(robot: RobotConfig, q: Sequence[Any]) -> Any:
    """log det(E_tilde E_tilde^T) (17), (30)."""
    F = F_bar(robot, q)
    gram = F.T * F
    for i in range(6, gram.rows):
        gram[i, i] += 1
    return mp.log(mp.det(gram))
