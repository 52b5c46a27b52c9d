"""The one command: ``python -m benchmarks.blind_trial.run_trial --cases 1000 --seed 1 --workers 2 --out DIR``.

Per case: simulate, seal the truth, run the tool on the lab's side of it, keep its diagnosis. When all have run, the
seals are checked and opened, and the scores printed and written to ``DIR/results.md``. Started again, it goes on where
it was.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import json
import shlex
import shutil
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from .case_spec import CaseSpec, draw_cases
from .diagnosis_reading import read_answer
from .scoring import Score, held_out_errors, score_case
from .sealed_case import case_name, open_truth, write_case
from .tables import report

GIVEN = ("low.h5", "mid.h5", "high.h5")
"""What the tool is given; ``unseen.h5`` never."""


def run_case(spec: CaseSpec, out: Path, tool: list[str], timeout: float, keep: bool) -> str:
    """Simulate, seal, diagnose and predict one case; return a line for the screen."""
    name = case_name(spec.index)
    folder, answers = write_case(spec, out), out / "answers" / name
    # a trial that was stopped here may have left some of the answer, which the tool does not replace
    shutil.rmtree(answers, ignore_errors=True)
    answers.mkdir(parents=True)
    given = [str(folder / file) for file in GIVEN if (folder / file).exists()]
    began = time.perf_counter()
    command = [*tool, "diagnose", str(folder / "nominal.json"), *given, "--out", str(answers)]
    code, said = _call(command, timeout)
    seconds = time.perf_counter() - began
    improved, prediction = answers / "improved_model.json", answers / "prediction.h5"
    errors = None
    # a control has no error to remove
    if improved.exists() and spec.effect != "none":
        _call([*tool, "predict", str(improved), str(folder / "unseen.h5"), "--out", str(prediction)], timeout)
    if prediction.exists():
        errors = held_out_errors(folder, prediction)
    result = {"exit_code": code, "seconds": seconds, "held_out": errors, "said": said[-2000:]}
    for file in [] if keep else [*folder.glob("*.h5"), prediction, answers / "report.html"]:
        file.unlink(missing_ok=True)
    (answers / "run.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return f"{name}  exit {code}  {seconds:6.1f} s"


def _call(command: list[str], timeout: float) -> tuple[int, str]:
    """Exit code (124: too slow) and what was said on standard error."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return 124, f"stopped after {timeout:g} s"
    return done.returncode, done.stderr


def score_all(out: Path, specs: list[CaseSpec]) -> list[Score]:
    """Check and open the seals of all cases that have run, and score them."""
    scores = []
    for spec in specs:
        name = case_name(spec.index)
        run = out / "answers" / name / "run.json"
        if not run.exists():
            continue
        facts: dict[str, Any] = json.loads(run.read_text(encoding="utf-8"))
        answer = read_answer(run.with_name("diagnosis.json"))
        scores.append(score_case(name, open_truth(out, name), answer, facts))
    return scores


def main() -> None:
    """Run, score, print."""
    options = _options()
    out: Path = options.out
    out.mkdir(parents=True, exist_ok=True)
    specs = draw_cases(options.cases, options.seed, only=options.only, whole_grid=options.whole_grid)
    _same_draw(out, {"seed": options.seed, "cases": len(specs), "only": options.only, "grid": options.whole_grid})
    waiting = [s for s in specs if not (out / "answers" / case_name(s.index) / "run.json").exists()]
    if options.score_only:
        waiting = []
    tool = shlex.split(options.tool) if options.tool else [sys.executable, "-m", "millfrf"]
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = {pool.submit(run_case, s, out, tool, options.timeout, options.keep): s for s in waiting}
        for done, job in enumerate(as_completed(jobs), 1):
            fault = job.exception()
            line = f"{case_name(jobs[job].index)}  not simulated: {fault!r}" if fault else job.result()
            print(f"{done}/{len(waiting)}  {line}", file=sys.stderr, flush=True)
    scores = score_all(out, specs)
    if not scores:
        sys.exit("no case has run; see the messages above")
    text = report(scores, f"Blind trial, {len(specs)} cases drawn with seed {options.seed}")
    (out / "results.md").write_text(text, encoding="utf-8")
    _write_cases(out, scores)
    print(text)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind_trial.run_trial", description=__doc__)
    parser.add_argument("--cases", type=int, default=100, help="how many to draw (stratified)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True, help="folder; an unfinished trial there is gone on with")
    parser.add_argument("--only", default="", help="one effect, group or condition")
    parser.add_argument("--whole-grid", action="store_true", help="all 2160 cells and the other groups in proportion")
    parser.add_argument("--timeout", type=float, default=300.0, help="s a call of the tool")
    parser.add_argument("--tool", default="", help="command of the tool; default: this Python's millfrf")
    parser.add_argument("--keep", action="store_true", help="keep recordings (2.4 MB a case); they can be made again")
    parser.add_argument("--score-only", action="store_true", help="score what has run")
    return parser.parse_args()


def _same_draw(out: Path, draw: dict[str, Any]) -> None:
    """Note the draw, or refuse to mix two."""
    note = out / "trial.json"
    if note.exists() and json.loads(note.read_text(encoding="utf-8")) != draw:
        sys.exit(f"{out} holds another draw: {note.read_text(encoding='utf-8').strip()}; choose another folder")
    note.write_text(json.dumps(draw) + "\n", encoding="utf-8")


def _write_cases(out: Path, scores: list[Score]) -> None:
    """One line a case, for who wants to look closer."""
    heads = "case,group,condition,effect,family,second,strength,reached,beyond,noise"
    lines = [heads + ",expected,answered,outcome,angle,removed"]
    for s in scores:
        spec = [s.spec[key] for key in ("group", "condition", "effect", "family", "second", "strength")]
        values = [
            s.name,
            *spec,
            f"{s.strength:.3g}",
            f"{s.beyond:.3g}",
            s.spec["noise"],
            s.expected,
            s.answered,
            s.outcome,
        ]
        values += ["" if x is None else f"{x:.3g}" for x in (s.angle, s.removed)]
        lines.append(",".join(map(str, values)))
    (out / "cases.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
