"""The residual of a diagnosis before and after its causes, in all maps that are located and drawn."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum

from ..models import Fit, Hypothesis, predict_lines
from ..noise import NoiseModel
from .family_wise import NoiseSpread, noise_spread
from .residual_maps import ResidualMap, band_edges, residual_map
from .structure_details import StructureDetails
from .time_maps import BlockResidual, block_residual

QUIET = NoiseSpread(1.25, 0.5)
"""Of a noise level read from the quietest bands: they lie below the mean by chance, and its colour is not known."""


@dataclass(frozen=True)
class ResidualView:
    """Maps of what the refitted nominal model leaves (before) and what the final one leaves (after).

    Parameters
    ----------
    details
        Fits and recordings.
    measured
        Recordings as they were measured: tones and clipping not mended.
    before, after
        Frequency band x channel x recording.
    blocks_before, blocks_after
        Blocks of time of each recording.
    reference
        The final fit with the noise that is the unit of the maps: as fitted, or, where something stayed unexplained and
        may have been taken for noise, the level of the quietest fifth of narrow bands.
    noise
        How well that noise is known.
    """

    details: StructureDetails
    measured: tuple[WindowedSpectrum, ...]
    before: ResidualMap
    after: ResidualMap
    blocks_before: tuple[BlockResidual, ...]
    blocks_after: tuple[BlockResidual, ...]
    reference: Fit
    noise: NoiseSpread


def residual_view(
    details: StructureDetails, unexplained: bool, trials: Sequence[BandRecording] | None = None
) -> ResidualView:
    """Maps of a diagnosis.

    Parameters
    ----------
    details
        Fits and recordings of a diagnosis.
    unexplained
        Whether something stayed unexplained and may have been taken for noise.
    trials
        The recordings as read, so that mended tones and clipping are located too; None: what the diagnosis holds.
    """
    mended = details.recordings
    measured = tuple(_as_measured(one, trials or ()) for one in mended)
    edges = band_edges(measured)
    base, final = details.base.hypothesis, details.final
    if unexplained:
        final = replace(final, noises=tuple(_quiet(final, k, one) for k, one in enumerate(mended)))
    after = residual_map(final.hypothesis, final, mended, edges)
    return ResidualView(
        details,
        measured,
        residual_map(base, final, measured, edges),
        after,
        tuple(block_residual(base, final, k, one) for k, one in enumerate(measured)),
        tuple(block_residual(final.hypothesis, final, k, one) for k, one in enumerate(mended)),
        final,
        QUIET
        if unexplained
        else noise_spread(after.ratio, np.broadcast_to(after.count[:, :, None], after.ratio.shape)),
    )


def _quiet(final: Fit, number: int, lines: WindowedSpectrum) -> NoiseModel:
    """Noise at the level that a fifth of all narrow bands stays below, no part of it from forces."""
    rest = lines.measured - predict_lines(final.hypothesis, lines).response
    bands = np.array_split(np.abs(rest) ** 2, min(150, max(4, len(rest) // 12)))
    level = np.log(np.quantile([band.mean(axis=0) for band in bands], 0.2, axis=0))
    fitted = final.noises[number]
    return replace(fitted, responses=0 * fitted.responses + level[:, None], forces=0 * fitted.forces - 200.0)


def linear_part(details: StructureDetails) -> Hypothesis | None:
    """The final model with the causes of its joints taken away; None where it has none."""
    final = details.final.hypothesis
    kept = tuple(cause for cause in final.causes if cause.direction is None)
    return replace(final, causes=kept) if len(kept) < len(final.causes) else None


def _as_measured(lines: WindowedSpectrum, trials: Sequence[BandRecording]) -> WindowedSpectrum:
    """The recording before anything was mended; the run-in is that of the diagnosis."""
    for trial in trials:
        if trial.name == lines.recording.name and trial.response.shape == lines.recording.response.shape:
            decay = 7.0 * trial.rate / max(lines.start, 1)
            band = (float(lines.frequencies[0]), float(lines.frequencies[-1]))
            return windowed_spectrum(trial, band, decay)
    return lines
