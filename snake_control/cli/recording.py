"""Says what is in a recording, and draws a moment of it.

ros2 run snake_control recording out/demo/demo.mcap --draw picture.png --at 20
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from snake_control.cli.checked import natural
from snake_control.cli.common import EXIT_FAILED, EXIT_OK
from snake_control.errors import SnakeError
from snake_control.experiment.recording import Recording, read_recording


def main(argv: Sequence[str] | None = None) -> int:
    """Print topics, counts and rates; 1 if the file cannot be read or drawn."""
    parser = argparse.ArgumentParser(prog="recording", description="What is in a recording.")
    parser.add_argument("file", type=Path, help="MCAP file")
    parser.add_argument("--draw", type=Path, metavar="PNG", help="draw the robot and its errors")
    parser.add_argument(
        "--at", type=natural, default=10, metavar="S", help="moment to draw; default: %(default)s s"
    )
    given = parser.parse_args(argv)
    try:
        if given.draw is None:
            print(overview(read_recording(given.file)))
            return EXIT_OK
        # Here, because matplotlib takes a second to load.
        from snake_control.experiment.recorded_picture import TOPICS, draw_recording

        recording = read_recording(given.file, TOPICS)
        print(overview(recording))
        print(draw_recording(recording, given.at, given.draw))
    except (SnakeError, OSError) as error:
        print(f"recording: {error}", file=sys.stderr)
        return EXIT_FAILED
    return EXIT_OK


def overview(recording: Recording) -> str:
    """Return a table of the topics."""
    first, last = recording.span_ns
    duration_s = (last - first) * 1e-9
    total = sum(len(topic.times_ns) for topic in recording.topics.values())
    lines = [f"{duration_s:.1f} s, {total} messages"]
    for name, topic in sorted(recording.topics.items()):
        count = len(topic.times_ns)
        span_s = (topic.times_ns[-1] - topic.times_ns[0]) * 1e-9
        rate = f"{(count - 1) / span_s:6.1f} Hz" if count > 1 and span_s > 0 else " " * 9
        lines.append(f"{name:32} {count:7d} {rate}  {topic.type}")
    if recording.lost is None:
        lines.append("it breaks off: the recorder was killed, or still records")
    elif recording.lost:
        what = ", ".join(f"{count} of {name}" for name, count in recording.lost.items())
        lines.append(f"lost: {what}")
    else:
        lines.append("none lost")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
