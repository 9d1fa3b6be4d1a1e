"""What the watch of the head's pose expects, and when it names something."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class WatchLimits:
    """What is expected of measured and predicted motion, and when something is named.

    Attributes:
        position_std_m, attitude_std_rad: least noise of a single measured pose, per axis; what the
            poses show themselves is taken if it is larger [m, rad].
        joint_std_rad: of a joint angle read: ticks and play [rad].
        slip_share: error of a wheel row, as a share of what the joints do to it.
        model_share: error of all else (lengths, play), as a share of the head's motion.
        floor_share: height that the floor may rise or fall, as a share of the way.
        creep_m_s: error of a wheel row whatever the joints do [m/s].
        view_s: time over which poses and angles are averaged [s].
        gap_s: after a gap of poses or joint states longer than this a new segment begins [s].
        segment_s: least duration of a segment [s].
        segment_rad: turn of a joint, or of the head, that makes a segment [rad].
        segment_m: way of the head that makes one [m].
        window_s: segments older than this count for nothing [s].
        window_segments: nor do those before this many.
        least_segments: nothing is named on fewer segments.
        recent_segments: suspicion looks at all segments, and at this many of late.
        suspicious: cost of what is configured, as a multiple of the expected one, of x and y, z,
            turning about x and y, or about z, that cannot be.
        plausible: the same, of a cause that is named, for all together.
        explained: share of the cost that a named cause explains at least.
        unexplained: wheels slide if no cause explains more than this.
        margin: by how much the cost of a named cause is below that of all others, absolutely; and
            ``factor``, by how many times.
        confirm, confirm_offset, confirm_slip: judgements in a row for naming joints, marker, slip.
        clear: judgements in a row without suspicion for taking it back.
        least_offset_m: a marker nearer than this to where it should be is not accused [m]; nor one
            whose offset explains less than ``offset_gain`` times what it would by chance (an F
            test: 1 is chance), or whose direction has turned by less than ``offset_seen``
            (root of the mean square) [rad]; nor one beside which more remains than
            ``beside_offset`` times what is expected, for any group of axes.
    """

    position_std_m: float = 0.0005
    attitude_std_rad: float = 0.002
    joint_std_rad: float = 0.0015
    slip_share: float = 0.1
    model_share: float = 0.03
    floor_share: float = 0.01
    creep_m_s: float = 0.0002
    view_s: float = 0.05
    gap_s: float = 0.2
    segment_s: float = 0.2
    segment_rad: float = 0.1
    segment_m: float = 0.01
    window_s: float = 60.0
    window_segments: int = 100
    least_segments: int = 5
    recent_segments: int = 15
    suspicious: float = 3.0
    plausible: float = 2.5
    explained: float = 0.7
    unexplained: float = 0.5
    margin: float = 40.0
    factor: float = 1.5
    confirm: int = 3
    confirm_offset: int = 5
    confirm_slip: int = 6
    clear: int = 6
    least_offset_m: float = 0.005
    offset_gain: float = 30.0
    beside_offset: float = 1.0
    offset_seen: float = 0.08
