"""Entry point of the program ``millfrf``."""

import os
import signal
import sys
from functools import partial


def _stop_in_order(owner: int, number: int, frame: object) -> None:
    """End as by Ctrl-C, so that unfinished files are removed; a helper process of the program ends at once."""
    del frame
    if os.getpid() != owner:
        os._exit(128 + number)
    raise KeyboardInterrupt


def main() -> None:
    """Run the command line of this process."""
    signal.signal(signal.SIGTERM, partial(_stop_in_order, os.getpid()))
    try:
        from .command_line import run  # here, so that Ctrl-C while it loads is one line, too

        code = run(sys.argv[1:])
    except KeyboardInterrupt:
        code = 1
        sys.stderr.write("millfrf: stopped; nothing was written\n")
    sys.exit(code)


if __name__ == "__main__":
    main()
