"""The part of a compared band that forces excite: beyond it a model has nothing to say, and its noise misleads."""

from dataclasses import replace

import numpy as np

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum

from .common_band import ComparedBand
from .measured_noise import with_measured_noise

STANDS_OUT = 100.0
"""Power of a force at a line over its measured noise from which the line is excited. Noise alone passes it at one line
in e^100; a force that begins suddenly leaks less than that where it excites nothing."""

ROUNDING = 1e-12
"""Noise of a force without any, as a share of its largest line's power: what rounding leaves of a sum of sines."""


def excited_band(lines: WindowedSpectrum, band: ComparedBand) -> ComparedBand:
    """Return the compared band from the lowest to the highest line that a force excites.

    ``|F_k|^2 > 100 S_k`` with the measured noise S of the force. Where forces excite nothing, the measured force is its
    noise ``n_F``. The residual ``x - G (F + n_F)`` then holds ``G n_F``, and the less a model responds there the
    likelier its residual is. A mode that cancels the others above the highest line of a multisine was so told with an
    evidence of 1251, and was not there.

    Parameters
    ----------
    lines
        Windowed lines of one recording in the compared band.
    band
        Band in which the model holds, or that a user asks for, Hz.

    Returns
    -------
    ComparedBand
        The band itself where the noise of the forces was not measured, or where every force is below it.
    """
    if lines.noise is None:
        return band
    power = np.abs(lines.force_here) ** 2
    noise = np.maximum(np.einsum("kqq->kq", lines.noise.forces).real, ROUNDING * power.max(axis=0))
    excited = np.flatnonzero((power > STANDS_OUT * noise).any(axis=1))
    if not len(excited):
        return band
    frequencies, spacing = lines.frequencies, float(lines.frequencies[1] - lines.frequencies[0])
    low = max(band.low, float(frequencies[excited[0]]) - spacing)
    high = min(band.high, float(frequencies[excited[-1]]) + spacing)
    # lines of a window do not lie on the edges of a band
    if low - band.low < 2 * spacing and band.high - high < 2 * spacing:
        return band
    return replace(band, low=low, high=high, why=f"{band.why}, as far as the forces stand out of their noise")


def compared_lines(recording: BandRecording, band: ComparedBand, decay: float) -> tuple[WindowedSpectrum, ComparedBand]:
    """Return the lines of one recording that are compared, with the noise that its periods show, and their band.

    Parameters
    ----------
    recording
        Forces and responses.
    band
        Band in which the model holds, or that a user asks for, Hz.
    decay
        Decay rate of the slowest mode, 1/s.
    """
    lines = with_measured_noise(windowed_spectrum(recording, band.edges, decay))
    narrower = excited_band(lines, band)
    if narrower == band:
        return lines, band
    return with_measured_noise(windowed_spectrum(recording, narrower.edges, decay)), narrower
