"""The recorded series of an experiment: one row for each control step, in memory and as CSV."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.errors import SeriesFileError
from snake_control.model.rotation import wrap

Array = NDArray[np.float64]

HEAD_COMPONENTS = ("x_h", "y_h", "z_h", "R", "P", "Y")
"""Names of the components of w."""
HEAD_UNITS = ("m", "m", "m", "rad", "rad", "rad")


def pose_error(w: ArrayLike, w_d: ArrayLike) -> Array:
    """Return w - w_d with the three angles wrapped to +-pi, shape (..., 6) [m, rad]."""
    error: Array = np.array(w, dtype=float) - np.asarray(w_d, dtype=float)
    error[..., 3:] = wrap(error[..., 3:])
    return error


@dataclasses.dataclass(frozen=True)
class Step:
    """One control step. What nobody observed (ground truth on hardware) stays None, or NaN.

    Attributes:
        t_s: time since the reference started [s].
        status: one word: ``tracking``, ``limited``, ``stale``, ...
        w, w_measured, w_d: head pose in truth, as the controller measured it, and wanted, (6,).
        phi, phi_measured: joint angles in truth and as measured, (n-1,) [rad].
        u_unlimited, u: joint velocities before and after limiting (22), (n-1,) [rad/s].
        phi_tilde_dot_d: wanted SCP velocities (25), (27), H-SCPs first, (m,) [rad/s].
        speed_scale: factor on the whole velocity vector, 0..1.
        speed_limited, range_limited: joint numbers whose limit bit.
        V_h, V_b1: cost functions (29), (30).
        d_min: distance to the edge of the support polygon as the controller sees it [m].
        d_min_true: the same of the ground truth [m].
        sigma_min_B_tilde, sigma_min_A_hat: smallest singular values of (7), (11).
        damping: share of the motion in B_tilde's weakest direction that was given up, 0..1.
        singular_nearness: how near a singular shape of Fig. 5 is, 0..1.
        singular_shape: which: ``parallel`` or ``arc``, empty while unknown.
        fallen: whether the robot has fallen by now, in truth.
        slip: sideways velocity of each wheeled link, in truth [m/s].
        effort: torque of each joint: commanded by torque control, else what holds the robot still
            against gravity, in truth, (n-1,) [N m].
        step_time_s: computation time of the control step [s].
        bus_cycle_time_s, bus_rate_hz: of the latest bus cycle.
    """

    t_s: float
    status: str
    w_measured: ArrayLike
    w_d: ArrayLike
    phi_measured: ArrayLike
    u_unlimited: ArrayLike
    u: ArrayLike
    phi_tilde_dot_d: ArrayLike
    speed_scale: float
    speed_limited: tuple[int, ...]
    range_limited: tuple[int, ...]
    V_h: float
    V_b1: float
    d_min: float
    sigma_min_B_tilde: float
    sigma_min_A_hat: float
    damping: float
    singular_nearness: float
    singular_shape: str
    w: ArrayLike | None = None
    phi: ArrayLike | None = None
    d_min_true: float = np.nan
    fallen: bool = False
    slip: ArrayLike | None = None
    effort: ArrayLike | None = None
    step_time_s: float = np.nan
    bus_cycle_time_s: float = np.nan
    bus_rate_hz: float = np.nan

    @property
    def error(self) -> Array:
        """Tracking error against w_d: of the ground truth where there is one, (6,) [m, rad]."""
        return pose_error(self.w_measured if self.w is None else self.w, self.w_d)


@dataclasses.dataclass(frozen=True)
class Column:
    """Columns of the CSV file that hold one field of ``Step``.

    Attributes:
        field: name of the field.
        headers: names in the file, units at the end; one for each element.
        kind: ``number``, ``flag`` (0 or 1), ``joints`` (``3;5``) or ``text``.
    """

    field: str
    headers: tuple[str, ...]
    kind: str = "number"


def columns(robot: RobotConfig) -> tuple[Column, ...]:
    """Return the columns of a robot's series, in file order."""
    joints = range(1, robot.joints + 1)

    def head(form: str) -> tuple[str, ...]:
        return tuple(
            form.format(name=name, unit=unit)
            for name, unit in zip(HEAD_COMPONENTS, HEAD_UNITS, strict=True)
        )

    def each(form: str, numbers: Iterable[int]) -> tuple[str, ...]:
        return tuple(form.format(number) for number in numbers)

    return (
        Column("t_s", ("t_s",)),
        Column("status", ("status",), "text"),
        Column("w", head("{name}_{unit}")),
        Column("w_measured", head("{name}_measured_{unit}")),
        Column("w_d", head("{name}_d_{unit}")),
        Column("error", head("e_{name}_{unit}")),
        Column("phi", each("phi_{}_rad", joints)),
        Column("phi_measured", each("phi_{}_measured_rad", joints)),
        Column("u_unlimited", each("u_{}_unlimited_rad_s", joints)),
        Column("u", each("u_{}_rad_s", joints)),
        Column("phi_tilde_dot_d", each("phi_{}_dot_d_rad_s", robot.scp_joints)),
        Column("speed_scale", ("speed_scale",)),
        Column("speed_limited", ("speed_limited_joints",), "joints"),
        Column("range_limited", ("range_limited_joints",), "joints"),
        Column("V_h", ("V_h",)),
        Column("V_b1", ("V_b1",)),
        Column("d_min", ("d_min_controller_m",)),
        Column("d_min_true", ("d_min_m",)),
        Column("sigma_min_B_tilde", ("sigma_min_B_tilde",)),
        Column("sigma_min_A_hat", ("sigma_min_A_hat",)),
        Column("damping", ("damping",)),
        Column("singular_nearness", ("singular_nearness",)),
        Column("singular_shape", ("singular_shape",), "text"),
        Column("fallen", ("fallen",), "flag"),
        Column("slip", each("slip_{}_m_s", robot.wheeled_links)),
        Column("effort", each("effort_{}_n_m", joints)),
        Column("step_time_s", ("step_time_s",)),
        Column("bus_cycle_time_s", ("bus_cycle_time_s",)),
        Column("bus_rate_hz", ("bus_rate_hz",)),
    )


class Series:
    """Steps in memory and, if a path is given, on disk as they come.

    Every appended row is handed to the operating system at once: whatever ends the process, the
    rows so far are in the file.
    """

    def __init__(self, robot: RobotConfig, path: str | Path | None = None) -> None:
        """Start an empty series; with ``path``, also the CSV file (an older one is replaced).

        Raises:
            OSError: the file cannot be created.
        """
        self.robot = robot
        self._columns = {column.field: column for column in columns(robot)}
        self._numbers: dict[str, list[Any]] = {field: [] for field in self._columns}
        self._file: TextIO | None = None
        if path is not None:
            self._file = open(path, "w", encoding="ascii", newline="")  # noqa: SIM115
            self._write_line(self._file, _headers(self._columns.values()))

    def __len__(self) -> int:
        return len(self._numbers["t_s"])

    def append(self, step: Step) -> None:
        """Add one step.

        Raises:
            ValueError: a field has another number of elements than the robot asks for.
        """
        values = {
            field: _canonical(column, getattr(step, field))
            for field, column in self._columns.items()
        }
        for field, value in values.items():
            self._numbers[field].append(value)
        if self._file is not None:
            self._write_line(
                self._file,
                (
                    text
                    for field, column in self._columns.items()
                    for text in _texts(column, values[field])
                ),
            )

    def numbers(self, field: str) -> Array:
        """Return a numeric field of all steps: shape (N,) for one column, else (N, k)."""
        column = self._columns[field]
        width = len(column.headers)
        values = np.array(self._numbers[field], dtype=float).reshape(len(self), width)
        return values[:, 0] if width == 1 else values

    def texts(self, field: str = "status") -> list[str]:
        """Return a field of text of all steps."""
        return list(self._numbers[field])

    def joints(self, field: str) -> list[tuple[int, ...]]:
        """Return ``speed_limited`` or ``range_limited`` of all steps: joint numbers."""
        return list(self._numbers[field])

    @property
    def truth_known(self) -> NDArray[np.bool_]:
        """In which steps the ground truth is known, (N,); there ``w``, ``phi``, ... are taken."""
        known: NDArray[np.bool_] = np.asarray(np.isfinite(self.numbers("w")).all(axis=1))
        return known

    @property
    def w(self) -> Array:
        """Head pose: the truth where it is known, else as measured, (N, 6) [m, rad]."""
        return np.where(self.truth_known[:, None], self.numbers("w"), self.numbers("w_measured"))

    @property
    def phi(self) -> Array:
        """Joint angles: the truth where it is known, else as measured, (N, n-1) [rad]."""
        truth, measured = self.numbers("phi"), self.numbers("phi_measured")
        return np.where(self.truth_known[:, None], truth, measured)

    @property
    def d_min(self) -> Array:
        """d_min: the truth where it is known, else the controller's, (N,) [m]."""
        return np.where(self.truth_known, self.numbers("d_min_true"), self.numbers("d_min"))

    @property
    def error(self) -> Array:
        """Tracking error of ``w`` against w_d, (N, 6) [m, rad]."""
        return pose_error(self.w, self.numbers("w_d"))

    def close(self) -> None:
        """Close the file; the series stays readable."""
        if self._file is not None:
            self._file.close()
            self._file = None

    @staticmethod
    def _write_line(file: TextIO, cells: Iterable[str]) -> None:
        file.write(",".join(cells) + "\n")
        file.flush()

    @classmethod
    def read(cls, path: str | Path, robot: RobotConfig) -> Series:
        """Read a CSV file; a last row that was cut off when its process died is left out.

        Raises:
            OSError: the file cannot be read.
            SeriesFileError: it holds other columns than ``robot`` asks for, or no numbers.
        """
        series = cls(robot)
        with open(path, encoding="ascii", newline="") as file:
            text = file.read()
        complete = text[: text.rfind("\n") + 1]
        rows = list(csv.reader(complete.splitlines()))
        expected = _headers(series._columns.values())
        if not rows or rows[0] != expected:
            raise SeriesFileError(str(path), "holds other columns than this robot's series has")
        for number, row in enumerate(rows[1:], start=2):
            if len(row) != len(expected):
                raise SeriesFileError(str(path), f"line {number}: {len(row)} cells")
            try:
                series._append_cells(row)
            except ValueError as error:
                raise SeriesFileError(str(path), f"line {number}: {error}") from error
        return series

    def _append_cells(self, cells: Sequence[str]) -> None:
        values, start = {}, 0
        for field, column in self._columns.items():
            end = start + len(column.headers)
            values[field] = _PARSERS[column.kind](cells[start:end])
            start = end
        for field, value in values.items():
            self._numbers[field].append(value)


def _headers(all_columns: Iterable[Column]) -> list[str]:
    return [header for column in all_columns for header in column.headers]


def _canonical(column: Column, value: Any) -> Any:
    if column.kind == "text":
        return str(value)
    if column.kind == "joints":
        return tuple(int(joint) for joint in value)
    if value is None:
        return np.full(len(column.headers), np.nan)
    numbers = np.array(value, dtype=float).reshape(-1)
    if len(numbers) != len(column.headers):
        raise ValueError(f"{column.field}: {len(numbers)} values instead of {len(column.headers)}")
    return numbers


def _texts(column: Column, value: Any) -> list[str]:
    if column.kind == "text":
        return [value]
    if column.kind == "joints":
        return [";".join(map(str, value))]
    if column.kind == "flag":
        return [str(int(value[0]))]
    # Nine digits: well below every sensor's resolution, and half the size of exact ones.
    return [f"{number:.9g}" for number in value.tolist()]


_PARSERS: dict[str, Callable[[Sequence[str]], Any]] = {
    "text": lambda cells: cells[0],
    "joints": lambda cells: tuple(int(joint) for joint in cells[0].split(";") if joint),
    "number": lambda cells: np.array([float(cell) for cell in cells]),
    "flag": lambda cells: np.array([float(int(cells[0]))]),
}
