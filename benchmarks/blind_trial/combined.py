"""Tables of several trials together: ``python -m benchmarks.blind_trial.combined DIR DIR ...``; scores what has run."""

import argparse
import json
from pathlib import Path

from .case_spec import draw_cases
from .run_trial import score_all
from .scoring import Score
from .tables import report


def scores_of(out: Path) -> list[Score]:
    """Scores of one trial's folder, its draw read from the note that the trial left."""
    draw = json.loads((out / "trial.json").read_text(encoding="utf-8"))
    return score_all(out, draw_cases(draw["cases"], draw["seed"], only=draw["only"], whole_grid=draw["grid"]))


def main() -> None:
    """Score and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind_trial.combined", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    folders: list[Path] = parser.parse_args().folders
    scores = [score for folder in folders for score in scores_of(folder)]
    print(report(scores, f"Blind trials {', '.join(folder.name for folder in folders)} together"))


if __name__ == "__main__":
    main()
