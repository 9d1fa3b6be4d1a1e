"""Brings servos into service: scan, check, monitor, configure, set-id, jog, guide.

Exit codes: 0 all is well; 1 something is not, or failed; 2 wrong arguments or parameters, or the
port cannot be opened; 3 the user did not agree; 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from snake_control.cli.ax12 import check, configure, guide, jog, monitor, scan, set_id
from snake_control.cli.ax12.common import EXIT_ABORTED, EXIT_INTERRUPTED, AbortedError
from snake_control.cli.common import EXIT_FAILED, EXIT_USAGE
from snake_control.errors import BusError, ConfigError, ConfigFileError, ServoError

COMMANDS = {
    "scan": scan,
    "check": check,
    "monitor": monitor,
    "configure": configure,
    "set-id": set_id,
    "jog": jog,
    "guide": guide,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a sub-command; return its exit code, with one line on standard error if it failed."""
    parser = argparse.ArgumentParser(prog="ax12", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, module in COMMANDS.items():
        module.add_arguments(commands.add_parser(name, help=module.HELP, description=module.HELP))
    given = parser.parse_args(argv)
    try:
        return COMMANDS[given.command].run(given)
    except AbortedError as error:
        print(error, file=sys.stderr)
        return EXIT_ABORTED
    except (ConfigError, ConfigFileError, BusError) as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_USAGE
    except ServoError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return EXIT_FAILED


if __name__ == "__main__":
    raise SystemExit(main())
