"""Predicted beside measured: a factor of a wrong unit, or a sensor that was turned round."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

ALIKE = 0.8
"""Correlation from which predicted and measured are one signal but for a factor."""

NEAR = 0.15
"""Share by which a factor may differ from that of a unit."""

UNITS = (
    (9.80665, "were accelerations in g called m/s^2? Multiply them by 9.80665"),
    (1 / 9.80665, "were accelerations multiplied by 9.80665 though they were in m/s^2?"),
    (1e3, "were forces in mN called N, or motions in km called m?"),
    (1e-3, "were forces in kN called N, or motions in mm called m? Multiply forces by 1000"),
)
"""Predicted over measured, and what it most likely means."""


def check_scales(names: Sequence[str], measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> list[str]:
    """Judge each response's size and sign by comparison with the prediction.

    ``gain = <predicted, measured> / <measured, measured>``, told where the two are one signal but for a factor that a
    wrong unit or a sensor turned round gives.

    Parameters
    ----------
    names
        Names of the responses.
    measured, predicted : (n_samples, n_responses)
        Measured and predicted responses in the same unit, after the run-in.

    Returns
    -------
    list of str
        Doubts: sentences for a warning; empty where nothing is odd.
    """
    doubts = []
    centred = [(signal - signal.mean(axis=0)).T for signal in (measured, predicted)]
    for name, m, p in zip(names, *centred, strict=True):
        sizes = float(np.sqrt((m @ m) * (p @ p)))
        likeness = float(m @ p) / sizes if sizes > 0 else 0.0
        if abs(likeness) < ALIKE:
            continue
        gain = float(p @ p) / abs(float(m @ p))
        if likeness < 0:
            doubts.append(
                f"{name}: measured is predicted with the opposite sign: was the sensor turned round? Correct its "
                "direction in the recording"
            )
        for factor, meaning in UNITS:
            if abs(gain / factor - 1) < NEAR:
                doubts.append(f"{name}: predicted is {gain:.4g} times measured: {meaning}")
    return doubts
