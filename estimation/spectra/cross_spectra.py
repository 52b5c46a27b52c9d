"""`CrossSpectra`: averaged one-sided spectra, their windows, and stacking over tests."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import InputError, Result, Summary, counted, drawing, listed, optional_library

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
        """Draw the power of each channel of one side and return the axes; see `draw_spectra`."""
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


WINDOWS = ("hann", "hamming", "boxcar")
DETRENDS = ("constant", "linear", "none")


def settings_for(
    sample_rate: float,
    segment_seconds: float,
    *,
    overlap: float = 0.5,
    window: str = "hamming",
    detrend: str = "constant",
) -> SpectralSettings:
    """Settings for segments of a given duration, rounded to an even number of samples.

    Raises
    ------
    InputError
        A duration shorter than 8 samples, or settings that ``check_settings`` refuses.
    """
    length = 2 * round(segment_seconds * sample_rate / 2) if np.isfinite(segment_seconds) else 0
    if length < 8:
        raise InputError(f"segments of {segment_seconds!r} s hold {length} samples; use longer segments")
    settings = SpectralSettings(length, overlap, window, detrend)
    check_settings(settings)
    return settings


def check_settings(settings: SpectralSettings) -> None:
    """Refuse settings that cannot be used.

    Raises
    ------
    InputError
        With the value and what is allowed.
    """
    if settings.segment_length < 8:
        raise InputError(f"segment length {settings.segment_length} samples is too short; use 8 or more")
    if not 0 <= settings.overlap < 1:
        raise InputError(f"overlap {settings.overlap:g} is not a share 0 <= overlap < 1; 0.5 is usual")
    if settings.window not in WINDOWS:
        raise InputError(f"unknown window {settings.window!r}; use one of {', '.join(WINDOWS)}")
    if settings.detrend not in DETRENDS:
        raise InputError(f"unknown detrend {settings.detrend!r}; use one of {', '.join(DETRENDS)}")


def window_samples(settings: SpectralSettings) -> NDArray[np.float64]:
    """The window, periodic form, shape (segment_length,)."""
    from scipy.signal import get_window  # here, because scipy.signal alone takes 75 MB

    return np.asarray(get_window(settings.window, settings.segment_length, fftbins=True), dtype=float)


def hop_length(settings: SpectralSettings) -> int:
    """Samples from one segment's start to the next."""
    return max(1, settings.segment_length - round(settings.overlap * settings.segment_length))


def effective_averages(settings: SpectralSettings, n_segments: int) -> float:
    """Independent averages that ``n_segments`` overlapping segments are worth.

    ``N / (1 + 2 sum_m (1 - m/N) rho_m^2)`` with the window's correlation at m hops
    ``rho_m = sum_n w[n] w[n + m hop] / sum_n w[n]^2`` (Welch 1967; Percival & Walden, Spectral Analysis,
    section 6.17).

    Examples
    --------
    >>> round(effective_averages(SpectralSettings(1000, 0.5, "hann"), 99) / 99, 2)
    0.95
    >>> effective_averages(SpectralSettings(1000, 0.0, "hann"), 7)
    7.0
    """
    if n_segments == 0:
        return 0.0
    window, hop = window_samples(settings), hop_length(settings)
    energy = float(window @ window)
    correlated = 0.0
    for m in range(1, min(n_segments, -(-len(window) // hop))):
        rho = float(window[m * hop :] @ window[: len(window) - m * hop]) / energy
        correlated += (1 - m / n_segments) * rho**2
    return n_segments / (1 + 2 * correlated)


def spectral_width(settings: SpectralSettings, sample_rate: float) -> float | None:
    """Standard width of a window's spectrum, over which each line of an averaged spectrum mixes its neighbours.

    ``s^2 = int f^2 |W|^2 df / int |W|^2 df = int w'(t)^2 dt / (4 pi^2 int w(t)^2 dt)``; of a Hann window of length T it
    is ``1 / (sqrt(3) T)`` (Bendat & Piersol, Random Data, 4th ed., section 8.5: smearing bias).

    Parameters
    ----------
    settings
        Length and window of the segments.
    sample_rate
        Sample rate, Hz.

    Returns
    -------
    float or None
        Width, Hz; None for a window that ends in a jump, whose width is not finite.

    Examples
    --------
    >>> round(8.0 * spectral_width(SpectralSettings(800, window="hann"), 100.0), 3)
    0.577
    """
    if settings.window != "hann":
        return None
    window = window_samples(settings)
    slopes = np.diff(window, append=window[:1]) * sample_rate
    return float(np.sqrt(np.sum(slopes**2) / np.sum(window**2)) / (2 * np.pi))


def check_stackable(tests: Sequence[CrossSpectra]) -> None:
    """Refuse tests that cannot be stacked.

    Raises
    ------
    InputError
        No test, or tests that differ in sample rate, settings or channels; the message shows both values.
    """
    if not tests:
        raise InputError("no test to stack; give at least one recording")
    first = tests[0]
    for number, test in enumerate(tests[1:], start=2):
        if test.sample_rate != first.sample_rate:
            raise InputError(
                f"test {number} was sampled at {test.sample_rate:g} Hz, test 1 at {first.sample_rate:g} Hz; "
                "stack tests of one sample rate"
            )
        if test.settings != first.settings:
            raise InputError(f"test {number} was made with {test.settings}, test 1 with {first.settings}; use one")
        for mine, theirs in ((first.excitations, test.excitations), (first.responses, test.responses)):
            names = [[c.name + " " + c.degree_of_freedom for c in channels] for channels in (mine, theirs)]
            if names[0] != names[1]:
                raise InputError(f"test {number} has channels {names[1]}, test 1 has {names[0]}; stack equal set-ups")


def sum_tests(tests: Sequence[CrossSpectra]) -> CrossSpectra:
    """Sum spectra over tests, each weighted by its number of segments.

    ``H = (sum S_xf)(sum S_ff)^-1`` from the result is the least-squares FRF over all tests when their noise is
    equal; the paper's Eq. 12 sets them side by side instead (:func:`h1_side_by_side`).

    Raises
    ------
    InputError
        Tests that ``check_stackable`` refuses.
    """
    check_stackable(tests)
    n_segments = sum(test.n_segments for test in tests)

    def mean(name: str) -> np.ndarray:
        return np.asarray(sum(test.n_segments * getattr(test, name) for test in tests) / n_segments)

    return replace(
        tests[0],
        input_spectra=mean("input_spectra"),
        cross_spectra=mean("cross_spectra"),
        output_spectra=mean("output_spectra"),
        n_segments=n_segments,
        effective_averages=sum(test.effective_averages for test in tests),
        n_tests=sum(test.n_tests for test in tests),
        n_excluded=sum(test.n_excluded for test in tests),
    )


def join_parts(parts: Sequence[CrossSpectra]) -> CrossSpectra:
    """Put spectra of consecutive parts of one recording together: the spectra of the whole, to rounding.

    Means over segments are weighted by their number, so that ``S = sum_k n_k S_k / sum_k n_k``. The overlap of
    segments across a seam counts as it does elsewhere.

    Raises
    ------
    InputError
        Parts that ``check_stackable`` refuses.
    """
    total = sum_tests(parts)
    averages = effective_averages(total.settings, total.n_segments)
    return replace(total, effective_averages=averages, n_tests=parts[0].n_tests)
