"""The spectra from which verdicts on cuts were told."""

import math
import os
from collections.abc import Sequence

from acquisition import Recording
from estimation import choose_channels
from millfrf.stability import cut_spectrum, gather_evidence

from ...progress import Progress, silent
from .chatter import CutOptions, JudgedCut
from .chatter_file import KeptCut

PASSINGS = 6
"""Tooth passings that a spectrum shows at least."""
ABOVE = 1.5
"""By how much it goes beyond the highest line that was named."""


def keep_spectra(
    paths: Sequence[str | os.PathLike[str]], cuts: Sequence[JudgedCut], options: CutOptions, progress: Progress = silent
) -> tuple[KeptCut, ...]:
    """Compute the spectrum behind each verdict.

    Parameters
    ----------
    paths
        Recordings, in the order of their verdicts.
    cuts
        Judged cuts, from :func:`millfrf.chain.chatter.judge_recordings` with the same options.
    options
        Options with which they were judged.
    """
    kept = []
    for path, cut in zip(paths, cuts, strict=True):
        with Recording(path) as recording:
            stream = recording.stream(options.stream)
            _, responses = choose_channels(stream, None, options.responses or None)
            samples = stream.read(channels=[channel.name for channel in responses])
        with progress(f"spectrum of {cut.name}"):
            speed = cut.stated_rpm * math.pi / 30
            evidence = gather_evidence(samples, stream.sample_rate, speed, options.teeth)
            spectrum = cut_spectrum(evidence, _highest(cut, options.teeth))
        channel = responses[spectrum.channel]
        kept.append(KeptCut(cut, channel.name, channel.unit, spectrum))
    return tuple(kept)


def _highest(cut: JudgedCut, teeth: int) -> float:
    """Hz up to which a spectrum is kept."""
    named = [tone.frequency for tone in cut.verdict.foreign]
    if math.isfinite(cut.verdict.frequency):
        named.append(cut.verdict.frequency)
    return max(PASSINGS * teeth * cut.verdict.spindle_speed / (2 * math.pi), ABOVE * max(named, default=0.0))
