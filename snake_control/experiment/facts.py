"""The figures of one run that the paper's statements are about."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from snake_control.experiment.oscillation import Oscillation, oscillation
from snake_control.experiment.run import CaseRun

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW_S = (25.0, 60.0)
"""When motion is judged: the run-in from w(0) is over, and two of the SCPs' periods fit in."""
SHORTEST_WINDOW_S = 20.0
RUN_IN_S = 5.0
"""The first seconds carry the way from w(0) to w_d, and the largest speeds."""
END_S = 20.0
"""Tracking is judged over this long at the end of a run."""
SINGULAR_SHARE = 0.02
"""Below this share of its start V_b1 counts as having gone to zero."""


class Facts:
    """Figures of one run, each worked out when it is asked for; NaN or ``None`` if unknown."""

    def __init__(self, run: CaseRun) -> None:
        """Look at ``run``; its series must not be empty."""
        self.run = run
        self.t: Array = run.series.numbers("t_s")
        self.error: Array = run.series.error
        # z, R, P of a planar snake are nobody's to follow.
        self.error[:, [i for i in range(6) if i not in run.config.robot.controlled]] = 0.0
        self.phi: Array = run.series.phi
        self.V_b1: Array = run.series.numbers("V_b1")
        self.V_h: Array = run.series.numbers("V_h")
        self.d_min: Array = run.series.d_min
        self.u: Array = run.series.numbers("u")

    @property
    def fell_at_s(self) -> float | None:
        """When the robot fell [s]."""
        fell: float | None = self.run.summary["fell_at_s"]
        return fell

    @property
    def end_s(self) -> float:
        """Time of the last step [s]."""
        return float(self.t[-1])

    @functools.cached_property
    def window(self) -> Mask:
        """Which steps lie in ``WINDOW_S`` and before a fall."""
        end = WINDOW_S[1] if self.fell_at_s is None else min(WINDOW_S[1], self.fell_at_s)
        return np.asarray((self.t >= WINDOW_S[0]) & (self.t <= end))

    @property
    def has_window(self) -> bool:
        """Whether enough of the window was run to judge motion by it."""
        t = self.t[self.window]
        return len(t) >= 8 and float(t[-1] - t[0]) >= SHORTEST_WINDOW_S - 1e-9

    @functools.cached_property
    def at_end(self) -> Mask:
        """The last ``END_S`` of the run, before a fall."""
        end = self.end_s if self.fell_at_s is None else self.fell_at_s
        return np.asarray((self.t >= end - END_S) & (self.t <= end))

    @functools.cached_property
    def singular_at_s(self) -> float | None:
        """When V_b1 first falls below ``SINGULAR_SHARE`` of its start [s]."""
        below = np.flatnonzero(self.V_b1 < SINGULAR_SHARE * self.V_b1[0])
        return float(self.t[below[0]]) if len(below) else None

    @property
    def least_V_b1_share(self) -> float:
        """Smallest V_b1 as a share of its start."""
        return float(np.nanmin(self.V_b1) / self.V_b1[0])

    @property
    def nearness(self) -> str:
        """Largest nearness of a singular shape of Fig. 5, in words."""
        summary = self.run.summary
        value = summary["max_singular_nearness"]
        if value is None:
            return "an unknown value"
        when = f"at {summary['max_singular_nearness_at_s']:.1f} s"
        return f"{value:.3f} ({summary['max_singular_nearness_shape']}, {when})"

    def V_b1_at(self, t_s: float) -> float:
        """Return V_b1 at the step nearest to ``t_s``."""
        return float(self.V_b1[np.abs(self.t - t_s).argmin()])

    def oscillation_of(self, joint: int) -> Oscillation:
        """Return how joint ``joint`` (from 1) oscillates in the window."""
        return self._oscillations[joint]

    @functools.cached_property
    def _oscillations(self) -> dict[int, Oscillation]:
        robot = self.run.config.robot
        t, phi = self.t[self.window], self.phi[self.window]
        joints = range(robot.head_links + 1, robot.joints + 1)
        return {joint: oscillation(t, phi[:, joint - 1]) for joint in joints}

    def d_min_percentile(self, percent: float) -> float:
        """Return a percentile of d_min in the window [m]."""
        return float(np.percentile(self.d_min[self.window], percent))

    @property
    def V_h_growth(self) -> float:
        """Median of V_h in the window over its start."""
        return float(np.median(self.V_h[self.window]) / self.V_h[0])

    @property
    def V_b1_median(self) -> float:
        """Median of V_b1 in the window."""
        return float(np.median(self.V_b1[self.window]))

    @functools.cached_property
    def error_at_end(self) -> Array:
        """Largest error of each component over the last ``END_S``, (6,) [m, rad]."""
        return np.abs(self.error[self.at_end]).max(axis=0)

    @functools.cached_property
    def mean_error_at_end(self) -> Array:
        """Mean error of each component over the last ``END_S``, (6,) [m, rad]."""
        return self.error[self.at_end].mean(axis=0)

    @property
    def law(self) -> str:
        """Equation that says how the error should go: (24), or that of (21)."""
        return "(21)" if self.run.settings.controller == "torque" else "(24)"

    @functools.cached_property
    def off_law(self) -> Array:
        """Largest distance of each error from what ``law`` promises, at the end, (6,) [m, rad]."""
        gains, t = self.run.config.controller, self.t[self.at_end]
        if self.run.settings.controller == "torque":
            # At rest at t = 0, so the error's rate is that of the reference.
            w_d = self.run.series.numbers("w_d")
            rate = -(w_d[1] - w_d[0]) / (self.t[1] - self.t[0])
            K_p = np.broadcast_to(gains.K_p, 6)
            K_v = np.broadcast_to(gains.K_v, 6) if len(gains.K_v) == 1 else np.array(gains.K_v[:6])
            ideal = second_order(t, self.error[0], rate, K_p, K_v)
        else:
            ideal = self.error[0] * np.exp(-np.array(gains.K[:6]) * t[:, None])
        return np.abs(self.error[self.at_end] - ideal).max(axis=0)

    @property
    def usual_speed(self) -> float:
        """Root mean square of all joint velocities in the window [rad/s]."""
        return float(np.sqrt(np.mean(self.u[self.window] ** 2)))

    @property
    def largest_speed(self) -> float:
        """Largest joint speed asked for [rad/s]."""
        return float(np.abs(self.u).max())

    @property
    def largest_angle(self) -> float:
        """Largest joint angle [rad]."""
        return float(np.abs(self.phi).max())

    @property
    def largest_slip(self) -> float:
        """Largest sideways velocity of a wheel once the run-in is over [m/s]."""
        slip = np.abs(self.run.series.numbers("slip")[self.t >= RUN_IN_S])
        return float(slip.max()) if len(slip) and np.isfinite(slip).all() else math.nan

    @property
    def usual_slip(self) -> float:
        """Root mean square of the wheels' sideways velocity in the window [m/s]."""
        slip = self.run.series.numbers("slip")[self.window]
        return float(np.sqrt(np.mean(slip**2))) if np.isfinite(slip).all() else math.nan


def second_order(t: Array, start: Array, rate: Array, K_p: Array, K_v: Array) -> Array:
    """Return the solutions of e_ddot + K_v e_dot + K_p e = 0, (N, k).

    Args:
        t: times [s], (N,).
        start, rate: e(0) and e_dot(0), (k,).
        K_p, K_v: gains [1/s^2, 1/s], (k,).
    """
    middle = -0.5 * K_v
    half = np.sqrt((middle**2 - K_p).astype(complex))
    # sinh(h t) / h, which is t where both roots are one.
    single = np.abs(half) < 1e-9
    safe = np.where(single, 1.0, half)
    time = t[:, None]
    sine = np.where(single, time, np.sinh(safe * time) / safe)
    values = np.exp(middle * time) * (start * np.cosh(half * time) + (rate - middle * start) * sine)
    return np.asarray(values.real)
