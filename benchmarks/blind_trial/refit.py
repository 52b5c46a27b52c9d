"""How much of an effect no linear structure could imitate: its size after the freest linear refit.

A fault of gain, say, is a linear structure with other shapes: only what the lab believes of its model tells the two
apart. A true joint law leaves a residual at any poles and residues. To first order a change of them adds to each
acceleration a sum of ``2 Re(c w)``, ``w`` the responses of single modes to single forces and their derivatives by the
poles.
"""

import numpy as np
from numpy.typing import NDArray

from .excitation import KEPT, RATE
from .structures import Structure


def after_refit(structure: Structure, force: NDArray[np.float64], residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """RMS per channel (3,) of what least squares leaves of a residual (n, 3) over the recorded part.

    ``residual_p ~ sum_rq 2 Re(c_prq s^2 F_q / (s - pole_r)) + sum_r 2 Re(e_pr s^2 (left_r . F) / (s - pole_r)^2)``,
    with full residue matrices: a little freer than modes, whose residues have rank one.
    """
    n = 1 << 16
    s = 2j * np.pi * np.fft.fftfreq(n, 1 / RATE)[:, None]
    spectrum = s**2 * np.fft.fft(force, n, axis=0)
    columns = [np.ones((KEPT.stop - KEPT.start, 1))]
    for pole, left in zip(structure.poles, structure.left, strict=True):
        shifts = np.hstack([spectrum / (s - pole), (spectrum @ left)[:, None] / (s - pole) ** 2])
        responses = np.fft.ifft(shifts, axis=0)[KEPT]
        columns += [responses.real, responses.imag]
    basis = np.hstack(columns)
    basis /= np.linalg.norm(basis, axis=0)
    weights, *_ = np.linalg.lstsq(basis.T @ basis, basis.T @ residual[KEPT], rcond=1e-12)
    return np.asarray((residual[KEPT] - basis @ weights).std(axis=0))
