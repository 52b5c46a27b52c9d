"""Accuracy and speed on this machine, on one page: `python -m benchmarks [--only NAME ...] [--out docs/accuracy.md]`.

Runs the benchmarks of this folder one after the other, each in a process of its own, and writes what they print, with
date, version and machine. `--list` names them. What fails, or takes too long, stands in the page as such.
"""

import argparse
import os
import platform
import subprocess
import sys
import textwrap
import time
import tomllib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
TRIALS = Path(__file__).with_name("trial_results.toml")
WIDEST = 115
"""Characters of a line of the page at most; longer ones are folded."""

LIMIT = 1800.0
"""Seconds after which a benchmark is stopped."""


@dataclass(frozen=True)
class Benchmark:
    """A benchmark by its module, the options that it is given here, and the question that it answers."""

    name: str
    question: str
    reading: str
    options: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """What a reader types to repeat it."""
        return " ".join(["python -m", f"benchmarks.{self.name}", *self.options])


BENCHMARKS = (
    Benchmark(
        "accuracy",
        "How accurate are fits of stacked milling sweeps?",
        "Simulated robot with the close pair of Mohammadi & Ahmadi's table 1 (16.99 Hz, 2.85 %; 18.48 Hz, 9.96 %), "
        "three immersions, 60 s each. 'Nearest pole' uses the truth. The H1 contains leakage; fits of "
        "recordings (subspace) do not.",
        ("--seeds", "2"),
    ),
    Benchmark(
        "sweep_excitation",
        "How do sweeps compare with sweep milling force excitation (Franco et al.)?",
        "Their machine and layouts, and the immersions of `plan`, through both methods. Conditions of the force "
        "spectra and of their matrix; shares of entries whose band (two sets; 95 %) holds the truth.",
    ),
    Benchmark(
        "narrow_fits",
        "What do lobes of fits in a narrow band cost?",
        "Error of the lowest depth limit with out-of-band poles, and with one residual flexibility.",
    ),
    Benchmark(
        "lab_mistakes",
        "Which mistakes of a laboratory change a limit in silence?",
        "Each mistake is made in good recordings or taps of a simulated cell. The change is that of 13 limits. "
        "'Uncertain': no step doubts the inputs, but no limit that changes by more than 5 % is called verified.",
        ("--right", "20"),
    ),
    Benchmark(
        "pole_speed",
        "How long do poles of all orders take, compared with other packages?",
        "801 lines, 3 references. Degree 30 here equals order 60 of the peers.",
    ),
    Benchmark(
        "frf_speed",
        "How long does an FRF matrix take, compared with other packages?",
        "3 forces at 10 240 Hz. The lean numpy H1 has no coherence and no covariance.",
        ("--seconds", "120"),
    ),
    Benchmark(
        "fit_speed",
        "How long does a fit of recordings take?",
        "A dense step is one product of a Jacobian that is already there.",
    ),
    Benchmark(
        "lobe_speed",
        "How long do lobes take, compared with plain semi-discretisation?",
        "'traced': certified solver; 'grid': multipliers at each speed and depth.",
    ),
    Benchmark(
        "diagnosis_speed",
        "What does a diagnosis cost, in Fourier transforms of one prediction?",
        "The floor is one prediction of the responses.",
    ),
    Benchmark("path_speed", "How long do postures along a tool path take?", "20 points of a path, two cores.", ("20",)),
    Benchmark(
        "simulated_cell",
        "How much faster than real time is the simulated cell?",
        "Milling and hammer tests with sensor chains.",
        ("20",),
    ),
    Benchmark(
        "acquisition_speed",
        "What does recording take of the processor?",
        "24 channels at 51.2 kHz for a minute, NI driver.",
    ),
    Benchmark("import_speed", "How long does an import take?", "In fresh processes."),
)
"""Those that print a table in minutes. Trials of hours have commands of their own; ``trial_results.toml`` holds what
they printed."""


def main() -> int:
    """Run what is asked for and write the page; returns 1 where a benchmark failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=[benchmark.name for benchmark in BENCHMARKS])
    parser.add_argument("--out", type=Path, metavar="PAGE.md", help="page to write; else the terminal alone")
    parser.add_argument("--list", action="store_true", help="name the benchmarks and end")
    options = parser.parse_args()
    chosen = [benchmark for benchmark in BENCHMARKS if options.only is None or benchmark.name in options.only]
    if options.list:
        print(*(f"{benchmark.name:18s} {benchmark.question}" for benchmark in chosen), sep="\n")
        return 0
    page, failures = [_head([benchmark for benchmark in BENCHMARKS if benchmark not in chosen])], 0
    for benchmark in chosen:
        print(f"== {benchmark.command}", flush=True)
        printed, ending, seconds = run(benchmark)
        print(printed, ending, sep="\n", flush=True)
        failures += bool(ending)
        page.append(_section(benchmark, printed, ending, seconds))
    page += map(_trial, tomllib.loads(TRIALS.read_text(encoding="utf-8"))["trial"])
    if options.out:
        unfinished = options.out.with_suffix(".unfinished")
        unfinished.write_text("\n".join(page), encoding="utf-8")
        unfinished.replace(options.out)
        print(options.out)
    return int(failures > 0)


def run(benchmark: Benchmark, limit: float = LIMIT) -> tuple[str, str, float]:
    """Standard output of a benchmark, how it ended otherwise than in order, and its seconds."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", f"benchmarks.{benchmark.name}", *benchmark.options]
    started = time.monotonic()
    try:
        ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired as error:
        said = error.stdout.decode() if isinstance(error.stdout, bytes) else error.stdout or ""
        return said.strip(), f"stopped after {limit:.0f} s", limit
    ending = ""
    if ended.returncode:
        last = ended.stderr.strip().splitlines()[-1:] or ["no message"]
        ending = f"ended with code {ended.returncode}: {last[0]}"
    return ended.stdout.strip(), ending, time.monotonic() - started


def machine() -> list[tuple[str, str]]:
    """What a time depends on, in words without the machine's name."""
    import matplotlib
    import numpy as np
    import scipy

    from millfrf import __version__

    load = f"{os.getloadavg()[0]:.1f} processes waiting" if hasattr(os, "getloadavg") else "not known"
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    libraries = (("numpy", np), ("scipy", scipy), ("matplotlib", matplotlib))
    versions = ", ".join(f"{name} {module.__version__}" for name, module in libraries)
    return [
        ("date", datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")),
        ("millfrf", f"{__version__}, commit {_commit()}"),
        ("processor", f"{_processor()}, {cores} cores"),
        ("memory", _memory()),
        ("system", f"{platform.system()} {platform.machine()}"),
        ("Python", f"{platform.python_version()}, {versions}"),
        ("load before", f"{load}: where it is above the cores, other work shared the machine"),
    ]


def _head(left_out: list[Benchmark]) -> str:
    """What the page is, on which machine, and which benchmarks it does not have."""
    names = ", ".join(f"`{benchmark.name}`" for benchmark in left_out)
    rows = "\n".join(f"| {name} | {value} |" for name, value in machine())
    return f"""# Accuracy and speed

`python -m benchmarks --out docs/accuracy.md` writes this page. Comparisons run one after the other, with one thread of
linear algebra. Results of trials that take hours are at the end (`benchmarks/trial_results.toml`).

| | |
|---|---|
{rows}
""" + (f"\nNot run this time: {names}.\n" if names else "")


def _section(benchmark: Benchmark, printed: str, ending: str, seconds: float) -> str:
    warning = f"\n**{ending}**\n" if ending else ""
    folded = "\n".join(textwrap.fill(line, WIDEST, subsequent_indent="    ") for line in printed.splitlines())
    reading = textwrap.fill(benchmark.reading, WIDEST)
    command = f"`{benchmark.command}` ({seconds:.0f} s)"
    return f"## {benchmark.question}\n\n{reading}\n\n{command}\n{warning}\n```text\n{folded}\n```\n"


def _trial(trial: dict[str, Any]) -> str:
    """Section of a trial whose results are stored."""
    rows = [trial["columns"], ["---"] * len(trial["columns"]), *trial["rows"]]
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    reading = textwrap.fill(" ".join(trial["reading"].split()), WIDEST)
    return f"## {trial['question']}\n\n{reading}\n\n`{trial['command']}` ({trial['date']})\n\n{table}\n"


def _commit() -> str:
    result = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    return result.stdout.strip() or "not known"


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        names = [line for line in information.read_text().splitlines() if line.startswith("model name")]
        if names:
            return names[0].partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _memory() -> str:
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GB"
    return "not known"


if __name__ == "__main__":
    sys.exit(main())
