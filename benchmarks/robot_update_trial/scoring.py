"""Scores of the trial: wrong names, coverage of intervals, error on the unseen posture, verdicts; by kind of case."""

from collections.abc import Sequence
from typing import Any

import numpy as np

HEAD = (
    "| kind | cases | explained, partly, none, unexplained | right names of wrong numbers | wrong names | "
    "95 % intervals that hold | unseen posture: filed, updated (times the noise) |\n|---|---|---|---|---|---|---|"
)
VERDICTS = ("explained", "partly explained", "none", "unexplained")


def table_of(results: Sequence[dict[str, Any]]) -> str:
    """Table in Markdown: a row for each kind, and one for all."""
    kinds = list(dict.fromkeys(each["kind"] for each in results))
    rows = [_row(kind, [each for each in results if each["kind"] == kind]) for kind in kinds]
    own = [each for each in results if not each["foreign"]]
    rows.append(_row("**all but foreign**", own))
    rows.append(_row("**all**", results))
    worse = [each["number"] for each in results if each["verdict"] == "explained" and _leaves_more(each)]
    return "\n".join([HEAD, *rows, "", f"explained, but leaves more on the unseen posture: {worse or 'none'}", ""])


def _row(kind: str, results: Sequence[dict[str, Any]]) -> str:
    counts = ", ".join(str(sum(each["verdict"] == verdict for each in results)) for verdict in VERDICTS)
    named = sum(len(each["named"]) for each in results)
    wrong = sum(len(each["wrong_names"]) for each in results)
    real = sum(sum("place" not in name for name in each["expected"]) for each in results)
    stated = [n for each in results for n in each["numbers"] if n["told"] and n["x"] != 0]
    held = np.array([abs(n["x"] - n["expected"]) <= 1.96 * n["error"] for n in stated])
    unseen = np.array([[each["unseen"]["filed"], each["unseen"]["updated"]] for each in results])
    coverage = f"{100 * held.mean():.1f} % of {len(held)}" if len(held) else "-"
    errors = f"{np.median(unseen[:, 0]):.3g}, {np.median(unseen[:, 1]):.3g} (worst {unseen[:, 1].max():.3g})"
    names = f"{named - wrong} of {real} | {wrong} of {named}"
    return f"| {kind} | {len(results)} | {counts} | {names} | {coverage} | {errors} |"


def _leaves_more(one: dict[str, Any]) -> bool:
    return bool(one["unseen"]["updated"] > max(one["unseen"]["filed"], 1.2))
