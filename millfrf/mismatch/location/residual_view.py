"""Residual of a diagnosis before and after its causes, for maps, figures and reports."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy
from numpy.typing import ArrayLike

from estimation import BandRecording, WindowedSpectrum
from millfrf.core import Complex, Real

from ..behaviour.behaviour_of_modes import Behaviour
from ..faults.clipping_repair import residual_lines
from ..faults.measuring_chain import Wiring
from ..inference.diagnosis import Diagnosis
from ..inference.settings import LOCATION, LocationSettings
from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import known_noise, through_structure
from ..physics.library import is_fault
from ..records.bands import ComparedBand
from ..records.noise_model import NoiseModel, quiet_noise
from ..screening.missing_force import MissingForce
from .maps import BlockResidual, ResidualMap, band_edges, band_means, block_residual, residual_map


@dataclass(frozen=True)
class StructureDetails:
    """Fits and recordings of the diagnosis of a structure."""

    # fit without any cause, and fit with the causes that are reported
    base: Fit
    final: Fit
    recordings: tuple[WindowedSpectrum, ...]  # recordings without tones and with repaired clipping, weakest first
    measured: tuple[WindowedSpectrum, ...]
    # hypothesis with modal parameters alone, and final hypothesis, both fitted without the held-out recording
    elsewhere: tuple[Hypothesis, Hypothesis]
    held_out: WindowedSpectrum  # data as measured that the fits ``elsewhere`` did not use: a recording or a part of it
    band: ComparedBand
    view: "ResidualView | None" = None  # maps of the residual before and after the causes; None until they are computed
    # delay of the measuring chain that the nominal model states, s; it was removed from the recordings
    delay: float = 0.0
    # change of the modes with the level, without any law; None if it was not determined
    behaviour: Behaviour | None = None
    # hypothesis with laws of the library if those of ``final`` have a free form; else None
    textbook: Hypothesis | None = None
    # force of one joint that the model with the linear causes lacks; None if it was not estimated
    missing: MissingForce | None = None
    wiring: Wiring | None = None  # exchanged or reversed channels that were put in their places; None if there are none
    refused: str = ""  # why a check of models refuses the improved model; empty if it does not

    def nominal_residual(self, lines: WindowedSpectrum) -> Complex:
        """Return the residual of the nominal model with the wiring as stated, (n_lines, n_responses)."""
        nominal = self.final.hypothesis.nominal
        if self.wiring is None:
            return residual_lines(nominal, lines)
        residual = residual_lines(nominal, self.wiring.inverse.lines(lines))
        return np.asarray(self.wiring.responses.corrected(residual))

    @property
    def tested(self) -> bool:
        """Whether data were held out from the fits ``elsewhere``; False for a single short recording."""
        return len(self.recordings) > 1 or self.held_out is not self.measured[0]


StructureDiagnosis: TypeAlias = Diagnosis[StructureDetails]  # the diagnosis of a structure

BANDS_PER_OCTAVE = 24  # number of bands per octave of the held-out spectra


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
        Spectra of the measured response, of the prediction of the improved model, of the residual of the refitted
        nominal model, of the residual of the improved model, and of the noise. Both models were fitted to the other
        recordings.
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
    """Return spectra of the held-out recording, with both models as they were fitted to the other recordings."""
    details = diagnosis.details
    names = [recording.recording.name for recording in details.measured]
    place = names.index(diagnosis.improvement.held_out)
    held_out, final = details.held_out, details.final
    before, after = details.elsewhere
    faults = [cause for cause in diagnosis.physics if is_fault(cause.name)]
    residuals = residual_lines(before, held_out), residual_lines(after, held_out, faults)
    covariance = known_noise(held_out, through_structure(final.hypothesis, held_out), final.noises[place])
    edges = band_edges([held_out], BANDS_PER_OCTAVE, 3)
    power = [
        np.abs(held_out.measured) ** 2,
        np.abs(held_out.measured - residuals[1]) ** 2,
        np.abs(residuals[0]) ** 2,
        np.abs(residuals[1]) ** 2,
        np.real(np.einsum("kii->ki", covariance)),
    ]
    densities = [_density(density_lines, held_out, edges) for density_lines in power]
    channels = held_out.recording.channels[-held_out.measured.shape[1] :]
    units = tuple(channel.unit for channel in held_out.recording.responses)
    middle = np.sqrt(edges[1:] * edges[:-1])
    return HeldOutSpectra(held_out.recording.name, middle, channels, units, *densities)


def _density(power: Real, lines: WindowedSpectrum, edges: Real) -> Real:
    """Return the root of the mean one-sided density in bands; nan in a band without lines."""
    mean, _ = band_means(lines.frequencies, power, edges)
    return np.asarray(np.sqrt(2 * mean / lines.recording.rate))


@dataclass(frozen=True)
class RecordingError:
    """Errors of the models as shares of one recording's root mean square response."""

    recording: str
    held_out: bool  # whether the models were fitted without the recording
    force: float  # root mean square of the recording's force, N
    # root mean square residual of the nominal model, of the model with refitted modal parameters alone, and of the
    # final model, each as a share of the response
    nominal: float
    refitted: float
    final: float
    noise: float  # root mean square noise as a share of the response


def recording_errors(diagnosis: StructureDiagnosis) -> tuple[RecordingError, ...]:
    """Return the errors of the models on each recording.

    The errors on the held-out recording are also in the diagnosis' ``Improvement``.
    """
    details = diagnosis.details
    linear, improved = details.elsewhere
    faults = [cause for cause in diagnosis.physics if is_fault(cause.name)]
    errors = []
    held_out = details.held_out
    for recording, noise in zip(details.measured, details.final.noises, strict=True):
        is_held_out = recording.recording.name == held_out.recording.name
        recording = held_out if is_held_out else recording
        residuals = (
            details.nominal_residual(recording),
            residual_lines(linear, recording),
            residual_lines(improved, recording, faults),
        )
        power = float(np.sum(np.abs(recording.measured) ** 2))
        covariance = known_noise(recording, through_structure(improved, recording), noise)
        nominal, refitted, final = (float(np.sqrt(np.sum(np.abs(residual) ** 2) / power)) for residual in residuals)
        floor = float(np.sqrt(np.sum(np.trace(covariance, axis1=1, axis2=2).real) / power))
        errors.append(
            RecordingError(
                recording.recording.name,
                is_held_out and details.tested,
                recording.recording.level,
                nominal,
                refitted,
                final,
                floor,
            )
        )
    return tuple(errors)


@dataclass(frozen=True)
class NoiseSpread:
    """Ratio of the noise level of single cells to the noise model, and its scatter."""

    level: float  # typical ratio of residual power to noise power where the model is best, at least 1
    spread: float  # standard deviation of the ratio's logarithm beyond chance

    def chance(self, ratio: ArrayLike, count: ArrayLike) -> Real:
        """Return the probability of a larger ratio in a cell of ``count`` independent lines of noise (F test)."""
        numerator = np.maximum(2 * np.asarray(count, dtype=float), 1e-9)
        return np.asarray(scipy.stats.f.sf(np.asarray(ratio) / self.level, numerator, 2 / self.spread**2))


def noise_spread(
    ratio: Real, count: Real, least: float = LOCATION.least_spread, most: float = LOCATION.quiet_spread
) -> NoiseSpread:
    """Return level and spread of the ratio in all cells under the final model, by median and median deviation.

    The spread is limited by ``most``: a large residual scatters between cells, and with this scatter no cell would be
    significant.
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
        Final fit, whose noise is the unit of the maps. If something is unexplained and may have been taken for noise,
        the level is that of the quietest fifth of narrow bands.
    noise
        Level of that noise, and its uncertainty.
    settings
        Thresholds for significant places.
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

    ``trials``: recordings as read, so that repaired tones and clipping are also located; None for the recordings of the
    diagnosis.
    """
    repaired = details.recordings
    measured = tuple(_as_measured(recording, trials or ()) for recording in repaired)
    edges = band_edges(measured)
    base, final = details.base.hypothesis, details.final
    if unexplained:
        final = replace(final, noises=tuple(_quiet(final, k, recording) for k, recording in enumerate(repaired)))
    after = residual_map(final.hypothesis, final, repaired, edges)
    noise = NoiseSpread(settings.quiet_level, settings.quiet_spread)
    if not unexplained:
        count = np.broadcast_to(after.count[:, :, None], after.ratio.shape)
        noise = noise_spread(after.ratio, count, settings.least_spread, settings.quiet_spread)
    return ResidualView(
        details,
        measured,
        residual_map(base, final, measured, edges),
        after,
        tuple(block_residual(base, final, k, recording) for k, recording in enumerate(measured)),
        tuple(block_residual(final.hypothesis, final, k, recording) for k, recording in enumerate(repaired)),
        final,
        noise,
        settings,
    )


def _quiet(final: Fit, number: int, lines: WindowedSpectrum) -> NoiseModel:
    """Return noise with the level of the quietest fifth of all narrow bands, and without noise of the forces."""
    return quiet_noise(final.noises[number], lines.measured - predict_lines(final.hypothesis, lines).response)


def linear_part(details: StructureDetails) -> Hypothesis | None:
    """Return the final model without joint laws; None if it has none."""
    final = details.final.hypothesis
    linear = tuple(cause for cause in final.causes if cause.axis is None)
    return replace(final, causes=linear) if len(linear) < len(final.causes) else None


def _as_measured(lines: WindowedSpectrum, trials: Sequence[BandRecording]) -> WindowedSpectrum:
    """Return the recording before any repair, with the run-in of the diagnosis."""
    for trial in trials:
        if trial.name == lines.recording.name and trial.response.shape == lines.recording.response.shape:
            before = replace(lines, recording=trial, noise=None).with_measured_forces()
            return replace(before, measured=before.cut(trial.response))
    return lines
