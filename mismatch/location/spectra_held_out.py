"""Spectra of the recording held out: the response, the residual of each model, and the noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..faults import residual_lines
from ..models import known_noise, through_structure
from ..physics import is_fault
from .band_means import band_means
from .residual_maps import band_edges
from .structure_details import StructureDiagnosis

Real = NDArray[np.float64]

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
