"""FRFs of other laboratories: ``python -m benchmarks.frf_trial.measured --out DIR [--engine ours] [--only subsets]``.

Each run's answer is kept in ``DIR/ENGINE/measured/NAME.json``; started again, the command goes on where it was. Rivals
need ``--python``, as in :mod:`.run_trial`.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from .engines import ENGINES
from .isolated import Limits, running
from .measured_sets import MeasuredRun, beam_runs, plane_runs
from .problem import FoundMode, read_answer
from .scoring import Score, partners, score


def main() -> None:
    """Run what is waiting, score, print."""
    options = _options()
    limits = Limits(options.timeout, options.megabytes, options.python)
    wanted = [part for part in options.only.split(",") if part]
    chosen = [run for run in (*plane_runs(), *beam_runs()) if _is_wanted(run, wanted)]
    if not chosen:
        groups = ", ".join(sorted({run.group for run in (*plane_runs(), *beam_runs())}))
        sys.exit(f"no run is called {options.only!r}; groups: {groups}")
    folder: Path = options.out / options.engine / "measured"
    waiting = [run for run in chosen if options.again or not (folder / f"{run.name}.json").exists()]
    if waiting:
        with running(options.engine, limits) as engine:
            for run in waiting:
                engine.ask(run.problem, folder / f"{run.name}.json")
                print(line(run, _judged(run, folder)), file=sys.stderr, flush=True)
    scores = [(run, _judged(run, folder)) for run in chosen]
    print(report(scores, ENGINES[options.engine][1]))


def _is_wanted(run: MeasuredRun, wanted: list[str]) -> bool:
    return not wanted or any(name in (run.group, run.name) for name in wanted)


def _judged(run: MeasuredRun, folder: Path) -> Score:
    """Score of the answer without the modes outside of where inventions are counted."""
    answer = read_answer(folder / f"{run.name}.json")
    low, high = run.counted
    return score(run.truth, replace(answer, modes=tuple(m for m in answer.modes if low <= m.frequency_hz <= high)))


def line(run: MeasuredRun, one: Score) -> str:
    """What the screen shows of a run."""
    cost = f"{one.answer.seconds:6.1f} s  {one.answer.peak_mb:5.0f} MB"
    text = f"{run.name:24s} {len(one.matches):2d}/{one.demanded}  {cost}"
    if one.missed:
        text += "  missed " + " ".join(f"{mode['frequency_hz']:g}" for mode in one.missed)
    if one.invented:
        text += "  invented " + " ".join(f"{m.frequency_hz:.2f} ({100 * m.damping_ratio:.2g} %)" for m in one.invented)
    said = "" if one.answer.status == "ok" else f"  {one.answer.status}: {' '.join(one.answer.said)[:120]}"
    return text + said


def report(scores: list[tuple[MeasuredRun, Score]], title: str) -> str:
    """Markdown: a row a group; below, how far other layouts and edges agree with the whole."""
    heads = "| runs | n | modes found | least | invented | most | s | MB |"
    lines = [f"## {title}: FRFs of other laboratories", "", heads, "|---" * 8 + "|"]
    for group in dict.fromkeys(run.group for run, _ in scores):
        own = [each for run, each in scores if run.group == group]
        result, invented = [len(s.matches) for s in own], [len(s.invented) for s in own]
        demanded, seconds = sum(s.demanded for s in own), max(s.answer.seconds for s in own)
        cells = [group, len(own), f"{sum(result)} of {demanded}", min(result), sum(invented), max(invented)]
        cells += [f"{seconds:.1f}", f"{max(s.answer.peak_mb for s in own):.0f}"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    whole = next((each for run, each in scores if run.group == "whole"), None)
    for group in ("transposed", "band edges", "subsets", "one sensor"):
        others = [each for run, each in scores if run.group == group]
        if whole is not None and others:
            lines += ["", f"{group.capitalize()} against the whole: {agreement(whole, others)}"]
    return "\n".join(lines) + "\n"


def agreement(whole: Score, others: list[Score]) -> str:
    """Differences of published modes found both times, and how many stay within 1.96 times the larger bar."""
    pairs = []
    for other in others:
        here, there = partners(whole), partners(other)
        pairs += [(here[k], there[k]) for k in here if k in there]
    if not pairs:
        return "no mode in common"
    texts = []
    for value, error in (("frequency_hz", "frequency_error"), ("damping_ratio", "damping_error")):
        texts.append(f"{value.split('_')[0]} {_differences(pairs, value, error)}")
    return "; ".join(texts)


def _differences(pairs: list[tuple[FoundMode, FoundMode]], value: str, error: str) -> str:
    a, b = (np.array([getattr(mode, value) for mode in side]) for side in zip(*pairs, strict=True))
    text = f"median {100 * np.median(np.abs(b / a - 1)):.3g} %, largest {100 * np.max(np.abs(b / a - 1)):.3g} %"
    bars = [[getattr(mode, error) for mode in pair] for pair in pairs]
    stated = [k for k, pair in enumerate(bars) if None not in pair]
    within = sum(abs(b[k] - a[k]) <= 1.96 * max(bars[k]) for k in stated)
    return text + (f", {within} of {len(stated)} within their bars" if stated else "")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.frf_trial.measured", description=__doc__)
    parser.add_argument("--engine", choices=list(ENGINES), default="ours")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has the engine's packages")
    parser.add_argument("--out", type=Path, required=True, help="folder; unfinished runs there are gone on with")
    parser.add_argument("--only", default="", help="groups or names, with commas between")
    parser.add_argument("--timeout", type=float, default=120.0, help="s of the processor a run")
    parser.add_argument("--megabytes", type=float, default=6000.0, help="memory a run may address")
    parser.add_argument("--again", action="store_true", help="run what has an answer once more")
    return parser.parse_args()


if __name__ == "__main__":
    try:
        main()
    except ChildProcessError as fault:
        sys.exit(str(fault))
