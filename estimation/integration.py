"""Displacement from acceleration, in frequency, with a stated low cut."""

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .band_recordings import kinematic_factor


def displacement_from_acceleration(
    acceleration: NDArray[np.float64], sample_rate: float, low_cut: float
) -> NDArray[np.float64]:
    """Integrate twice: divide by ``-(2 pi f)^2`` above ``low_cut``, nothing below, a cosine step between.

    The step runs from 0.7 to 1 times ``low_cut``. The record's straight line is taken off and
    it is mirrored at both ends, so that no jump leaks into the band. Within some ten periods of the low cut from
    either end the result is a guess all the same: what came before the record is not known.

    Parameters
    ----------
    acceleration : (n_samples, n_channels), m/s^2
        Acceleration of each channel.
    sample_rate : Hz
        Samples a second.
    low_cut : Hz
        Frequency below which everything is left out: drift, the sensor's own high-pass, thermal wander.

    Returns
    -------
    (n_samples, n_channels), m

    Raises
    ------
    InputError
        A low cut that is not between 0 and half the sample rate, or a record shorter than four of its periods.
    """
    data = np.asarray(acceleration, dtype=float)
    if not 0 < low_cut < sample_rate / 2:
        raise InputError(f"low cut {low_cut:g} Hz must lie between 0 and {sample_rate / 2:g} Hz")
    if len(data) < 4 * sample_rate / low_cut:
        raise InputError(
            f"{len(data) / sample_rate:.3g} s are fewer than four periods of the low cut {low_cut:g} Hz; raise it"
        )
    n = len(data)
    time = np.linspace(-1, 1, n)[:, None]
    centred = data - data.mean(axis=0)
    centred = centred - time * (time * centred).sum(axis=0) / (time**2).sum()
    margin = min(n - 1, int(4 * sample_rate / low_cut))
    before, after = centred[margin:0:-1], centred[-2 : -margin - 2 : -1]
    padded = np.concatenate([before, centred, after])
    f = np.asarray(np.fft.rfftfreq(len(padded), 1 / sample_rate), dtype=float)
    rise = np.clip((f / low_cut - 0.7) / 0.3, 0.0, 1.0)
    gain = np.zeros(len(f), dtype=complex)
    gain[1:] = 0.5 * (1 - np.cos(np.pi * rise[1:])) / kinematic_factor(f[1:], np.array([2]), (0.0,))[:, 0]
    whole = np.fft.irfft(np.fft.rfft(padded, axis=0) * gain[:, None], len(padded), axis=0)
    return np.asarray(whole[margin : margin + n])
