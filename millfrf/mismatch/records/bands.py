"""Band in which a model and recordings are compared, and the part of it that the forces excite."""

from dataclasses import dataclass, replace

import numpy as np

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.core import Band, InputError
from modal_fit import ModalModel

from .held_out_parts import with_measured_noise

BELOW, ABOVE = 3.0, 3.0
"""Lowest mode over the lower edge, and upper edge over the highest mode, where a model states no band."""

SAMPLED = 0.42
"""Highest frequency that is compared, as a share of the sample rate."""

ROOM = 1.1
"""Least ratio of the upper edge, as far as the sample rate allows it, to the highest mode."""


@dataclass(frozen=True)
class ComparedBand:
    """Band of frequencies in which a model and a recording are compared.

    Parameters
    ----------
    low, high
        Lower and upper edge of the band, Hz.
    why
        Origin of the edges, as the end of a sentence that begins with the band.
    """

    low: float
    high: float
    why: str

    @property
    def edges(self) -> tuple[float, float]:
        """Both edges, Hz."""
        return self.low, self.high

    @property
    def sentence(self) -> str:
        """Band and its reason in words.

        Examples
        --------
        >>> ComparedBand(13.0, 25.0, "the band in which the model holds").sentence
        'compared from 13 to 25 Hz: the band in which the model holds'
        """
        return f"compared from {self.low:.3g} to {self.high:.3g} Hz: {self.why}"


def compared_band(model: ModalModel, rate: float, asked: Band | None = None) -> ComparedBand:
    """Return the band in which a model and a recording are compared.

    That is the band that is asked for, or else the one in which the model holds: outside, modes that the model does
    not have would look like left-out physics. A model that states none is compared from a third of its lowest mode to
    three times its highest.

    Parameters
    ----------
    model
        Model of the structure, with or without a band of its own.
    rate
        Sample rate of the recording, Hz.
    asked
        Lowest and highest frequency that a user asks for, Hz; None: the model's own band.

    Raises
    ------
    InputError
        The recording is sampled too slowly for the model's highest mode or for the band, or no mode lies in it.

    Examples
    --------
    >>> import numpy as np
    >>> from modal_fit import ModalModel
    >>> model = ModalModel(np.array([-1 + 100j]), np.ones((1, 1)), np.ones((1, 1)), ("T:+X",), ("T:+X",), band=(12, 24))
    >>> compared_band(model, 512.0).edges
    (12.0, 24.0)
    """
    edges = reach_of(model, rate)
    if asked is not None:
        return _asked_band(model, rate, asked)
    if model.band is None:
        return ComparedBand(
            *edges, "a third of the lowest to three times the highest mode, as the model states no band"
        )
    low, high = model.band
    if high <= SAMPLED * rate:
        return ComparedBand(low, high, "the band in which the model holds")
    high = SAMPLED * rate
    if low >= high:
        raise InputError(
            f"sampled at {rate:g} Hz, too slowly for a model that holds from {low:g} Hz on; "
            f"record at {2.5 * model.band[1]:.0f} Hz or more"
        )
    return ComparedBand(low, high, f"the model holds to {model.band[1]:g} Hz, and {rate:g} samples a second end there")


def _asked_band(model: ModalModel, rate: float, asked: Band) -> ComparedBand:
    """The band that a user asks for, with what the model says of it."""
    low, high = asked
    if not 0 <= low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty; give 0 <= low < high")
    if high > SAMPLED * rate:
        raise InputError(
            f"band up to {high:g} Hz: recordings sampled at {rate:g} Hz are compared up to {SAMPLED * rate:.4g} Hz; "
            "ask for less"
        )
    natural = model.natural_frequencies
    if not ((natural >= low) & (natural <= high)).any():
        raise InputError(
            f"band {low:g} to {high:g} Hz holds no mode of the model, which has "
            f"{natural.min():.4g} to {natural.max():.4g} Hz; ask for a band around one"
        )
    why = "the band that was asked for"
    if model.band is None:
        why += ", as the model states none"
    elif low < model.band[0] or high > model.band[1]:
        why += f", beyond the {model.band[0]:.3g} to {model.band[1]:.3g} Hz in which the model holds"
    return ComparedBand(low, high, why)


def reach_of(model: ModalModel, rate: float) -> tuple[float, float]:
    """Return the band from a third of the lowest to three times the highest mode, as far as ``rate`` allows, Hz.

    Raises
    ------
    InputError
        The recording is sampled too slowly for the model's highest mode.
    """
    natural = model.natural_frequencies
    high = min(ABOVE * float(natural.max()), SAMPLED * rate)
    if high < ROOM * natural.max():
        raise InputError(
            f"sampled at {rate:g} Hz, too slowly for a mode at {natural.max():.4g} Hz; "
            f"record at {4 * natural.max():.0f} Hz or more"
        )
    return float(natural.min()) / BELOW, high


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
