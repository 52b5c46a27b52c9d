"""`CrossSpectra`: averaged one-sided spectra between excitations and responses, with how they were made."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from foundation import Result, Summary, counted, drawing, listed, optional_library

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


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


@dataclass(frozen=True, eq=False, repr=False)
class CrossSpectra(Result):
    """One-sided power and cross spectral densities, averaged over segments.

    ``input_spectra[k, i, j] = <F_i conj(F_j)>``, ``cross_spectra[k, p, q] = <X_p conj(F_q)>``.

    Parameters
    ----------
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines, from 0 Hz up.
    input_spectra : (n_frequencies, n_excitations, n_excitations), unit_i * unit_j / Hz
        Power and cross spectral densities of the excitations.
    cross_spectra : (n_frequencies, n_responses, n_excitations), unit_p * unit_q / Hz
        Cross spectral densities of responses with excitations.
    output_spectra : (n_frequencies, n_responses, n_responses), unit_p * unit_u / Hz
        Power and cross spectral densities of the responses.
    excitations, responses
        Channels along the axes.
    n_segments
        Number of segments that were averaged.
    effective_averages
        Number of independent averages worth as much as the overlapping segments.
    settings, sample_rate
        Spectral settings and sample rate (Hz) with which the spectra were made.
    n_tests
        Number of tests (recordings) that were summed.
    n_excluded
        Number of segments left out because of overload, clipping or dropped samples.
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

    def plot(self, axes: "Axes | None" = None, *, side: str = "excitations") -> "Axes":
        """Draw the power of each channel of one side and return the axes; see :func:`figures.draw_spectra`."""
        return drawing("draw_spectra")(self, axes, side=side)

    def to_xarray(self) -> "xarray.Dataset":
        """Input, cross and output spectra as a data set with the axes ``frequency`` (Hz) and the channels' names.

        Raises
        ------
        InputError
            xarray is not installed.
        """
        xr = optional_library("xarray", "CrossSpectra.to_xarray")
        inputs, outputs = ([one.name for one in side] for side in (self.excitations, self.responses))
        spectra = {
            "input_spectra": (("frequency", "excitation", "excitation_conj"), self.input_spectra),
            "cross_spectra": (("frequency", "response", "excitation_conj"), self.cross_spectra),
            "output_spectra": (("frequency", "response", "response_conj"), self.output_spectra),
        }
        names = {"excitation": inputs, "excitation_conj": inputs, "response": outputs, "response_conj": outputs}
        return xr.Dataset(spectra, {"frequency": self.frequencies, **names})

    def _summary(self) -> Summary:
        f, seconds = self.frequencies, self.settings.segment_length / self.sample_rate
        span = f"{f[0]:.4g} to {f[-1]:.4g} Hz" if len(f) else "no line"
        shape = f"{counted(len(self.excitations), 'excitation')}, {counted(len(self.responses), 'response')}"
        made = f"{counted(self.n_tests, 'test')}, {counted(self.n_segments, 'segment')} of {seconds:.4g} s"
        left = f", {self.n_excluded} left out" if self.n_excluded else ""
        sides = (("excitation", self.excitations), ("response", self.responses))
        rows = tuple((kind, one.name, one.degree_of_freedom, one.unit) for kind, side in sides for one in side)
        return Summary(
            f"CrossSpectra: {shape}, {counted(len(f), 'line')}, {span}",
            (
                f"{made}{left}, worth {self.effective_averages:.3g} averages",
                f"excitations {listed([one.name for one in self.excitations])}",
                f"responses {listed([one.name for one in self.responses])}",
            ),
            ("side", "channel", "degree of freedom", "unit"),
            rows,
        )


def lines_of(spectra: CrossSpectra, chosen: NDArray[np.bool_]) -> CrossSpectra:
    """The spectra on some lines only; ``chosen`` (n_frequencies,)."""
    return replace(
        spectra,
        frequencies=spectra.frequencies[chosen],
        input_spectra=spectra.input_spectra[chosen],
        cross_spectra=spectra.cross_spectra[chosen],
        output_spectra=spectra.output_spectra[chosen],
    )
