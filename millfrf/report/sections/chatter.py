"""Stability of recorded cuts: verdicts, foreign tones, spectra."""

import math

from millfrf.figures import ShownCut, chatter_figure

from ...chain import KeptCut, tone_table, verdict_table
from ..collection import Collected
from ..section import Picture, Section, picture_of

TOGETHER = 3
"""Cuts in one figure."""
MOST_SHOWN = 12
"""Spectra that are drawn; chattering and doubtful cuts first."""


def chatter_section(collected: Collected) -> Section:
    """Verdict of each cut in a table and a sentence, foreign tones, spectra."""
    sentences, tables, pictures = [], [], []
    for file, kept in collected.chatter:
        cuts = [one.cut for one in kept]
        sentences += [f"{cut.name}: {cut.verdict.kind}: {cut.verdict.reason}" for cut in cuts]
        tables.append(verdict_table(cuts))
        if any(cut.verdict.foreign for cut in cuts):
            tables.append(tone_table(cuts))
        shown = sorted(kept, key=lambda one: one.cut.verdict.kind == "stable")[:MOST_SHOWN]
        if len(shown) < len(kept):
            sentences.append(f"{file.path.name}: spectra of {len(shown)} of {len(kept)} cuts are drawn.")
        pictures += [_picture(file.path.name, shown[i : i + TOGETHER]) for i in range(0, len(shown), TOGETHER)]
    return Section("Was it chatter?", tuple(sentences), tuple(tables), tuple(pictures))


def chatter_in_brief(collected: Collected) -> list[str]:
    """One sentence a file: how many cuts chattered, and which."""
    told = []
    for file, kept in collected.chatter:
        verdicts = "; ".join(f"{one.cut.name} {_verdict(one)}" for one in kept)
        told.append(f"{file.path.name}: {verdicts}.")
    return told


def _verdict(kept: KeptCut) -> str:
    verdict = kept.cut.verdict
    return verdict.kind + ("" if math.isnan(verdict.frequency) else f" at {verdict.frequency:.4g} Hz")


def _picture(name: str, kept: list[KeptCut]) -> Picture:
    shown = [
        ShownCut(
            f"{one.cut.name}, {one.cut.verdict.spindle_speed * 30 / math.pi:.0f} rpm: {_verdict(one)}",
            f"{one.channel}, rms ({one.unit.replace('^2', '²')})",
            one.cut.verdict,
            one.spectrum,
        )
        for one in kept
    ]
    caption = (
        f"{name}: spectra of the second half of each cut in the channel that shows it best, a value being the root "
        "mean square of one line. Orders of the spindle (grey) repeat with every revolution and were taken away; what "
        "is left (solid) is held against the recording's own noise floor (dashed). Gaps: hidden by an order. Lines "
        "that were named have arrows."
    )
    return picture_of(chatter_figure(shown), caption, "Spectra of judged cuts")
