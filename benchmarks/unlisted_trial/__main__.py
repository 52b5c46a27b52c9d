"""Effects that the library does not list: `python -m benchmarks.unlisted_trial --seed 1 --cases 40 --workers 2`.

Small rigs (an arm, a beam, a mass on a rail, a mass on a shaken base) are simulated with one hidden effect each, half
of them without a name in the library; a quarter of the cases hides nothing. The nominal model has errors of up to 1 %
in frequency, 10 % in damping and 5 % in shapes. The simulator shares nothing with the product but the formats of files.

A verdict is wrong if it names a cause that does not describe the same physics (``allowed``), if it is `none` on an
effect above twice the noise, or anything but `none` where nothing is hidden (`modal_parameters` is right where the
nominal model has its full error). ``size`` is the change of the responses by the effect over the noise on the same
forces, in the band of the modes; ``beyond`` is the part of it that no linear model of as many modes can follow.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from .cases import Case, beyond_linear, drawn, prepared, written
from .effects import NOTHING


def run_case(case: Case, folder: Path, limit: float) -> dict[str, Any]:
    """Simulate a case, run the diagnosis on its files in a process of its own, and judge the answer."""
    folder.mkdir(parents=True, exist_ok=True)
    case, noise = prepared(case)
    facts = written(case, noise, folder)
    facts["beyond"] = 0.0 if case.effect == NOTHING else beyond_linear(case, noise)
    files = [str(folder / name) for name in ("nominal.json", "run_0.h5", "run_1.h5", "run_2.h5")]
    command = [sys.executable, "-m", "millfrf", "diagnose", *files, "--out", str(folder / "diagnosis")]
    began, spent = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
        said = done.stdout + done.stderr
    except subprocess.TimeoutExpired:
        said = f"no answer in {limit:g} s"
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = used.ru_utime + used.ru_stime - spent.ru_utime - spent.ru_stime
    facts |= {"seconds": time.perf_counter() - began, "processor": processor, "said": said}
    stored = folder / "diagnosis" / "diagnosis.json"
    answer: dict[str, Any] = {"verdict": "failed", "physics": []}
    if stored.exists():
        answer = json.loads(stored.read_text(encoding="utf-8"))
    named = [cause["name"] for cause in answer["physics"]]
    facts |= {"verdict": answer["verdict"], "named": named, "equivalents": answer.get("equivalents", [])}
    facts |= {"index": case.index, "effect": case.effect.name, "allowed": case.effect.allowed, "rig": case.rig.kind}
    facts |= {"drive": case.drive, "off": case.off, "noise": case.noise_share, "force_noise": case.force_noise}
    return {**facts, "dial": case.dial, "outcome": outcome(case, facts)}


def outcome(case: Case, facts: dict[str, Any]) -> str:
    """Judge an answer: right, cautious (no name for what has one), equivalent, none, wrong, false alarm, failed."""
    verdict, named = facts["verdict"], set(facts["named"])
    wrong = named - set(case.effect.allowed) - ({"modal_parameters"} if case.off == 1.0 else set())
    if verdict == "failed":
        return "failed"
    if case.effect == NOTHING:
        return "right" if not wrong and (verdict == "none" or named) else "false alarm"
    if wrong:
        listed = set(facts["equivalents"]) & set(case.effect.allowed) and len(wrong) == 1
        return "equivalent" if listed else "wrong"
    if verdict == "none" or (named == {"modal_parameters"} and "modal_parameters" not in case.effect.allowed):
        return "none" if facts["size"] > 2.0 else "too small"
    return "cautious" if case.effect.allowed and not named else "right"


def table(results: list[dict[str, Any]]) -> str:
    """Return counts and a line for each case, as a page."""
    outcomes = [result["outcome"] for result in results]
    counts = ", ".join(f"{outcomes.count(name)} {name}" for name in dict.fromkeys(sorted(outcomes)))
    seconds = [result["processor"] for result in results]
    times = f"{np.median(seconds):.0f} s of processor in the median, {max(seconds):.0f} s at most"
    head = f"{len(results)} cases: {counts}; {times}"
    lines = ["| case | effect | rig, drive | noise % | off | size | beyond | allowed | verdict | named | s | outcome |"]
    lines.append("|" + "---|" * 12)
    for r in results:
        cells = [r["index"], r["effect"], f"{r['rig']}, {r['drive']}", f"{100 * r['noise']:.2g}", r["off"]]
        cells += [
            f"{r['size']:.3g}",
            f"{r['beyond']:.3g}",
            ", ".join(r["allowed"]),
            r["verdict"],
            ", ".join(r["named"]),
        ]
        lines.append("| " + " | ".join(map(str, [*cells, f"{r['processor']:.0f}", r["outcome"]])) + " |")
    return "\n".join([head, "", *lines, ""])


def main() -> None:
    """Run the cases, print the table and write it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.unlisted_trial", description=__doc__.split("\n\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of the cases to run")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, default=900.0, help="s until a diagnosis is stopped")
    parser.add_argument("--out", type=Path, help="folder for results.md, results.json and the files of the cases")
    options = parser.parse_args()
    chosen = [case for case in drawn(options.seed, options.cases) if options.only is None or case.index in options.only]
    with tempfile.TemporaryDirectory() as temporary, ProcessPoolExecutor(options.workers) as pool:
        out = options.out or Path(temporary)
        jobs = [pool.submit(run_case, case, out / f"case_{case.index:02d}", options.limit) for case in chosen]
        results = []
        for job in jobs:
            results.append(job.result())
            print(table(results[-1:]).splitlines()[-1], file=sys.stderr, flush=True)
            if options.out:
                (out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
                (out / "results.md").write_text(table(results), encoding="utf-8")
    print(table(results))


if __name__ == "__main__":
    main()
