"""Power spectra drawn into axes: how much of each excitation or response there is, over frequency."""

import numpy as np
from matplotlib.axes import Axes

from estimation import CrossSpectra
from foundation import InputError

from ..axes import given_or_new, legend_beside
from ..style import line_style

SIDES = ("excitations", "responses")


def draw_spectra(spectra: CrossSpectra, axes: Axes | None = None, *, side: str = "excitations") -> Axes:
    """Power spectral density of each channel of one side, on a logarithmic axis.

    Parameters
    ----------
    spectra
        Of one test or of several.
    axes
        To draw into; None: new ones.
    side
        ``excitations`` or ``responses``.

    Raises
    ------
    InputError
        Another side.
    """
    if side not in SIDES:
        raise InputError(f"unknown side {side!r} of spectra; use one of {', '.join(SIDES)}")
    channels = spectra.excitations if side == "excitations" else spectra.responses
    matrix = spectra.input_spectra if side == "excitations" else spectra.output_spectra
    power = np.real(np.einsum("kii->ki", matrix))
    units = list(dict.fromkeys(channel.unit for channel in channels))
    one_unit = f"(({units[0]})²/Hz)" if "/" in units[0] else f"({units[0]}²/Hz)"
    with given_or_new(axes) as shown:
        for number, channel in enumerate(channels):
            label = channel.name if len(units) == 1 else f"{channel.name} ({channel.unit})²/Hz"
            drawn = np.where(power[:, number] > 0, power[:, number], np.nan)
            shown.plot(spectra.frequencies, drawn, label=label, **line_style(number))
        shown.set_yscale("log")
        shown.set_xlabel("Frequency (Hz)")
        shown.set_ylabel(f"Power spectral density {one_unit.replace('^2', '²') if len(units) == 1 else '(unit²/Hz)'}")
        if axes is None:
            shown.set_xlim(spectra.frequencies[0], spectra.frequencies[-1])
        legend_beside(shown)
    return shown
