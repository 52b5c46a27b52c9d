"""Residual of a diagnosis before and after its causes, for maps, figures and reports."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy
from numpy.typing import ArrayLike

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.core import Real

from ..behaviour.behaviour_of_modes import Behaviour
from ..faults.clipping_repair import residual_lines
from ..inference.diagnosis import Diagnosis
from ..inference.settings import LOCATION, LocationSettings
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis, predict_lines
from ..models.misfit import known_noise, through_structure
from ..noise.noise_model import NoiseModel
from ..physics.library import is_fault
from ..records.bands import ComparedBand
from .maps import BlockResidual, ResidualMap, band_edges, band_means, block_residual, residual_map


@dataclass(frozen=True)
class StructureDetails:
    """Fits and recordings with which the diagnosis of a structure was made.

    Parameters
    ----------
    base, final
        Fit without any cause, and fit with the causes that are reported.
    recordings
        Recordings with tones taken out and clipping mended, weakest first.
    measured
        The same recordings as they were measured.
    elsewhere
        Hypothesis with modal parameters alone, and final hypothesis, both fitted without the recording held out.
    held_out
        What those fits did not see, as it was measured: a recording, or a part of it.
    band
        Band in which model and recordings are compared, and why.
    view
        Maps of the residual before and after the causes are added; None until they are made.
    delay
        Delay of the measuring chain that the nominal model states, s: it was taken out of the recordings.
    behaviour
        What modes do with the level, whatever law stands behind it; None where it was not asked for.
    textbook
        The hypothesis with laws as the library has them, where those of ``final`` have a free form; else None.
    """

    base: Fit
    final: Fit
    recordings: tuple[WindowedSpectrum, ...]
    measured: tuple[WindowedSpectrum, ...]
    elsewhere: tuple[Hypothesis, Hypothesis]
    held_out: WindowedSpectrum
    band: ComparedBand
    view: "ResidualView | None" = None
    delay: float = 0.0
    behaviour: Behaviour | None = None
    textbook: Hypothesis | None = None

    @property
    def tested(self) -> bool:
        """Whether there was data that those fits did not see; of a single short recording there is none."""
        return len(self.recordings) > 1 or self.held_out is not self.measured[0]


StructureDiagnosis: TypeAlias = Diagnosis[StructureDetails]
"""The diagnosis of a structure."""

BANDS_PER_OCTAVE = 24


@dataclass(frozen=True)
class HeldOutSpectra:
    """Amplitude spectral densities in narrow bands, unit of the response per root Hz.

    Parameters
    ----------
    recording
        Name of the recording that is held out.
    frequencies : (n_bands,), Hz
        Geometric means of the bands' edges.
    channels
        Names of the responses.
    units
        Unit of each response.
    measured, predicted, before, after, noise : (n_bands, n_responses)
        Spectra of the measured response, of the improved model's prediction, of the residuals of the refitted nominal
        and of the improved model, both fitted to the other recordings, and of the noise.
    """

    recording: str
    frequencies: Real
    channels: tuple[str, ...]
    units: tuple[str, ...]
    measured: Real
    predicted: Real
    before: Real
    after: Real
    noise: Real


def held_out_spectra(diagnosis: StructureDiagnosis) -> HeldOutSpectra:
    """Return spectra of the recording named by the diagnosis' improvement, both models fitted to the others only."""
    details = diagnosis.details
    names = [one.recording.name for one in details.measured]
    kept = names.index(diagnosis.improvement.held_out)
    here, final = details.held_out, details.final
    before, after = details.elsewhere
    faults = [cause for cause in diagnosis.physics if is_fault(cause.name)]
    rests = residual_lines(before, here), residual_lines(after, here, faults)
    covariance = known_noise(here, through_structure(final.hypothesis, here), final.noises[kept])
    edges = band_edges([here], BANDS_PER_OCTAVE, 3)
    power = [
        np.abs(here.measured) ** 2,
        np.abs(here.measured - rests[1]) ** 2,
        np.abs(rests[0]) ** 2,
        np.abs(rests[1]) ** 2,
        np.real(np.einsum("kii->ki", covariance)),
    ]
    densities = [_density(one, here, edges) for one in power]
    channels = here.recording.channels[-here.measured.shape[1] :]
    units = tuple(channel.unit for channel in here.recording.responses)
    middle = np.sqrt(edges[1:] * edges[:-1])
    return HeldOutSpectra(here.recording.name, middle, channels, units, *densities)


def _density(power: Real, lines: WindowedSpectrum, edges: Real) -> Real:
    """Return the root of the mean one-sided density in bands; nan where a band holds no line."""
    mean, _ = band_means(lines.frequencies, power, edges)
    return np.asarray(np.sqrt(2 * mean / lines.recording.rate))


@dataclass(frozen=True)
class RecordingError:
    """Errors of the models as shares of one recording's root mean square response.

    Parameters
    ----------
    recording
        Name of the recording.
    held_out
        Whether the models were fitted without the recording.
    force
        Root mean square of the recording's force, N.
    nominal, refitted, final
        Root mean square residual of the nominal model, of the model with refitted modal parameters alone, and of the
        final model, each as a share of the response.
    noise
        Root mean square noise as a share of the response.
    """

    recording: str
    held_out: bool
    force: float
    nominal: float
    refitted: float
    final: float
    noise: float


def recording_errors(diagnosis: StructureDiagnosis) -> tuple[RecordingError, ...]:
    """Return the errors of all recordings; those of the one held out are in the diagnosis' :class:`Improvement` too."""
    details = diagnosis.details
    linear, improved = details.elsewhere
    faults = [cause for cause in diagnosis.physics if is_fault(cause.name)]
    found = []
    unseen = details.held_out
    for one, noise in zip(details.measured, details.final.noises, strict=True):
        held = one.recording.name == unseen.recording.name
        one = unseen if held else one
        rests = (
            residual_lines(improved.nominal, one),
            residual_lines(linear, one),
            residual_lines(improved, one, faults),
        )
        power = float(np.sum(np.abs(one.measured) ** 2))
        covariance = known_noise(one, through_structure(improved, one), noise)
        nominal, refitted, final = (float(np.sqrt(np.sum(np.abs(rest) ** 2) / power)) for rest in rests)
        floor = float(np.sqrt(np.sum(np.trace(covariance, axis1=1, axis2=2).real) / power))
        found.append(
            RecordingError(
                one.recording.name, held and details.tested, one.recording.level, nominal, refitted, final, floor
            )
        )
    return tuple(found)


@dataclass(frozen=True)
class NoiseSpread:
    """How well the noise model meets the noise level of single cells.

    Parameters
    ----------
    level
        Typical ratio of residual power to noise power where the model is at its best, at least 1.
    spread
        Standard deviation of the ratio's logarithm beyond chance.
    """

    level: float
    spread: float

    def chance(self, ratio: ArrayLike, count: ArrayLike) -> Real:
        """Return the probability of a larger ratio in a cell of ``count`` independent lines of noise (F test)."""
        numerator = np.maximum(2 * np.asarray(count, dtype=float), 1e-9)
        return np.asarray(scipy.stats.f.sf(np.asarray(ratio) / self.level, numerator, 2 / self.spread**2))


def noise_spread(
    ratio: Real, count: Real, least: float = LOCATION.least_spread, most: float = LOCATION.quiet_spread
) -> NoiseSpread:
    """Return level and spread of the cells that the final model leaves, by median and median deviation.

    Where the model leaves much, cells scatter by what is left and not by how well noise is known: with that spread
    nothing would ever stand out of it.

    Parameters
    ----------
    ratio
        Residual power over noise power of each cell, any shape.
    count
        Independent complex lines of each cell, in the shape of ``ratio``.
    least
        Least spread, however well the cells agree.
    most
        Largest spread, however far they scatter.
    """
    logs = np.log(np.maximum(ratio, 1e-12)).ravel()
    middle = float(np.median(logs))
    scatter = (1.4826 * float(np.median(np.abs(logs - middle)))) ** 2
    chance = float(np.median(scipy.special.polygamma(1, np.maximum(count, 0.5).ravel())))
    spread = float(np.sqrt(max(scatter - chance, least**2)))
    return NoiseSpread(max(1.0, float(np.exp(middle))), min(spread, max(most, least)))


def holm(chances: Real) -> Real:
    """Return adjusted p-values that control the family-wise error (Holm 1979, Scand. J. Statistics 6).

    Examples
    --------
    >>> [round(float(p), 3) for p in holm(np.array([0.01, 0.04, 0.03]))]
    [0.03, 0.06, 0.06]
    """
    flat = np.asarray(chances, dtype=float).ravel()
    order = np.argsort(flat)
    raised = np.maximum.accumulate(flat[order] * np.arange(len(flat), 0, -1))
    adjusted = np.empty(len(flat))
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted.reshape(np.shape(chances))


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
