"""How much of the response a hypothesis leaves, whatever it is made of."""

import numpy as np

from estimation import WindowedSpectrum

from ..models import Hypothesis, predict_lines


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
    shares = []
    for one in lines:
        rest = one.measured - predict_lines(hypothesis, one).response
        shares.append(np.sum(np.abs(rest) ** 2, axis=0) / np.sum(np.abs(one.measured) ** 2, axis=0))
    return float(np.sqrt(np.mean(np.concatenate(shares))))
