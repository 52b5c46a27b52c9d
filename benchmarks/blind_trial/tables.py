"""The trial's results as tables: rates with Wilson intervals beside their targets, and who was taken for what."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from .effects import LISTED
from .further_groups import FURTHER
from .scoring import Score, wilson

Rows = list[list[str]]


def report(scores: Sequence[Score], heading: str) -> str:
    """Everything as markdown; it also reads well as plain text."""
    parts = [
        f"# {heading}",
        f"{len(scores)} cases; {np.median([s.seconds for s in scores]):.0f} s a case (median), "
        f"{max(s.seconds for s in scores):.0f} s the slowest.",
        "## Targets\n\n" + _table(["what", "found", "of", "share", "95 % interval", "target"], targets(scores)),
        "## By effect, strength at least the noise\n\n" + _by(strong(scores), lambda s: s.expected),
        "## By response change over noise\n\n" + _by(_sized(scores), lambda s: _bin(s.strength)),
        "## By what no linear structure could imitate, over noise\n\n" + _by(_sized(scores), lambda s: _bin(s.beyond)),
        "## By family of the law\n\n" + _by(_named(scores), lambda s: f"{s.spec['effect']}: {s.spec['family']}"),
        "## By condition\n\n" + _by(scores, lambda s: f"{s.spec['group']}: {s.spec['condition']}"),
        "## By excitation\n\n" + _by(_named(scores), lambda s: str(s.spec["excitation"])),
        "## Foreign effects\n\n" + _by(_group(scores, "foreign"), lambda s: str(s.spec["effect"])),
        "## Who was taken for what\n\n" + confusion(scores),
        "## Interval coverage by parameter\n\n" + _coverage(scores),
    ]
    return "\n\n".join(parts) + "\n"


def targets(scores: Sequence[Score]) -> Rows:
    """One row a target of the plan."""
    controls, foreign = _group(scores, "control"), _group(scores, "foreign")
    listed, named = _group(scores, "main"), _named(scores)
    angles = [s.angle for s in scores if s.angle is not None]
    covered = [inside for s in scores for _, inside in s.covered]
    half = [s for s in listed if 0.35 <= s.strength < 0.75 and s.expected != "modal_parameters"]
    rows = [
        _rate("false alarms on controls", controls, _wrong, "<= 1 %"),
        _rate("false alarms where nothing is hidden, all groups", [s for s in scores if _nothing(s)], _wrong, "<= 1 %"),
        _rate("wrong physics named", named, _wrong, "<= 2 %"),
        _rate("right, residual >= noise", strong(listed), _right, ">= 95 %"),
        _rate("right, residual >= noise, harder groups too", strong(scores), _right, ">= 90 %"),
        _rate("right, residual half the noise", half, _right, ">= 80 %"),
        _rate("right, what no linear refit takes >= noise", [s for s in listed if s.beyond >= 0.9], _right, "-"),
        _rate("foreign effects named wrongly", foreign, _wrong, "<= 10 %"),
        _rate("foreign effects: unexplained, or named where it has a name", foreign, _right, "-"),
        _rate("pairs: both named", _group(scores, "pair"), _right, "-"),
        _rate("pairs: one or both, nothing false", _group(scores, "pair"), _partly, "-"),
        _share("joint direction within 10 degrees", sum(a <= 10 for a in angles), len(angles), ">= 95 %"),
        _share("intervals that hold the truth", sum(covered), len(covered), "92-98 %"),
        _rate("answered within 60 s", scores, lambda s: s.seconds < 60, ">= 95 %"),
        _rate("no answer (crash, time)", scores, lambda s: s.outcome == "failed", "0"),
    ]
    for label, values in (
        ("held-out excess removed, unseen recording", [s.removed for s in scores if s.expected not in _UNFAIR]),
        ("held-out excess removed, the tool's word", [s.claimed for s in scores if s.expected not in _UNFAIR]),
    ):
        known = [value for value in values if value is not None]
        median = f"median {100 * np.median(known):.1f} %" if known else "not measured"
        rows.append([label, "", str(len(known)), median, "", ">= 90 %"])
    return rows


_UNFAIR = ("unexplained", "none", "unmeasured_excitation", "clipping")
"""Nothing to improve, or nothing that a model of the structure could predict."""


def _sized(scores: Iterable[Score]) -> list[Score]:
    return [s for s in _named(scores) if s.expected != "modal_parameters"]


def _bin(ratio: float) -> str:
    """A ratio in words that sort."""
    for upper, words in (
        (0.1, "0-0.1"),
        (0.35, "0.1-0.35"),
        (0.75, "0.35-0.75"),
        (1.4, "0.75-1.4"),
        (3.0, "1.4-3"),
        (8.0, "3-8"),
    ):
        if ratio < upper:
            return words
    return "8 and more"


def strong(scores: Iterable[Score]) -> list[Score]:
    """Cases of listed effects whose residual is at least the noise (within the generator's 10 %)."""
    return [s for s in _named(scores) if s.strength >= 0.9 or s.expected == "modal_parameters"]


def confusion(scores: Sequence[Score]) -> str:
    """Row: the truth; then what was answered, most frequent first."""
    rows = []
    for truth in sorted({s.expected for s in scores if "+" not in s.expected}, key=_order):
        those = [s for s in scores if s.expected == truth]
        answers = Counter(s.answered for s in those).most_common()
        rows.append([truth, str(len(those)), ", ".join(f"{name} {count}" for name, count in answers)])
    return _table(["truth", "cases", "answers"], rows)


def _order(name: str) -> tuple[int, str]:
    return (list(LISTED).index(name) if name in LISTED else 99, name)


def _coverage(scores: Sequence[Score]) -> str:
    names = sorted({name for s in scores for name, _ in s.covered})
    rows = []
    for name in names:
        inside = [hit for s in scores for given, hit in s.covered if given == name]
        rows.append(_share(name, sum(inside), len(inside), "92-98 %"))
    return _table(["parameter", "inside", "of", "share", "95 % interval", "target"], rows)


def _by(scores: Sequence[Score], key: Callable[[Score], str]) -> str:
    outcomes = ("right", "partial", "equivalent", "abstained", "wrong", "failed")
    rows = []
    for name in sorted({key(s) for s in scores}):
        those = [s for s in scores if key(s) == name]
        counts = [sum(s.outcome == outcome for s in those) for outcome in outcomes]
        low, high = wilson(counts[0], len(those))
        share = f"{100 * counts[0] / len(those):.1f} % ({100 * low:.0f}-{100 * high:.0f})"
        rows.append([name, str(len(those)), *map(str, counts), share])
    return _table(["", "cases", *outcomes, "right, 95 % interval"], rows)


def _group(scores: Iterable[Score], group: str) -> list[Score]:
    return [s for s in scores if s.spec["group"] == group]


def _named(scores: Iterable[Score]) -> list[Score]:
    """Cases with one listed effect."""
    return [s for s in scores if s.spec["group"] in ("main", "condition", *FURTHER) and not _nothing(s)]


def _nothing(score: Score) -> bool:
    return score.expected == "none"


def _right(score: Score) -> bool:
    return score.outcome == "right"


def _partly(score: Score) -> bool:
    return score.outcome in ("right", "partial")


def _wrong(score: Score) -> bool:
    return score.outcome == "wrong"


def _rate(label: str, scores: Sequence[Score], hit: Callable[[Score], bool], target: str) -> list[str]:
    return _share(label, sum(hit(s) for s in scores), len(scores), target)


def _share(label: str, found: int, trials: int, target: str) -> list[str]:
    if not trials:
        return [label, "0", "0", "-", "-", target]
    low, high = wilson(found, trials)
    share, interval = f"{100 * found / trials:.1f} %", f"{100 * low:.1f}-{100 * high:.1f} %"
    return [label, str(found), str(trials), share, interval, target]


def _table(heads: list[str], rows: Rows) -> str:
    """A markdown table with aligned columns."""
    if not rows:
        return "No cases."
    width = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    lines = [
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(row, width, strict=True)) + " |" for row in [heads, *rows]
    ]
    return "\n".join([lines[0], "|" + "|".join("-" * (w + 2) for w in width) + "|", *lines[1:]])
