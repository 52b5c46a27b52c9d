"""The band in which a model and recordings are compared, and why it is that band."""

from dataclasses import dataclass

from foundation import InputError
from modal_fit import ModalModel

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


def compared_band(model: ModalModel, rate: float) -> ComparedBand:
    """Return the band in which a model and a recording are compared.

    That is the band in which the model holds, where the model states one: outside, modes that the model does not have
    would look like left-out physics. A model that states none is compared from a third of its lowest mode to three
    times its highest.

    Parameters
    ----------
    model
        Model of the structure, with or without a band of its own.
    rate
        Sample rate of the recording, Hz.

    Raises
    ------
    InputError
        The recording is sampled too slowly for the model's highest mode or for its band.

    Examples
    --------
    >>> import numpy as np
    >>> from modal_fit import ModalModel
    >>> model = ModalModel(np.array([-1 + 100j]), np.ones((1, 1)), np.ones((1, 1)), ("T:+X",), ("T:+X",), band=(12, 24))
    >>> compared_band(model, 512.0).edges
    (12.0, 24.0)
    """
    edges = reach_of(model, rate)
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
