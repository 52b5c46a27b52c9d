"""A program that runs command lines in copies of itself: killed at a moment, or with files of bounded size.

A line of JSON on standard input is a trial: ``folder``, ``words``, and where asked for ``kill_after`` (s),
``kill_in_writing`` (s after the first unfinished folder appears), ``largest_file`` (bytes) or ``fault`` (variables of
``failing_disk.c``, which is preloaded). A line of JSON on standard output is what came of it: ``code`` (negative: the
signal that ended it), ``said`` and ``seconds``.
"""

import json
import os
import resource
import signal
import sys
import time
from pathlib import Path

_LONGEST = 300.0


def copy_of_this_process(trial: dict, sink: int) -> None:
    """Run the command line and leave; what it says goes into a pipe, which holds 64 kB."""
    os.dup2(sink, 1)
    os.dup2(sink, 2)
    sys.stdout.reconfigure(line_buffering=True)  # into a pipe, lines of both streams in their order
    os.chdir(trial["folder"])
    os.environ.update(trial.get("fault") or {})
    if trial.get("largest_file") is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (trial["largest_file"], resource.RLIM_INFINITY))
    from millfrf.command_line import run

    code = run(trial["words"])
    sys.stdout.flush()
    sys.stderr.flush()
    sys.exit(code)  # with everything that libraries do at the end: that is where HDF5 crashed


def is_writing(folder: Path) -> bool:
    """Whether an unfinished folder is there."""
    return any(folder.glob(".millfrf-*.unfinished"))


def ended(child: int) -> int | None:
    """Exit code of a copy, negative where a signal ended it; None while it runs."""
    done, status = os.waitpid(child, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if done else None


def attend(child: int, trial: dict) -> int:
    """Wait for a copy, or kill it when its moment has come."""
    started, folder = time.monotonic(), Path(trial["folder"])
    while (code := ended(child)) is None:
        after = trial.get("kill_after")
        if trial.get("kill_in_writing") is not None and is_writing(folder):
            time.sleep(trial["kill_in_writing"])
            after = 0.0
        if time.monotonic() - started > (_LONGEST if after is None else after):
            os.kill(child, signal.SIGKILL)
            return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        time.sleep(0.0005)
    return code


def main() -> None:
    """Serve trials until standard input ends."""
    import matplotlib.font_manager  # noqa: F401  # a failing disk or a bounded file would cut its list of fonts short

    import millfrf.__main__
    import millfrf.reports.page
    import millfrf.steps.diagnose
    import millfrf.steps.given  # noqa: F401  # what every copy needs is loaded once

    for line in sys.stdin:
        trial = json.loads(line)
        started = time.monotonic()
        source, sink = os.pipe()
        child = os.fork()
        if child == 0:
            copy_of_this_process(trial, sink)
        os.close(sink)
        code = attend(child, trial)
        with os.fdopen(source, "rb") as pipe:
            text = pipe.read().decode("utf-8", "replace")
        answer = {"code": code, "said": text, "seconds": time.monotonic() - started}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
