"""The picture of the trial: ``python -m benchmarks.robot_update_trial.picture DIR PICTURE.png``.

Each case is a pair: the error of the file and of the updated robot on the posture that was never given.
"""

import json
import sys
from itertools import groupby
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

WITHIN = 1.2
"""Error over the noise up to which an update explains."""

GREY, BLUE = "0.55", "#1f4e79"


def picture_of(results: list[dict[str, Any]]) -> Figure:
    """Errors on the unseen posture by case, kinds side by side.

    Parameters
    ----------
    results
        Results of the cases as ``run_trial`` writes them.
    """
    ranked = sorted(results, key=lambda one: (one["foreign"], one["number"]))
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes = figure.add_subplot()
    places = range(len(ranked))
    axes.semilogy(places, [one["unseen"]["filed"] for one in ranked], "s", color=GREY, ms=4, label="as filed")
    for verdict, marker, filled in (("explained", "o", True), ("none", "o", True), ("", "D", False)):
        chosen = [k for k in places if ranked[k]["verdict"] == verdict or (not verdict and _refused(ranked[k]))]
        values = [ranked[k]["unseen"]["updated"] for k in chosen]
        label = {"explained": "updated", "none": "", "": "updated, said to be explained in part or not"}[verdict]
        colour = BLUE if filled else "white"
        axes.semilogy(chosen, values, marker, color=BLUE, mfc=colour, ms=4, label=label or None)
    axes.axhline(WITHIN, color="black", ls="--", lw=0.8, label="1.2 times the noise")
    edge = 0
    for kind, group in groupby(ranked, key=lambda one: one["kind"].split(":")[0]):
        count = len(list(group))
        if edge:
            axes.axvline(edge - 0.5, color="0.85", lw=0.8)
        axes.text(edge + (count - 1) / 2, 1.02, kind, transform=axes.get_xaxis_transform(), **_WORDS)
        edge += count
    axes.set(ylabel="error on the unseen posture\n(times the noise)", xlabel="case", xlim=(-1, len(ranked)))
    figure.legend(loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return figure


_WORDS: dict[str, Any] = {"rotation": 30, "ha": "left", "va": "bottom", "fontsize": 8}


def _refused(one: dict[str, Any]) -> bool:
    return one["verdict"] in ("partly explained", "unexplained")


if __name__ == "__main__":
    found = [json.loads(place.read_text()) for place in sorted(Path(sys.argv[1]).glob("case_*.json"))]
    picture_of(found).savefig(sys.argv[2], dpi=150)
