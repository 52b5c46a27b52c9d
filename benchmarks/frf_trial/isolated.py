"""Put problems to an engine that runs each in a process of its own, with limits of time and memory."""

import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from .child import DONE
from .problem import Answer, Problem, read_answer, write_answer, write_problem


@dataclass(frozen=True)
class Limits:
    """What a process may use.

    Parameters
    ----------
    seconds : s
        Time of the processor, so that a busy machine judges no engine; six times as long (and a minute) by the clock.
    megabytes
        That its work may address beyond imports and the FRFs.
    python
        The interpreter that has the engine's packages.
    """

    seconds: float = 120.0
    megabytes: float = 6000.0
    python: str = sys.executable


@dataclass(frozen=True)
class RunningEngine:
    """An engine that waits for problems; :func:`running` starts and ends one."""

    process: subprocess.Popen[str]
    limits: Limits
    folder: Path

    def ask(self, problem: Problem, keep: Path | None = None) -> Answer:
        """The engine's answer, or why there is none; written to ``keep`` where given."""
        given, stated = self.folder / "problem.npz", self.folder / "answer.json"
        stated.unlink(missing_ok=True)
        write_problem(problem, given)
        words = (given, stated, self.limits.seconds, self.limits.megabytes)
        _pipe(self.process.stdin).write("\t".join(map(str, words)) + "\n")
        _pipe(self.process.stdin).flush()
        answer = self._answer(stated, _exit_code(self.process))
        if keep is not None:
            keep.parent.mkdir(parents=True, exist_ok=True)
            write_answer(answer, keep)
        return answer

    def _answer(self, told: Path, code: int | None) -> Answer:
        if code is None:
            raise ChildProcessError(f"the engine's process ended: {_last_line(self.folder / 'said.txt')}")
        if told.exists():
            return read_answer(told)
        if code in (-signal.SIGPROF, -signal.SIGKILL):
            return Answer((), "too slow", (f"stopped after {self.limits.seconds:g} s",), self.limits.seconds)
        return Answer((), "killed", (f"exit code {code}: {_last_line(self.folder / 'said.txt')}",))


@contextmanager
def running(engine: str, limits: Limits) -> Iterator[RunningEngine]:
    """Start an engine, and end it.

    Raises
    ------
    ChildProcessError
        It does not start: its packages are missing in ``limits.python``, or it has been ended from outside.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = [limits.python, "-m", "benchmarks.frf_trial.child", engine]
        with (
            (folder / "said.txt").open("w", encoding="utf-8") as said,
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said, text=True) as process,
        ):
            if _exit_code(process) is None:
                last = _last_line(folder / "said.txt")
                raise ChildProcessError(
                    f"{' '.join(command)}: {last}; name the interpreter that has the engine with --python"
                )
            try:
                yield RunningEngine(process, limits, folder)
            finally:
                _pipe(process.stdin).close()


def _exit_code(process: subprocess.Popen[str]) -> int | None:
    """What the process says next; None where it has ended."""
    for line in _pipe(process.stdout):
        if line.startswith(DONE):
            return int(line.split()[1])
    return None


def _pipe(pipe: IO[str] | None) -> IO[str]:
    assert pipe is not None
    return pipe


def _last_line(path: Path) -> str:
    lines = path.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1][:300] if lines else "no message"
