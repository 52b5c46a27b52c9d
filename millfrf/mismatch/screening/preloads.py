"""Joint laws whose force differs between recordings of one level: the preload of a contact is not always the same."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..inference.search import Proposal, in_processes
from ..inference.settings import Settings
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis
from ..physics.protocol import PreloadedPhysics

STEPS = 30  # most steps of the fit of a factor for each recording


def are_driven_alike(lines: Sequence[WindowedSpectrum], settings: Settings) -> bool:
    """Return whether there are several recordings whose forces are about equally large and equally fast.

    Otherwise, a force of its own in each recording cannot be told from a force that follows deflection or velocity.
    """
    rates = [level(replace(each, force_here=each.frequencies[:, None] * each.force_here)) for each in lines]
    apart = settings.search.levels_apart
    return len(lines) > 1 and have_one_level(lines, apart) and max(rates) < apart * min(rates)


def have_one_level(lines: Sequence[WindowedSpectrum], apart: float) -> bool:
    """Return whether the forces of all recordings differ by less than a factor."""
    levels = [level(recording) for recording in lines]
    return max(levels) < apart * min(levels)


def level(lines: WindowedSpectrum) -> float:
    """Return the root mean square excitation of a recording in the compared band."""
    # not `BandRecording.level`, which includes force outside the band that hardly moves these modes
    return float(np.sqrt(np.mean(np.abs(lines.force_here) ** 2)))


def laws_with_preloads(
    lines: list[WindowedSpectrum], current: Fit, proposals: Sequence[Proposal[Fit]], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit the best proposal of each law that has a preload with a factor on its force for each recording.

    The force of dry friction is proportional to the normal force of its contact, which preload, temperature and wear
    change from one recording to the next. A common force is the null hypothesis: the factors of n recordings cost
    ``(n - 1) ln N`` and must gain the evidence of a cause.
    """
    best: dict[str, Proposal[Fit]] = {}
    for proposal in sorted(proposals, key=lambda proposal: proposal.evidence):
        last = proposal.fitted.hypothesis.causes[-1]
        if isinstance(last.physics, PreloadedPhysics) and not last.preloads:
            best[last.physics.name] = proposal
    if not best or not are_driven_alike(lines, settings):
        return []
    preloaded = in_processes([partial(_with_preloads, lines, current, law, settings) for law in best.values()])
    return [proposal for proposal in preloaded if proposal is not None]


def _with_preloads(
    lines: list[WindowedSpectrum], current: Fit, proposal: Proposal[Fit], settings: Settings
) -> Proposal[Fit] | None:
    """Fit the last law with a factor on its force for each recording; None if this gains too little evidence."""
    last = proposal.fitted.hypothesis.causes[-1]
    names = [recording.recording.name for recording in lines]
    causes = (*proposal.fitted.hypothesis.causes[:-1], replace(last, preloads=dict.fromkeys(names, 1.0)))
    start = replace(proposal.fitted.hypothesis, causes=causes)
    fitted = fit(lines, start, proposal.fitted.noises, iterations=STEPS)
    if not fitted.score < proposal.fitted.score - settings.evidence.least:
        return None
    return replace(proposal, fitted=fitted, evidence=current.score - fitted.score)


def without_preloads(hypothesis: Hypothesis) -> Hypothesis:
    """Return the hypothesis with the same force of each joint in all recordings."""
    return replace(hypothesis, causes=tuple(replace(cause, preloads={}) for cause in hypothesis.causes))
