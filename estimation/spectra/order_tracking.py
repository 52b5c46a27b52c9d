"""Speed sweeps looked at: spectrogram, the tooth-passing line followed, and which test drove which line."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from .cross_spectra import CrossSpectra


def spectrogram(samples: Real, sample_rate: float, segment: float) -> tuple[Real, Real, Real]:
    """Compute the one-sided power spectral density over time (Hann windows, three quarters overlapped).

    Parameters
    ----------
    samples : (n_samples,)
        Samples of one channel.
    sample_rate : Hz
        Samples a second.
    segment : s
        Duration of a window.

    Returns
    -------
    time : (n_times,), s; frequencies : (n_frequencies,), Hz; density : (n_times, n_frequencies), unit^2/Hz

    Raises
    ------
    InputError
        A record shorter than a segment.
    """
    from scipy.signal import ShortTimeFFT  # here, because scipy.signal alone takes 75 MB
    from scipy.signal.windows import hann

    length = round(segment * sample_rate)
    if not 8 <= length <= len(samples):
        raise InputError(f"a segment of {segment:g} s does not fit {len(samples) / sample_rate:.3g} s of samples")
    transform = ShortTimeFFT(hann(length, sym=False), max(1, length // 4), sample_rate, scale_to="psd")
    first, last = transform.lower_border_end[1], transform.upper_border_begin(len(samples))[1]
    density = np.abs(transform.stft(samples, p0=first, p1=max(last, first + 1))) ** 2
    density[1:-1] *= 2
    time = transform.t(len(samples), p0=first, p1=max(last, first + 1))
    return np.asarray(time), np.asarray(transform.f), np.asarray(density.T)


def track_order(samples: Real, angle: Real, order: float, periods: float = 20.0) -> NDArray[np.complex128]:
    """Follow the complex amplitude of ``order`` times the spindle's rotation along a record.

    The samples are turned back by ``exp(-i order angle)`` and averaged by a Hann window over ``periods`` turns of the
    order, so that ``samples ~ Re(amplitude exp(i order angle))``. Forces tracked in three immersions show by their
    phases whether the tests are independent.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Samples at equal steps of time.
    angle : (n_samples,), rad
        Angle of the spindle at each sample, rising.
    order
        Order of the line: the number of teeth for the tooth-passing line.
    periods
        Number of periods of the order in the window.

    Returns
    -------
    (n_samples, n_channels), complex

    Raises
    ------
    InputError
        Unlike lengths, or an angle that does not rise.
    """
    from scipy.signal.windows import hann

    data = np.asarray(samples, dtype=float)
    if data.ndim != 2 or len(angle) != len(data):
        raise InputError(f"samples of shape {data.shape} and {len(angle)} angles; give (n, channels) and (n,)")
    if len(angle) < 2 or not (np.diff(angle) > 0).all():
        raise InputError("the spindle's angle must rise from sample to sample; unwrap it first")
    turned = data * np.exp(-1j * order * angle)[:, None]
    # average over equal angle, not equal time: the window follows the speed
    grid = np.linspace(angle[0], angle[-1], len(angle))
    even = np.column_stack([np.interp(grid, angle, c.real) + 1j * np.interp(grid, angle, c.imag) for c in turned.T])
    width = max(3, round(periods * 2 * np.pi / order / (grid[1] - grid[0])))
    window = hann(width | 1)
    weight = np.convolve(np.ones(len(grid)), window, "same")
    smooth = np.column_stack([np.convolve(c, window, "same") for c in even.T]) / weight[:, None]
    back = [np.interp(angle, grid, c.real) + 1j * np.interp(angle, grid, c.imag) for c in smooth.T]
    return 2 * np.column_stack(back)


def excitation_map(tests: Sequence[CrossSpectra], share: float = 1e-3) -> NDArray[np.bool_]:
    """Show which test drove which line: total input power above ``share`` of the largest over all tests and lines.

    Each input counts by its share of its own largest power, so that units do not matter.

    Returns
    -------
    (n_tests, n_frequencies), bool

    Raises
    ------
    InputError
        No test, or tests on different lines.
    """
    if not tests:
        raise InputError("no test; give at least one")
    if any(len(test.frequencies) != len(tests[0].frequencies) for test in tests):
        raise InputError("tests on different frequency lines; make their spectra with the same settings")
    power = np.array([np.real(np.einsum("kii->ki", test.input_spectra)) for test in tests])
    largest = power.max(axis=(0, 1))
    total = (power / np.where(largest > 0, largest, 1.0)).sum(axis=2)
    return np.asarray(total > share * total.max())
