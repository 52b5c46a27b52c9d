"""How much of the response a hypothesis leaves, whatever it is made of."""

import numpy as np

from estimation import WindowedSpectrum

from ..models import Hypothesis, shares_left


def share_of_response(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> float:
    """Root mean square of the residual as a share of the response's, over all channels and recordings.

    ``sqrt(mean_i sum_k |Y_ik - P_ik|^2 / sum_k |Y_ik|^2)`` over channels i of all recordings and lines k.

    Parameters
    ----------
    hypothesis
        What predicts the recordings.
    lines
        Windowed lines of the recordings.
    """
    return float(np.sqrt(np.mean([shares_left(hypothesis, one) for one in lines])))
