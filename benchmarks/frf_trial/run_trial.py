"""The one command: ``python -m benchmarks.frf_trial.run_trial --cases 200 --seed 1 --out DIR [--engine ours]``.

Every case is drawn from the seed and its number, given to the engine in a process of its own (limits of time and
memory), and its answer kept in ``DIR/ENGINE/NNNN.json``. Started again, it goes on where it was. The table goes to the
screen and to ``DIR/ENGINE/results.md``, a line a case to ``DIR/ENGINE/cases.csv``.

Rivals (``--engine sdypy | sdynpy | pyoma``) run in an environment of their own, whose interpreter ``--python`` names::

    python -m venv /somewhere/rivals
    /somewhere/rivals/bin/pip install "sdypy-EMA==0.31.0" "sdynpy==0.23.0" "pyOMA-2==1.4.3"
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from .engines import ENGINES
from .isolated import Limits, running
from .problem import read_answer
from .scoring import Score, score
from .sets import GENERATOR, draw_set
from .tables import report


def main() -> None:
    """Run what is waiting, score, print."""
    options = _options()
    out: Path = options.out
    _same_trial(out, options.seed)
    limits = Limits(options.timeout, options.megabytes, options.python)
    numbers = _numbers(options.only) if options.only else range(options.first, options.first + options.cases)
    waiting = [n for n in numbers if options.again or not (out / options.engine / f"{n:04d}.json").exists()]
    if waiting and not options.score_only:
        with running(options.engine, limits) as engine:
            for number in waiting:
                case = draw_set(options.seed, number)
                _write(out / "truth" / f"{number:04d}.json", case.truth)
                answer = engine.ask(case.problem, out / options.engine / f"{number:04d}.json")
                print(line(score(case.truth, answer)), file=sys.stderr, flush=True)
    scores = read_scores(out, options.engine, numbers)
    if not scores:
        sys.exit("no case has run; see the messages above")
    text = report(scores, f"{ENGINES[options.engine][1]}: {len(scores)} simulated sets, seed {options.seed}")
    (out / options.engine / "results.md").write_text(text, encoding="utf-8")
    _write_cases(out / options.engine / "cases.csv", scores)
    print(text)


def read_scores(out: Path, engine: str, numbers: Any) -> list[Score]:
    """Scores of the cases that have run."""
    scores = []
    for number in numbers:
        answer_path = out / engine / f"{number:04d}.json"
        if answer_path.exists():
            truth = json.loads((out / "truth" / f"{number:04d}.json").read_text(encoding="utf-8"))
            scores.append(score(truth, read_answer(answer_path)))
    return scores


def line(one: Score) -> str:
    """What the screen shows of a case."""
    truth, answer = one.truth, one.answer
    shape = f"{truth['n_responses']} x {truth['n_excitations']}, {truth['n_lines']} lines, {truth['quantity']}"
    missed = " ".join(f"{m['frequency_hz']:.4g}{'*' if m.get('in_pair') else ''}" for m in one.missed)
    invented = " ".join(f"{m.frequency_hz:.4g}" for m in one.invented)
    text = f"{truth['number']:4d}  {len(one.matches)}/{one.demanded}  {answer.seconds:5.1f} s  {answer.peak_mb:5.0f} MB"
    text += f"  {shape}" + (f"  missed {missed}" if missed else "") + (f"  invented {invented}" if invented else "")
    return text if answer.status == "ok" else f"{text}  {answer.status}: {' '.join(answer.said)[:150]}"


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.frf_trial.run_trial", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--cases", type=int, default=200, help="how many cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--only", default="", help="numbers of cases instead, like 3,17,20-25")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--engine", choices=list(ENGINES), default="ours")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has the engine's packages")
    parser.add_argument("--out", type=Path, required=True, help="folder; an unfinished trial there is gone on with")
    parser.add_argument("--timeout", type=float, default=120.0, help="s of the processor a case")
    parser.add_argument("--megabytes", type=float, default=6000.0, help="memory a case may address")
    parser.add_argument("--again", action="store_true", help="run cases that have an answer once more")
    parser.add_argument("--score-only", action="store_true", help="score what has run")
    return parser.parse_args()


def _numbers(text: str) -> list[int]:
    chosen: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        chosen += range(int(first), int(last or first) + 1)
    return chosen


def _same_trial(out: Path, seed: int) -> None:
    """Note seed and generator, or refuse to mix two."""
    out.mkdir(parents=True, exist_ok=True)
    note, own = out / "trial.json", {"seed": seed, "generator": GENERATOR}
    if note.exists() and json.loads(note.read_text(encoding="utf-8")) != own:
        sys.exit(f"{out} holds another trial: {note.read_text(encoding='utf-8').strip()}; choose another folder")
    _write(note, own)


def _write(path: Path, content: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content) + "\n", encoding="utf-8")


def _write_cases(path: Path, scores: list[Score]) -> None:
    """One line a case, for who wants to look closer."""
    keys = ("number", "quantity", "noise", "noise_of", "told", "n_lines", "n_responses", "n_excitations")
    rows = [",".join((*keys, "lines_per_bandwidth", "pairs", "demanded", "found", "missed", "invented", "status", "s"))]
    for each in scores:
        cells = [str(each.truth[key]) for key in keys]
        cells += [f"{each.truth['lines_per_bandwidth']:.1f}", str(len(each.truth["pairs"])), str(each.demanded)]
        cells += [str(len(each.answer.modes)), str(len(each.missed)), str(len(each.invented)), each.answer.status]
        rows.append(",".join([*cells, f"{each.answer.seconds:.2f}"]))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    try:
        main()
    except ChildProcessError as fault:
        sys.exit(str(fault))
