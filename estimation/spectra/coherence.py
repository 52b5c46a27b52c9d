"""Coherence: between inputs, and of each response with all inputs together."""

import numpy as np
from numpy.typing import NDArray

from .spectral_matrix import CrossSpectra


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


def partial_coherence(spectra: CrossSpectra) -> NDArray[np.float64]:
    """Coherence of each response with each input after all other inputs are taken out of both.

    From the inverse P of the spectral matrix of inputs and response: ``|P_xq|^2 / (P_xx P_qq)`` (Bendat & Piersol,
    Random Data, 4th ed., section 7.3, in matrix form).

    Returns
    -------
    (n_frequencies, n_responses, n_excitations), 0 ... 1; 0 where inputs are dependent or a response has no power.
    """
    n = len(spectra.excitations)
    found = np.zeros(spectra.cross_spectra.shape)
    power = np.real(np.einsum("kii->ki", spectra.input_spectra))
    for p in range(len(spectra.responses)):
        matrix = np.empty((len(found), n + 1, n + 1), dtype=complex)
        matrix[:, :n, :n] = spectra.input_spectra
        matrix[:, n, :n] = spectra.cross_spectra[:, p]
        matrix[:, :n, n] = spectra.cross_spectra[:, p].conj()
        matrix[:, n, n] = spectra.output_spectra[:, p, p]
        root = np.sqrt(np.column_stack([power, np.real(spectra.output_spectra[:, p, p])]))
        usable = (root > 0).all(axis=1)
        scaled = matrix[usable] / root[usable][:, :, None] / root[usable][:, None, :]
        inverse = np.linalg.inv(scaled + 1e-14 * np.eye(n + 1))
        diagonal = np.real(np.einsum("kii->ki", inverse))
        share = np.abs(inverse[:, n, :n]) ** 2 / (diagonal[:, n:] * diagonal[:, :n])
        found[usable, p] = np.clip(share, 0.0, 1.0)
    return found


def principal_inputs(spectra: CrossSpectra) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Principal components of the inputs, ``S_ff = U diag(power) U^H``, strongest first.

    Returns
    -------
    power : (n_frequencies, n_excitations), unit^2 / Hz
    directions : (n_frequencies, n_excitations, n_excitations)
        Columns of U: the share of each input in a component.
    """
    power, vectors = np.linalg.eigh(spectra.input_spectra)
    return np.maximum(power[:, ::-1], 0.0), np.asarray(vectors[:, :, ::-1])


def virtual_coherence(spectra: CrossSpectra) -> NDArray[np.float64]:
    """Coherence of each response with each principal component of the inputs; they sum to the multiple coherence.

    ``|S_xf u_i|^2 / (S_xx power_i)``: the components are uncorrelated, so that each explains its own share.

    Returns
    -------
    (n_frequencies, n_responses, n_excitations), 0 ... 1; 0 for components without power.
    """
    power, directions = principal_inputs(spectra)
    cross = np.abs(spectra.cross_spectra @ directions) ** 2
    total = np.real(np.einsum("kpp->kp", spectra.output_spectra))
    product = total[:, :, None] * power[:, None, :]
    seen = (power > 1e-12 * power[:, :1])[:, None, :] & (total > 0)[:, :, None]
    return np.asarray(np.clip(np.divide(cross, product, out=np.zeros(cross.shape), where=seen), 0.0, 1.0))
