"""What a hypothesis shows of a recording, and what it leaves of it, sample by sample."""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft

from estimation import WindowedSpectrum

from ..models import Hypothesis, predict_lines

Real = NDArray[np.float64]


def shown_and_left(hypothesis: Hypothesis, one: WindowedSpectrum) -> tuple[Real, Real]:
    """The predicted response and the residual, (n, n_responses) each, in the responses' units.

    The run-in is left out, and the last half second, in which the padding ends.

    Parameters
    ----------
    hypothesis
        What predicts the recording.
    one
        Windowed lines of the recording.
    """
    n = len(one.recording.force)
    shown = irfft(predict_lines(hypothesis, one).spectrum, n=one.padded, axis=0)[:n]
    kept = slice(one.start, n - int(one.recording.rate) // 2)
    return np.asarray(shown[kept]), np.asarray((one.recording.response - shown)[kept])
