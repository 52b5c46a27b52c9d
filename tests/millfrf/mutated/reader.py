"""A program that reads mutated files through the command line, each in a copy of itself with limits.

    python reader.py FOLDER WORK FIRST LAST

Mutations FIRST to before LAST are dealt to the kinds in turn. Every line on standard output is a file that did not end
as it must: exit code 0, or one line that the product foresees, within 10 s of the processor and 1 GB.
"""

import importlib.util
import os
import re
import resource
import shutil
import signal
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import h5py
import numpy as np

SECONDS, MEMORY = 10.0, 1_000_000_000
LONGEST = 6 * SECONDS  # a busy computer gives a program a part of its time


def _load(name: str) -> Any:
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
    if "does not foresee" in said or "unforeseen" in said or "not enough memory" in said:
        return said[-300:]
    if seconds > SECONDS:
        return f"took {seconds:.1f} s"
    return f"took {gigabytes:.2f} GB" if gigabytes > 1.0 else ""


def not_finite(folder: Path) -> str:
    """Name an output in which a number is infinite, or is none where only samples may be missing; empty: none."""
    for path in folder.glob("out.*"):
        if path.suffix == ".json" and re.search(r"\b(NaN|Infinity)\b", path.read_text(encoding="utf-8")):
            return f"{path.name} holds a number that is not finite"
        if path.suffix == ".h5":
            with h5py.File(path) as file:
                names: list[str] = []
                file.visit(names.append)
                for name in names:
                    values = file[name][()] if isinstance(file[name], h5py.Dataset) else np.zeros(1)
                    may_miss = name.endswith(("/samples", "coherence"))
                    if values.dtype.kind in "fc" and (np.isinf(values) if may_miss else ~np.isfinite(values)).any():
                        return f"{path.name}: {name} holds a number that is not finite"
    return ""


def load_all(kinds: list[Any], folder: Path) -> None:
    """Run every command once with good files, so that the copies find all that it loads and compiles."""
    from millfrf.command_line import run

    with Path(os.devnull).open("w") as sink, redirect_stdout(sink), redirect_stderr(sink):
        for kind in kinds:
            good = str(kind.good_file(folder, 0).relative_to(folder))
            for command in kind.commands:
                assert run(command.replace("FILE", good).split()) in (0, 1, 2), command
                _remove_outputs(folder)


def _remove_outputs(folder: Path) -> None:
    for out in folder.glob("out.*"):
        shutil.rmtree(out) if out.is_dir() else out.unlink()


def main() -> None:
    """Deal the mutations to the kinds."""
    kinds, mutations = _load("kinds").KINDS, _load("mutations")
    folder, work, first, last = Path(sys.argv[1]).resolve(), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    os.chdir(folder)
    load_all(kinds, folder)
    for number in range(first, last):
        kind, turn = kinds[number % len(kinds)], number // len(kinds)
        good = kind.good_file(folder, turn)
        content, path = good.read_bytes(), kind.mutated_file(good)
        path.write_bytes(mutations.mutated(content, turn, text=kind.text))
        command = kind.commands[turn % len(kind.commands)].replace("FILE", str(path.relative_to(folder)))
        if said := judged(command.split()) or not_finite(folder):
            shutil.copy(path, work / f"{number}_{path.name}")
            print(f"{number} {command}: {' '.join(said.split())}", flush=True)
        path.write_bytes(content)
        _remove_outputs(folder)
        if not (number + 1) % 100:
            print(f"{number + 1} read", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
