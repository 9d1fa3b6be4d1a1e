"""Runs any number of random packets: ``python -m fuzz.run --packets 1000000``."""

from __future__ import annotations

import argparse
import sys
import time

from fuzz.driver import DriverFuzz, LateFuzz
from fuzz.mock import MockFuzz

_BLOCK = 1000


def main() -> int:
    """Run half of the packets against the mock, the rest against the driver; return 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--packets", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    begin = shown = time.monotonic()
    mock, driver, late = MockFuzz(given.seed), DriverFuzz(given.seed), LateFuzz(given.seed)
    done = 0
    while done < given.packets:
        for k in range(min(_BLOCK, given.packets - done) // 2 or 1):
            mock.step()
            (late if k % 4 == 0 else driver).step()
        done = mock.packets + driver.requests + late.requests
        now = time.monotonic()
        if now - shown > 5.0 or done >= given.packets:
            shown = now
            left = (now - begin) / done * (given.packets - done)
            print(f"{done} of {given.packets} packets, about {left:.0f} s left", file=sys.stderr)
    print(
        f"mock: {mock.packets} packets, {mock.replies} answered, {mock.refused} of them refused\n"
        f"driver: {driver.requests} requests, {driver.believed} replies believed, "
        f"{driver.missed} missed\n"
        f"late replies: {late.requests} requests, {late.believed} replies believed, "
        f"{late.late} came late\n"
        f"no crash, no hang, nothing believed that was not sent or that answers another request, "
        f"no register out of its range ({time.monotonic() - begin:.0f} s, seed {given.seed})"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
