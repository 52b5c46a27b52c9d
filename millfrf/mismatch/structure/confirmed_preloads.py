"""Forces that differ between recordings, confirmed by the middle of each recording."""

from dataclasses import replace

from ..inference.search import Search
from ..inference.settings import ProofSettings
from ..models.fitting import Fit, fit
from ..models.misfit import least_misfit
from ..records.bands import Recordings
from ..screening.preloads import without_preloads

ITERATIONS = 30  # most steps of the fits with a force for each recording, and with one force for all


def with_confirmed_preloads(
    recordings: Recordings, search: Search[Fit], settings: ProofSettings
) -> tuple[Recordings, Search[Fit]]:
    """Keep forces that differ between recordings if the middle half of the recordings confirms the difference.

    Each force is determined by the first and last quarter of its recording, so that it predicts the middle.
    """
    last = search.current
    if not any(cause.preloads for cause in last.hypothesis.causes):
        return recordings, search
    parts = replace(recordings, own_numbers=True)
    if parts.tested:
        others = parts.others(parts.repaired)
        held_out = [parts.held_out(parts.repaired), *parts.held_out_elsewhere(parts.repaired).values()]
        misfits = [
            sum(least_misfit(fit(others, start, iterations=ITERATIONS).hypothesis, part) for part in held_out)
            for start in (last.hypothesis, without_preloads(last.hypothesis))
        ]
        if misfits[1] - misfits[0] > settings.gain:
            return parts, search
    common = fit(recordings.repaired, without_preloads(last.hypothesis), last.noises, iterations=ITERATIONS)
    return recordings, replace(search, steps=(*search.steps[:-1], common))
