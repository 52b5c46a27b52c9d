"""`CrossSpectra`: averaged one-sided spectra, their settings and windows, and stacking over tests."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import Band, Complex, InputError, Real, Result, Summary, counted, drawing, listed, optional_library

from ..settings import RECORDINGS

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

# mean and amplitude of the cosine, ``mean - amplitude cos(2 pi n / N)``
_COSINES = {"hann": (0.5, 0.5), "hamming": (0.54, 0.46), "boxcar": (1.0, 0.0)}
WINDOWS = tuple(_COSINES)
DETRENDS = ("constant", "linear", "none")
_CACHED_BYTES = 1 << 19  # size of the matrices computed at once: they stay in the processor's cache


@dataclass(frozen=True)
class SpectralSettings:
    """Settings by which records are cut and windowed before the Fourier transform.

    Parameters
    ----------
    segment_length
        Samples in one segment.
    overlap
        Share of a segment that also belongs to the next segment, 0 <= overlap < 1.
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
        Number of independent averages with the same information as the overlapping segments.
    settings, sample_rate
        Spectral settings and sample rate (Hz) of the spectra.
    n_tests
        Number of tests (recordings) that were summed.
    n_excluded
        Number of segments left out because of overload, clipping or dropped samples.
    """

    frequencies: Real
    input_spectra: Complex
    cross_spectra: Complex
    output_spectra: Complex
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
        """Convert to a data set with the axes ``frequency`` (Hz) and the names of the channels.

        Raises
        ------
        InputError
            xarray is not installed.
        """
        xr = optional_library("xarray", "CrossSpectra.to_xarray")
        inputs, outputs = ([channel.name for channel in side] for side in (self.excitations, self.responses))
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
        averaged = f"{counted(self.n_tests, 'test')}, {counted(self.n_segments, 'segment')} of {seconds:.4g} s"
        excluded = f", {self.n_excluded} left out" if self.n_excluded else ""
        sides = (("excitation", self.excitations), ("response", self.responses))
        return Summary(
            f"CrossSpectra: {shape}, {counted(len(f), 'line')}, {span}",
            (
                f"{averaged}{excluded}, worth {self.effective_averages:.3g} averages",
                f"excitations {listed([channel.name for channel in self.excitations])}",
                f"responses {listed([channel.name for channel in self.responses])}",
            ),
            ("side", "channel", "degree of freedom", "unit"),
            tuple((kind, c.name, c.degree_of_freedom, c.unit) for kind, side in sides for c in side),
        )


def line_step(spectra: Complex) -> int:
    """Return how many lines of spectra (n_lines, n, m) are computed at a time, so that they stay in the cache."""
    return max(1, _CACHED_BYTES // max(1, 16 * int(np.prod(spectra.shape[1:]))))


def lines_of(spectra: CrossSpectra, chosen: NDArray[np.bool_]) -> CrossSpectra:
    """Select chosen lines (n_frequencies,) of the spectra."""
    return replace(
        spectra,
        frequencies=spectra.frequencies[chosen],
        input_spectra=spectra.input_spectra[chosen],
        cross_spectra=spectra.cross_spectra[chosen],
        output_spectra=spectra.output_spectra[chosen],
    )


def spectra_in_band(spectra: CrossSpectra, band: Band) -> CrossSpectra:
    """Select the lines of spectra between two frequencies (Hz).

    Raises
    ------
    InputError
        No line lies in the band.
    """
    f = spectra.frequencies
    inside = (f >= band[0]) & (f <= band[1])
    if not inside.any():
        raise InputError(
            f"no line lies between {band[0]:g} and {band[1]:g} Hz (the spectra have 0 to {f[-1]:g} Hz); widen --band"
        )
    return lines_of(spectra, inside)


def only_inputs(spectra: CrossSpectra, names: Sequence[str]) -> CrossSpectra:
    """Select the excitations with the given channel names."""
    columns = [number for number, channel in enumerate(spectra.excitations) if channel.name in names]
    return replace(
        spectra,
        input_spectra=spectra.input_spectra[:, columns][:, :, columns],
        cross_spectra=spectra.cross_spectra[:, :, columns],
        excitations=tuple(spectra.excitations[column] for column in columns),
    )


def settings_for(
    sample_rate: float,
    segment_seconds: float,
    *,
    overlap: float = 0.5,
    window: str = "hamming",
    detrend: str = "constant",
) -> SpectralSettings:
    """Make settings for segments of a given duration, rounded to an even number of samples.

    Parameters
    ----------
    sample_rate : Hz
        Samples per second.
    segment_seconds : s
        Duration of a segment.
    overlap, window, detrend
        Overlap, window and detrending of the segments, as in :class:`SpectralSettings`.

    Raises
    ------
    InputError
        A duration shorter than 8 samples, or an overlap, window or detrending that is not known.
    """
    length = 2 * round(segment_seconds * sample_rate / 2) if np.isfinite(segment_seconds) else 0
    if length < RECORDINGS.shortest_segment:
        raise InputError(f"segments of {segment_seconds!r} s hold {length} samples; use longer segments")
    settings = SpectralSettings(length, overlap, window, detrend)
    check_settings(settings)
    return settings


def check_settings(settings: SpectralSettings) -> None:
    if settings.segment_length < RECORDINGS.shortest_segment:
        raise InputError(
            f"segment length {settings.segment_length} samples is too short; use {RECORDINGS.shortest_segment} or more"
        )
    if not 0 <= settings.overlap < 1:
        raise InputError(f"overlap {settings.overlap:g} is not a share 0 <= overlap < 1; 0.5 is usual")
    if settings.window not in WINDOWS:
        raise InputError(f"unknown window {settings.window!r}; use one of {', '.join(WINDOWS)}")
    if settings.detrend not in DETRENDS:
        raise InputError(f"unknown detrend {settings.detrend!r}; use one of {', '.join(DETRENDS)}")


def window_samples(settings: SpectralSettings) -> Real:
    """Return the window (segment_length,) in its periodic form."""
    mean, amplitude = _COSINES[settings.window]
    return np.asarray(
        mean - amplitude * np.cos(2 * np.pi / settings.segment_length * np.arange(settings.segment_length))
    )


def hop_length(settings: SpectralSettings) -> int:
    """Return the number of samples from the start of a segment to the start of the next."""
    return max(1, settings.segment_length - round(settings.overlap * settings.segment_length))


def count_segments(n_samples: int, settings: SpectralSettings) -> int:
    """Count the segments in a recording of ``n_samples`` samples.

    Examples
    --------
    >>> count_segments(1000, SpectralSettings(200, 0.5)), count_segments(199, SpectralSettings(200, 0.5))
    (9, 0)
    """
    if n_samples < settings.segment_length:
        return 0
    return (n_samples - settings.segment_length) // hop_length(settings) + 1


def effective_averages(settings: SpectralSettings, n_segments: int) -> float:
    """Compute the number of independent averages with the same information as ``n_segments`` overlapping segments.

    It is ``N / (1 + 2 sum_m (1 - m/N) rho_m^2)`` with the window's correlation at m hops
    ``rho_m = sum_n w[n] w[n + m hop] / sum_n w[n]^2`` (Welch 1967; Percival & Walden, Spectral Analysis, section 6.17).

    Examples
    --------
    >>> round(effective_averages(SpectralSettings(1000, 0.5, "hann"), 99) / 99, 2)
    0.95
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
    """Compute the standard width (Hz) of a window's spectrum, over which each line averages its neighbours.

    It is ``s`` in ``s^2 = int f^2 |W|^2 df / int |W|^2 df = int w'(t)^2 dt / (4 pi^2 int w(t)^2 dt)``; for a Hann
    window of length T it is ``1 / (sqrt(3) T)`` (Bendat & Piersol, Random Data, 4th ed., section 8.5: smearing bias).
    None for a window that ends in a jump, whose width is not finite.

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
    """Refuse an empty list, and tests that differ in sample rate, settings or channels; the message shows both."""
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
        for sides in ((test.excitations, first.excitations), (test.responses, first.responses)):
            names, expected = ([c.name + " " + c.degree_of_freedom for c in channels] for channels in sides)
            if names != expected:
                raise InputError(f"test {number} has channels {names}, test 1 has {expected}; stack equal set-ups")


def sum_tests(tests: Sequence[CrossSpectra]) -> CrossSpectra:
    """Average spectra over tests, each weighted by its number of segments.

    ``H = (sum S_xf)(sum S_ff)^-1`` from the result is the least-squares FRF over all tests when all have the same
    noise; Eq. 12 of Mohammadi & Ahmadi places the tests side by side instead (:func:`h1_side_by_side`).

    Raises
    ------
    InputError
        No test, or tests that differ in sample rate, settings or channels.
    """
    check_stackable(tests)
    n_segments = sum(test.n_segments for test in tests)

    def mean(name: str) -> Complex:
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
    """Combine spectra of consecutive parts of one recording; up to rounding, the result is that of the whole recording.

    ``S = sum_k n_k S_k / sum_k n_k`` with the number of segments n_k of each part. Segments overlap across a seam as
    they do elsewhere.

    Raises
    ------
    InputError
        No part, or parts that differ in sample rate, settings or channels.
    """
    total = sum_tests(parts)
    # of all segments: those on either side of a seam overlap, so that the averages of the parts do not add up
    averages = effective_averages(total.settings, total.n_segments)
    return replace(total, effective_averages=averages, n_tests=parts[0].n_tests)
