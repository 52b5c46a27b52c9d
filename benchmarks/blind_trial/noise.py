"""Measurement noise: white or coloured, a stated share of each channel's RMS, half of it on forces."""

import numpy as np
from numpy.typing import NDArray

COLOURS = ("white", "pink", "hum")


def measurement_noise(
    clean: NDArray[np.float64], share: float, colour: str, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Noise (n, n_channels) whose RMS in each channel is ``share`` of that channel's about its mean.

    ``white``; ``pink``: power ~ 1/f above 1 Hz; ``hum``: white plus a broad peak at a random 20-90 Hz that holds half
    of the power.
    """
    n = len(clean)
    noise = np.empty_like(clean)
    frequencies = np.fft.rfftfreq(n, 1 / 512)
    centre = rng.uniform(20, 90)
    for column in range(clean.shape[1]):
        white = rng.standard_normal(n)
        if colour == "white":
            drawn = white
        elif colour == "pink":
            shape = 1 / np.sqrt(np.maximum(frequencies, 1.0))
            drawn = np.fft.irfft(np.fft.rfft(white) * shape, n)
        else:
            shape = np.exp(-0.5 * ((frequencies - centre) / 4) ** 2)
            peak = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) * shape, n)
            drawn = white + peak / peak.std()
        noise[:, column] = drawn * share * clean[:, column].std() / drawn.std()
    return noise
