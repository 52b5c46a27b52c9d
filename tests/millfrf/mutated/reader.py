"""A program that reads mutated files through the command line, each in a copy of itself with limits.

    python reader.py FOLDER WORK FIRST LAST

Mutations FIRST to before LAST are dealt to the kinds in turn. Every line on standard output is a file that did not end
as it must: exit code 0, or one line that the product foresees, within 10 s of the processor and 1 GB.
"""

import importlib.util
import os
import resource
import shutil
import signal
import sys
import time
from pathlib import Path

SECONDS, MEMORY = 10.0, 1_000_000_000
LONGEST = 6 * SECONDS  # a busy computer gives a program a part of its time


def _load(name: str) -> object:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def read(words: list[str], sink: int) -> None:
    """In the copy: run the command line under a limit of memory."""
    os.dup2(sink, 1)
    os.dup2(sink, 2)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
    from millfrf.command_line import run

    code = run(words)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def judged(words: list[str]) -> str:
    """What is wrong with how a command line ended; empty: nothing."""
    source, sink = os.pipe()
    began, child = time.monotonic(), os.fork()
    if child == 0:
        read(words, sink)
    os.close(sink)
    while not (done := os.wait4(child, os.WNOHANG))[0]:
        if time.monotonic() - began > LONGEST:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            os.close(source)
            return f"took more than {LONGEST:g} s"
        time.sleep(0.002)
    with os.fdopen(source, "rb") as pipe:
        said = pipe.read().decode("utf-8", "replace")
    code = os.waitstatus_to_exitcode(done[1])
    return wrong(code, said, done[2])


def wrong(code: int, said: str, used: resource.struct_rusage) -> str:
    """What is wrong with an exit code, what was said, and the memory and time that were used."""
    gigabytes, seconds = used.ru_maxrss / 1e6, used.ru_utime + used.ru_stime
    lines = [line for line in said.splitlines() if line.startswith("millfrf: ")]
    if code not in (0, 1, 2) or (code and len(lines) != 1) or "Traceback" in said:
        return f"ended with {code}: {said[-300:]}"
    if "does not foresee" in said or "not enough memory" in said:
        return said[-300:]
    if seconds > SECONDS:
        return f"took {seconds:.1f} s"
    return f"took {gigabytes:.2f} GB" if gigabytes > 1.0 else ""


def main() -> None:
    """Deal the mutations to the kinds."""
    import millfrf.__main__
    import millfrf.reports.page
    import millfrf.steps.given  # noqa: F401  # what every kind needs is loaded once

    kinds, mutations = _load("kinds"), _load("mutations")
    folder, work, first, last = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    os.chdir(folder)
    for number in range(first, last):
        kind = kinds.KINDS[number % len(kinds.KINDS)]  # type: ignore[attr-defined]
        turn = number // len(kinds.KINDS)  # type: ignore[attr-defined]
        good = (folder / kind.file).read_bytes()
        name = kind.file if kind.file == "other.dbc" else f"mutated_{kind.file}"
        (folder / name).write_bytes(mutations.mutated(good, turn, text=kind.text))  # type: ignore[attr-defined]
        for command in [kind.commands[turn % len(kind.commands)]]:
            said = judged(command.replace("FILE", name).split())
            if said:
                shutil.copy(folder / name, work / f"{number}_{kind.file}")
                print(f"{number} {command.replace('FILE', kind.file)}: {' '.join(said.split())}", flush=True)
        (folder / name).write_bytes(good)
        for out in folder.glob("out.*"):
            out.unlink()


if __name__ == "__main__":
    main()
