"""The residual of a diagnosis before and after its causes, in all maps that are located and drawn."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum

from ..inference import LOCATION, LocationSettings
from ..models import Fit, Hypothesis, predict_lines
from ..noise import NoiseModel
from .family_wise import NoiseSpread, noise_spread
from .residual_maps import ResidualMap, band_edges, residual_map
from .structure_details import StructureDetails
from .time_maps import BlockResidual, block_residual


@dataclass(frozen=True)
class ResidualView:
    """Maps of the residual of the refitted nominal model (before) and of the final model (after).

    Parameters
    ----------
    details
        Fits and recordings of the diagnosis.
    measured
        Recordings as they were measured, with tones and clipping.
    before, after
        Maps over frequency band, channel and recording.
    blocks_before, blocks_after
        Residuals in blocks of time, one for each recording.
    reference
        Final fit, whose noise is the unit of the maps. Where something stayed unexplained and may have been taken for
        noise, that noise has the level of the quietest fifth of narrow bands instead of the fitted one.
    noise
        Level and spread of that noise: how well it is known.
    settings
        Thresholds with which places are named.
    """

    details: StructureDetails
    measured: tuple[WindowedSpectrum, ...]
    before: ResidualMap
    after: ResidualMap
    blocks_before: tuple[BlockResidual, ...]
    blocks_after: tuple[BlockResidual, ...]
    reference: Fit
    noise: NoiseSpread
    settings: LocationSettings = LOCATION


def residual_view(
    details: StructureDetails,
    unexplained: bool,
    trials: Sequence[BandRecording] | None = None,
    settings: LocationSettings = LOCATION,
) -> ResidualView:
    """Return the maps of the residual of a diagnosis.

    Parameters
    ----------
    details
        Fits and recordings of a diagnosis.
    unexplained
        Whether something stayed unexplained and may have been taken for noise.
    trials
        Recordings as read, so that mended tones and clipping are located too; None for those the diagnosis holds.
    settings
        Thresholds with which places are named.
    """
    mended = details.recordings
    measured = tuple(_as_measured(one, trials or ()) for one in mended)
    edges = band_edges(measured)
    base, final = details.base.hypothesis, details.final
    if unexplained:
        final = replace(final, noises=tuple(_quiet(final, k, one) for k, one in enumerate(mended)))
    after = residual_map(final.hypothesis, final, mended, edges)
    noise = NoiseSpread(settings.quiet_level, settings.quiet_spread)
    if not unexplained:
        count = np.broadcast_to(after.count[:, :, None], after.ratio.shape)
        noise = noise_spread(after.ratio, count, settings.least_spread, settings.quiet_spread)
    return ResidualView(
        details,
        measured,
        residual_map(base, final, measured, edges),
        after,
        tuple(block_residual(base, final, k, one) for k, one in enumerate(measured)),
        tuple(block_residual(final.hypothesis, final, k, one) for k, one in enumerate(mended)),
        final,
        noise,
        settings,
    )


def _quiet(final: Fit, number: int, lines: WindowedSpectrum) -> NoiseModel:
    """Return noise at the level below which a fifth of all narrow bands stays, with no part of it from forces."""
    rest = lines.measured - predict_lines(final.hypothesis, lines).response
    bands = np.array_split(np.abs(rest) ** 2, min(150, max(4, len(rest) // 12)))
    level = np.log(np.quantile([band.mean(axis=0) for band in bands], 0.2, axis=0))
    fitted = final.noises[number]
    return replace(fitted, responses=0 * fitted.responses + level[:, None], forces=0 * fitted.forces - 200.0)


def linear_part(details: StructureDetails) -> Hypothesis | None:
    """Return the final model without the causes of its joints; None where it has none."""
    final = details.final.hypothesis
    kept = tuple(cause for cause in final.causes if cause.axis is None)
    return replace(final, causes=kept) if len(kept) < len(final.causes) else None


def _as_measured(lines: WindowedSpectrum, trials: Sequence[BandRecording]) -> WindowedSpectrum:
    """Return the recording before anything was mended, with the run-in of the diagnosis."""
    for trial in trials:
        if trial.name == lines.recording.name and trial.response.shape == lines.recording.response.shape:
            decay = 7.0 * trial.rate / max(lines.start, 1)
            band = (float(lines.frequencies[0]), float(lines.frequencies[-1]))
            return windowed_spectrum(trial, band, decay)
    return lines
