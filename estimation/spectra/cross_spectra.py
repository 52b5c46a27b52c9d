"""`CrossSpectra`: averaged one-sided spectra between excitations and responses, with how they were made."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel


@dataclass(frozen=True)
class SpectralSettings:
    """How records are cut and windowed before the Fourier transform.

    Parameters
    ----------
    segment_length
        Samples in one segment.
    overlap
        Share of a segment shared with the next, 0 <= overlap < 1.
    window
        ``hann``, ``hamming`` or ``boxcar`` (periodic forms).
    detrend
        ``constant``, ``linear`` or ``none``, applied to each segment.
    """

    segment_length: int
    overlap: float = 0.5
    window: str = "hamming"
    detrend: str = "constant"


@dataclass(frozen=True)
class CrossSpectra:
    """One-sided power and cross spectral densities, averaged over segments.

    ``input_spectra[k, i, j] = <F_i conj(F_j)>``, ``cross_spectra[k, p, q] = <X_p conj(F_q)>``.

    Parameters
    ----------
    frequencies : (n_frequencies,), Hz
    input_spectra : (n_frequencies, n_excitations, n_excitations), unit_i * unit_j / Hz
    cross_spectra : (n_frequencies, n_responses, n_excitations)
    output_spectra : (n_frequencies, n_responses, n_responses)
    excitations, responses
        The channels along the axes.
    n_segments
        Segments averaged.
    effective_averages
        Number of independent averages worth as much as the overlapping segments.
    settings, sample_rate
        How they were made; sample_rate in Hz.
    n_tests
        Tests (recordings) that were summed.
    n_excluded
        Segments left out because of overload, clipping or dropped samples.
    """

    frequencies: NDArray[np.float64]
    input_spectra: NDArray[np.complex128]
    cross_spectra: NDArray[np.complex128]
    output_spectra: NDArray[np.complex128]
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]
    n_segments: int
    effective_averages: float
    settings: SpectralSettings
    sample_rate: float
    n_tests: int = 1
    n_excluded: int = 0


def lines_of(spectra: CrossSpectra, chosen: NDArray[np.bool_]) -> CrossSpectra:
    """The spectra on some lines only; ``chosen`` (n_frequencies,)."""
    return replace(
        spectra,
        frequencies=spectra.frequencies[chosen],
        input_spectra=spectra.input_spectra[chosen],
        cross_spectra=spectra.cross_spectra[chosen],
        output_spectra=spectra.output_spectra[chosen],
    )
