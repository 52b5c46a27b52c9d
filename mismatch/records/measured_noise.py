"""The noise of recordings whose forces repeat, measured from their periods: nothing unexplained is in it."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum, find_repeats, noise_of_periods, steady_periods
from foundation import InputError

Complex = NDArray[np.complex128]

INFERRED = "What the model leaves, of one smooth colour: what is unexplained may count as noise."
"""On what the noise rests where forces do not repeat."""


def with_measured_noise(lines: WindowedSpectrum) -> WindowedSpectrum:
    """The lines with the noise that their periods show; as they are where forces do not repeat.

    Silent stretches are not taken: they lack the noise that comes with the force.

    Parameters
    ----------
    lines
        Windowed lines of one recording.
    """
    repeated = find_repeats(lines.recording.force)
    if repeated is None:
        return lines
    band = float(lines.frequencies[0]), float(lines.frequencies[-1])
    try:
        noise = noise_of_periods(steady_periods([lines.recording], repeated).within(band))
        return replace(lines, noise=noise.at(lines.frequencies, lines.recording.rate))
    except InputError:
        # too few steady periods, or too few lines of them in the band
        return lines


def noise_content(lines: WindowedSpectrum, covariance: Complex) -> dict[str, Any]:
    """What the file says of one recording's noise: its share of the response, and on what it rests.

    Parameters
    ----------
    lines
        Windowed lines of the recording.
    covariance : (n_lines, n_responses, n_responses)
        Covariance of its noise at the lines.
    """
    own = np.einsum("kpp->p", covariance).real
    whole = np.sum(np.abs(lines.measured) ** 2, axis=0)
    share = float(np.sqrt(own.sum() / whole.sum()))
    kind = "inferred" if lines.noise is None else lines.noise.kind
    rests_on = INFERRED if lines.noise is None else lines.noise.statement
    return {
        "recording": lines.recording.name,
        "kind": kind,
        "share": share,
        "responses": [float(one) for one in np.sqrt(own / whole)],
        "rests_on": rests_on,
        "sentence": f"Noise of {lines.recording.name}: {100 * share:.2g} %, {kind}. {rests_on}",
    }
