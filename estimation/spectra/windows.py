"""Windows and overlap: what a segment is multiplied with, and how many averages the segments are worth."""

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .spectral_matrix import SpectralSettings

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
