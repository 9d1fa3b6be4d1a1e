"""Faults of the motion capture on request; the table in docs/pose.md is ``POSE_KINDS``."""

from __future__ import annotations

import dataclasses
import math
import threading
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from snake_control.mock.fault_kinds import Concerns, Kind
from snake_control.mock.faults import checked

Array = NDArray[np.float64]


def _kind(name: str, does: str, value: str = "", *bounds: float) -> Kind:
    return Kind(name, Concerns.POSES, does, value, *bounds)


POSE_KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        _kind("pose_dropout", "no pose is sent"),
        _kind("pose_jump", "is so far off, along x", "distance [m]", 0.2, 1e-3, 10.0),
        _kind("pose_freeze", "is the last one before, with its own stamp"),
        _kind("pose_noise", "has this much more noise, per axis", "[m]", 0.005, 1e-5, 1.0),
        _kind("pose_delay", "comes so much later, with its own stamp", "[s]", 0.05, 1e-3, 10.0),
        _kind("pose_frame", "says to be of the frame `elsewhere`"),
        _kind("pose_quaternion", "has a quaternion of this length", "length", 0.5, 1e-3, 10.0),
        _kind("pose_nan", "is no number"),
    )
}


@dataclasses.dataclass(frozen=True)
class PoseFault:
    """One fault of the motion capture.

    Attributes:
        kind: a name of ``POSE_KINDS``.
        duration_s: 0 until cleared [s].
        value: strength; ``None`` for the kind's default.
        probability: share of the poses concerned.
    """

    kind: str
    duration_s: float = 0.0
    value: float | None = None
    probability: float = 1.0

    def __post_init__(self) -> None:
        checked(POSE_KINDS, self.kind, self.duration_s, self.value, self.probability)

    @property
    def strength(self) -> float:
        """The value, or the kind's default."""
        return POSE_KINDS[self.kind].default if self.value is None else self.value

    def __str__(self) -> str:
        kind = POSE_KINDS[self.kind]
        strength = f"{kind.value} {self.strength:g}" if kind.value else ""
        share = f"{self.probability:.3g} of the poses" if self.probability < 1.0 else ""
        time = f"for {self.duration_s:g} s" if self.duration_s else "until cleared"
        return " ".join(filter(None, (self.kind, strength, share, time)))


@dataclasses.dataclass(frozen=True)
class SentPose:
    """What becomes of a measured pose.

    Attributes:
        position, quaternion: as they are sent.
        later_s: how much later than usual [s].
        elsewhere: whether it says to be of another frame.
    """

    position: Array
    quaternion: Array
    later_s: float = 0.0
    elsewhere: bool = False


class PoseFaults:
    """The faults in force; one thread may ask for them while another measures."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Start without faults; ``rng`` decides which poses, and how they are wrong."""
        self._rng = rng
        self._lock = threading.Lock()
        self._active: list[tuple[PoseFault, float]] = []
        self._last: SentPose | None = None

    def inject(self, fault: PoseFault, now: float) -> None:
        """Let a fault begin at the time ``now`` [s]."""
        until = now + fault.duration_s if fault.duration_s else math.inf
        with self._lock:
            self._active.append((fault, until))

    def clear(self) -> int:
        """End all faults; return how many were in force."""
        with self._lock:
            count = len(self._active)
            self._active.clear()
        return count

    def spoil(self, time: float, position: Array, quaternion: Array) -> SentPose | None:
        """Return what is sent of a pose that was measured at ``time`` [s]; ``None``: nothing."""
        with self._lock:
            self._active = [entry for entry in self._active if entry[1] > time]
            faults = [fault for fault, _ in self._active]
        sent: SentPose | None = SentPose(position, quaternion)
        froze = False
        for fault in faults:
            if fault.probability < 1.0 and self._rng.random() >= fault.probability:
                continue
            froze = froze or fault.kind == "pose_freeze"
            if sent is not None:
                sent = self._with(fault, sent)
        if not froze:
            self._last = SentPose(position, quaternion)
        return sent

    def _with(self, fault: PoseFault, pose: SentPose) -> SentPose | None:
        value = fault.strength
        if fault.kind == "pose_dropout":
            return None
        if fault.kind == "pose_jump":
            return dataclasses.replace(pose, position=pose.position + [value, 0.0, 0.0])
        if fault.kind == "pose_freeze":
            return self._last or pose
        if fault.kind == "pose_noise":
            noise = self._rng.normal(0.0, value, 3)
            return dataclasses.replace(pose, position=pose.position + noise)
        if fault.kind == "pose_delay":
            return dataclasses.replace(pose, later_s=pose.later_s + value)
        if fault.kind == "pose_frame":
            return dataclasses.replace(pose, elsewhere=True)
        if fault.kind == "pose_quaternion":
            return dataclasses.replace(pose, quaternion=value * pose.quaternion)
        return dataclasses.replace(pose, position=np.full(3, math.nan))
