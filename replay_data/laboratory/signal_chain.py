"""The chain from the motion to the converter's numbers: anti-alias filter, high-pass, noise, range, steps."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin, lfilter, upfirdn

from .sensors import Sensor

HALF_WIDTH = 8
"""Half the length of the anti-alias filter, in samples of its output."""

_PASSED_SHARE = 0.8
_KAISER_BETA = 7.9


class Decimator:
    """Anti-alias filter and reduction of the sample rate by a whole factor, block by block, without delay.

    A symmetric FIR filter (Kaiser window, -6 dB at 0.8 of the new Nyquist frequency, stop band -80 dB); its delay is
    taken out, so that output sample m belongs to the time of input sample ``m factor``. Output lags the input it has
    been given by :attr:`lookahead` samples.

    Parameters
    ----------
    factor
        Number of input samples per output sample; 1 passes everything on.
    n_channels
        Number of columns of the samples.
    """

    def __init__(self, factor: int, n_channels: int) -> None:
        self._factor = factor
        self.lookahead = HALF_WIDTH * factor if factor > 1 else 0
        self._taps = anti_alias_filter(factor)
        self._held = np.zeros((self.lookahead, n_channels))

    def __call__(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Output samples that the input so far determines; before the first sample the input was zero."""
        if self._factor == 1:
            return samples
        held = np.concatenate([self._held, samples])
        ready = (len(held) - 2 * self.lookahead - 1) // self._factor + 1
        if ready <= 0:
            self._held = held
            return np.empty((0, held.shape[1]))
        used = held[: 2 * self.lookahead + (ready - 1) * self._factor + 1]
        first = 2 * self.lookahead // self._factor
        filtered = upfirdn(self._taps, used, down=self._factor, axis=0)
        self._held = held[ready * self._factor :].copy()
        return np.asarray(filtered[first : first + ready])


def anti_alias_filter(factor: int) -> NDArray[np.float64]:
    """Coefficients of the low-pass, shape (2 HALF_WIDTH factor + 1,), gain 1 at 0 Hz."""
    if factor == 1:
        return np.ones(1)
    length = 2 * HALF_WIDTH * factor + 1
    return np.asarray(firwin(length, _PASSED_SHARE / factor, window=("kaiser", _KAISER_BETA)))


class SignalChain:
    """High-pass, noise, clipping and rounding of every channel, block by block, repeatable by seed.

    Parameters
    ----------
    sensors
        Sensors, one a channel.
    sample_rate : Hz
        Samples a second.
    noise_rms : (n_channels,)
        Standard deviation of the white noise, SI.
    seed
        Seed of the noise.
    """

    def __init__(
        self, sensors: Sequence[Sensor], sample_rate: float, noise_rms: NDArray[np.float64], seed: int
    ) -> None:
        self._generator = np.random.default_rng(seed)
        self._noise = np.asarray(noise_rms, dtype=float)
        self._full_scale = np.array([sensor.full_scale for sensor in sensors])
        self._resolution = np.array([sensor.resolution for sensor in sensors])
        self._high_pass = _HighPass([sensor.high_pass_hz for sensor in sensors], sample_rate)

    def __call__(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the converter writes for these physical values, (n, n_channels)."""
        seen = self._high_pass(samples)
        if self._noise.any():
            seen = seen + self._generator.standard_normal(seen.shape) * self._noise
        return np.asarray(quantised(seen, self._full_scale, self._resolution))


def quantised(
    values: NDArray[np.float64], full_scale: NDArray[np.float64] | float, resolution: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Clip to +-full_scale and round to whole multiples of the resolution.

    Examples
    --------
    >>> quantised(np.array([0.26, -9.0]), 1.0, 0.25).tolist()
    [0.25, -1.0]
    """
    steps = np.rint(np.clip(values, -full_scale, full_scale) / resolution)
    return np.asarray(steps * resolution)


class _HighPass:
    """First-order high-pass ``s / (s + 2 pi corner)`` per channel, bilinear transform; channels without pass."""

    def __init__(self, corners: Sequence[float | None], sample_rate: float) -> None:
        self._groups: list[tuple[list[int], NDArray[np.float64], NDArray[np.float64]]] = []
        self._state: list[NDArray[np.float64]] = []
        for corner in sorted({c for c in corners if c is not None}):
            columns = [index for index, c in enumerate(corners) if c == corner]
            share = np.pi * corner / sample_rate
            numerator = np.array([1.0, -1.0]) / (1 + share)
            self._groups.append((columns, numerator, np.array([1.0, (share - 1) / (share + 1)])))
            self._state.append(np.zeros((1, len(columns))))

    def __call__(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        if not self._groups:
            return samples
        output = samples.copy()
        for index, (columns, numerator, denominator) in enumerate(self._groups):
            output[:, columns], self._state[index] = lfilter(
                numerator, denominator, samples[:, columns], axis=0, zi=self._state[index]
            )
        return output
