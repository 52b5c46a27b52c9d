"""An engine that answers problem after problem, each in a process of its own: ``python -m benchmarks.frf_trial.child``.

It imports the engine once and forks for each line on standard input, ``PROBLEM ANSWER SECONDS MEGABYTES`` with tabs
between; when the fork has ended it writes :data:`DONE` and the fork's exit code (minus a signal's number).
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import contextlib
import resource
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from .engines import engine
from .problem import Answer, Problem, read_problem, write_answer

DONE = "@done"
"""Before the exit code, for engines print lines of their own."""
CLOCK_OVER_PROCESSOR = 6.0
"""An engine that waits is stopped after this many times its seconds (and a minute) by the clock."""


def main() -> None:
    """Serve until standard input ends."""
    find_modes = engine(sys.argv[1])
    print(f"{DONE} 0", flush=True)
    for line in sys.stdin:
        problem, answer, seconds, megabytes = line.rstrip("\n").split("\t")
        fork = os.fork()
        if fork == 0:
            os.dup2(2, 1)
            _answer(find_modes, Path(problem), Path(answer), float(seconds), float(megabytes))
            os._exit(0)
        print(f"{DONE} {_waited(fork, 60 + CLOCK_OVER_PROCESSOR * float(seconds))}", flush=True)


def _answer(find_modes: Callable[[Problem], Answer], given: Path, told: Path, seconds: float, megabytes: float) -> None:
    """Limit memory and time, run, write the answer; an exception is an answer too."""
    problem = read_problem(given)
    limit = int((_kept("VmSize") + megabytes) * 1e6)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    base, began = _kept("VmRSS"), time.process_time()
    signal.setitimer(signal.ITIMER_PROF, seconds)  # no handler: the signal ends the process in any code
    try:
        answer = find_modes(problem)
    except BaseException as fault:  # whatever goes wrong inside an engine is its result
        said = " ".join(str(fault).split())
        answer = Answer((), "failed", (f"{type(fault).__name__}: {said}"[:400],))
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    answer = replace(answer, seconds=time.process_time() - began, peak_mb=_kept("VmHWM"), base_mb=base)
    write_answer(answer, told)


def _waited(fork: int, most: float) -> int:
    """Exit code of the fork, minus the number of the signal that ended it."""
    until = time.monotonic() + most
    while True:
        ended, status = os.waitpid(fork, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() > until:
            with contextlib.suppress(ProcessLookupError):
                os.kill(fork, signal.SIGKILL)
        time.sleep(0.02)


def _kept(field: str) -> float:
    """MB, from the kernel's account of this process."""
    for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
        if line.startswith(field):
            return float(line.split()[1]) / 1000
    return float("nan")


if __name__ == "__main__":
    main()
