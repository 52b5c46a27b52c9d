"""Tables of scores: the trial as a whole, and apart by what a case is."""

from collections.abc import Callable, Sequence

import numpy as np

from .scoring import Match, Score

HEADS = (
    "kind", "sets", "modes", "recall %", "all found %", "invented %", "fn error %", "zeta error %",
    "bars fn %", "bars zeta %", "s", "MB",
)  # fmt: skip
GROUPS: dict[str, Callable[[Score], bool]] = {
    "all": lambda s: True,
    "accelerance": lambda s: s.truth["quantity"] == "accelerance",
    "receptance": lambda s: s.truth["quantity"] == "receptance",
    "mobility": lambda s: s.truth["quantity"] == "mobility",
    "nothing told of noise": lambda s: s.truth["told"] == "nothing",
    "covariance exact": lambda s: s.truth["told"] == "covariance",
    "covariance estimated": lambda s: s.truth["told"] == "estimated covariance",
    "coherence": lambda s: s.truth["told"].startswith("coherence"),
    "noise proportional to the FRF": lambda s: s.truth["noise_of"] == "size of the FRF",
    "one reference": lambda s: min(s.truth["n_responses"], s.truth["n_excitations"]) == 1,
    "50 FRFs and more": lambda s: s.truth["n_responses"] * s.truth["n_excitations"] >= 50,
    "below 5 lines a bandwidth": lambda s: s.truth["lines_per_bandwidth"] < 5,
    "with close pairs": lambda s: bool(s.truth["pairs"]),
}


def report(scores: Sequence[Score], title: str) -> str:
    """Markdown: one row a group, then the failures, the rest in words."""
    lines = [f"## {title}", "", "| " + " | ".join(HEADS) + " |", "|---" * len(HEADS) + "|"]
    for name, belongs in GROUPS.items():
        chosen = [s for s in scores if belongs(s)]
        if chosen:
            lines.append("| " + " | ".join([name, *row(chosen)]) + " |")
    return "\n".join([*lines, "", *_remarks(scores)]) + "\n"


def row(scores: Sequence[Score]) -> list[str]:
    """Cells of :data:`HEADS` after the first."""
    matches = [m for s in scores for m in s.matches]
    demanded, result = sum(s.demanded for s in scores), sum(len(s.answer.modes) for s in scores)
    complete = sum(not s.missed for s in scores)
    invented = sum(len(s.invented) for s in scores)
    seconds, peak = [s.answer.seconds for s in scores], [s.answer.peak_mb for s in scores]
    return [
        str(len(scores)),
        str(demanded),
        _percent(len(matches), demanded),
        _percent(complete, len(scores)),
        _percent(invented, result),
        _spread([m.frequency for m in matches], "{:.3f}"),
        _spread([m.damping for m in matches], "{:.2g}"),
        _held([m.frequency_ratio for m in matches]),
        _held([m.damping_ratio for m in matches]),
        f"{np.median(seconds):.1f} ({max(seconds):.0f})",
        f"{max(peak):.0f}",
    ]


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f}" if whole else "-"


def _spread(errors: Sequence[float], form: str) -> str:
    """Median and 95th percentile of |error|, in per cent."""
    size = 100 * np.abs([e for e in errors if np.isfinite(e)])
    if not len(size):
        return "-"
    return f"{form.format(np.median(size))} ({form.format(np.percentile(size, 95))})"


def _held(ratios: Sequence[float | None]) -> str:
    """Share of 95 % intervals that hold the truth."""
    stated = [r for r in ratios if r is not None]
    return _percent(sum(r <= 1.96 for r in stated), len(stated))


def _remarks(scores: Sequence[Score]) -> list[str]:
    matches = [m for s in scores for m in s.matches]
    pair_missed = sum(bool(m.get("in_pair")) for s in scores for m in s.missed)
    pairs = pair_missed + sum(m.in_pair for m in matches)
    silent = [s for s in scores if (s.missed or s.invented) and s.answer.status == "ok" and not s.answer.said]
    faults = sum(bool(s.missed or s.invented) for s in scores)
    lines = [
        f"Modes of close pairs: {_percent(pairs - pair_missed, pairs)} % of {pairs} found.",
        f"Damping off by a factor of 2 or more: {sum(_far(m) for m in matches)} of {len(matches)} found modes.",
        f"Cases with a missed or an invented mode: {faults}; {len(silent)} of them without a word of warning.",
    ]
    if any(s.by_hand is not None for s in scores):
        hand, demanded = sum(s.by_hand or 0 for s in scores), sum(s.demanded for s in scores)
        lines.append(f"Who knows the truth and picks by hand finds {_percent(hand, demanded)} % of the modes.")
    shapes = [m.assurance for m in matches if m.assurance is not None]
    if shapes:
        lines.append(f"Vectors: median MAC {np.median(shapes):.4f}, 5th percentile {np.percentile(shapes, 5):.3f}.")
    for status in ("failed", "too slow", "killed"):
        cases = [str(s.truth["number"]) for s in scores if s.answer.status == status]
        if cases:
            lines.append(f"{status.capitalize()}: {len(cases)} ({', '.join(cases)}).")
    return lines


def _far(match: Match) -> bool:
    return bool(match.damping < -0.5 or match.damping > 1.0)
