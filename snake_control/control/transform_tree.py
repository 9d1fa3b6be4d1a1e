"""Poses of frames in each other, from the edges of a tree of frames that TF messages name."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Edge:
    """Pose of a frame in its parent.

    Attributes:
        parent: frame of the pose.
        stamp_ns: time of the pose [ns]; ``None`` for one that never changes.
        position: (3,) [m].
        rotation: attitude.
    """

    parent: str
    stamp_ns: int | None
    position: Array
    rotation: Rotation


class TransformTree:
    """Keeps the pose that came last of each frame in its parent."""

    def __init__(self) -> None:
        self._edges: dict[str, Edge] = {}

    def put(self, child: str, edge: Edge) -> None:
        """Take the pose of a frame; the one that came last counts, as clocks may be set back."""
        self._edges[child] = edge

    def pose(self, reference: str, frame: str) -> Edge | None:
        """Return the pose of ``frame`` in ``reference``, ``None`` while nothing connects them.

        Its stamp is the oldest of the edges between them, ``None`` if none of them ever changes.
        """
        from_frame, from_reference = self._to_root(frame), self._to_root(reference)
        common = next((name for name in from_frame if name in from_reference), None)
        if common is None:
            return None
        down, up = from_frame[common], from_reference[common]
        back = up.rotation.inv()
        stamps = [stamp for stamp in (down.stamp_ns, up.stamp_ns) if stamp is not None]
        return Edge(
            parent=reference,
            stamp_ns=min(stamps, default=None),
            position=back.apply(down.position - up.position),
            rotation=back * down.rotation,
        )

    def _to_root(self, frame: str) -> dict[str, Edge]:
        """Poses of ``frame`` in itself and in each of its ancestors, nearest first."""
        here = Edge(frame, None, np.zeros(3), Rotation.identity())
        found = {frame: here}
        while (edge := self._edges.get(here.parent)) is not None and edge.parent not in found:
            stamps = [stamp for stamp in (here.stamp_ns, edge.stamp_ns) if stamp is not None]
            here = Edge(
                edge.parent,
                min(stamps, default=None),
                edge.position + edge.rotation.apply(here.position),
                edge.rotation * here.rotation,
            )
            found[edge.parent] = here
        return found
