"""Entry point of the program ``millfrf``."""

import os
import signal
import sys
from functools import partial

from .command_line import run


def _stop_in_order(owner: int, number: int, frame: object) -> None:
    """End as by Ctrl-C, so that unfinished files are removed; a helper process of the program ends at once."""
    del frame
    if os.getpid() != owner:
        os._exit(128 + number)
    raise KeyboardInterrupt


def main() -> None:
    """Run the command line of this process."""
    signal.signal(signal.SIGTERM, partial(_stop_in_order, os.getpid()))
    sys.exit(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
