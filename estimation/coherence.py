"""Coherence: between inputs, and of each response with all inputs together."""

import numpy as np
from numpy.typing import NDArray

from .cross_spectra import CrossSpectra


def input_coherence(spectra: CrossSpectra) -> NDArray[np.float64]:
    """Ordinary coherence between inputs, ``|S_mn|^2 / (S_mm S_nn)`` (Mohammadi & Ahmadi, Eq. 9).

    Returns
    -------
    (n_frequencies, n_excitations, n_excitations), 0 ... 1; 0 where an input has no power.
    """
    s = spectra.input_spectra
    power = np.real(np.einsum("kii->ki", s))
    product = power[:, :, None] * power[:, None, :]
    share = np.divide(np.abs(s) ** 2, product, out=np.zeros(s.shape), where=product > 0)
    return np.asarray(np.minimum(share, 1.0))


def multiple_coherence(spectra: CrossSpectra) -> NDArray[np.float64]:
    """Share of each response's power that all inputs together explain linearly (Eq. 10).

    ``S_pF S_FF^-1 S_pF^H / S_pp``; with a pseudo-inverse where the inputs are dependent, so that a rank-deficient
    line gives the share that the inputs it has explain.

    Returns
    -------
    (n_frequencies, n_responses), 0 ... 1; 0 where a response has no power.
    """
    s_ff, s_xf = spectra.input_spectra, spectra.cross_spectra
    scale = np.sqrt(np.real(np.einsum("kii->ki", s_ff)))
    safe = np.where(scale > 0, scale, 1.0)
    normal = s_ff / safe[:, :, None] / safe[:, None, :]
    cross = s_xf / safe[:, None, :]
    inverse = np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
    explained = np.real(np.einsum("kpi,kij,kpj->kp", cross, inverse, cross.conj(), optimize=True))
    total = np.real(np.einsum("kpp->kp", spectra.output_spectra))
    share = np.divide(explained, total, out=np.zeros(total.shape), where=total > 0)
    return np.asarray(np.clip(share, 0.0, 1.0))
