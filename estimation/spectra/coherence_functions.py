"""Coherence functions, and whether the inputs of a test are independent."""

from dataclasses import dataclass

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


RANK_TOLERANCE = 1e-4


@dataclass(frozen=True)
class InputIndependence:
    """Number of independent inputs on each line.

    Parameters
    ----------
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines.
    singular_values : (n_frequencies, n_excitations), N^2/Hz for forces
        Singular values of the input spectra, largest first.
    condition : (n_frequencies,)
        Largest over smallest singular value after each input is scaled to unit power on the line.
    rank : (n_frequencies,)
        Number of singular values of the scaled matrix above 1e-4 of the largest: an input direction with less than a
        ten-thousandth of the power (-40 dB) gives an FRF column that noise of 1 % rules.
    independent : (n_frequencies,), bool
        Whether the rank equals the number of inputs; elsewhere no FRF is given.
    n_tests
        Number of tests that are stacked.
    warnings
        One sentence each, naming bands and remedy.
    """

    frequencies: NDArray[np.float64]
    singular_values: NDArray[np.float64]
    condition: NDArray[np.float64]
    rank: NDArray[np.int64]
    independent: NDArray[np.bool_]
    n_tests: int
    warnings: tuple[str, ...]


def input_independence(spectra: CrossSpectra, band: tuple[float, float] | None = None) -> InputIndependence:
    """Singular values, condition and rank of S_ff on every line, with warnings for ``band`` (Hz; None: all lines).

    A single segment gives rank one whatever the inputs are, so the rank is also at most the number of segments.
    """
    s_ff = spectra.input_spectra
    n_inputs = s_ff.shape[1]
    raw = np.asarray(np.linalg.svd(s_ff, compute_uv=False, hermitian=True), dtype=np.float64)
    power = np.real(np.einsum("kii->ki", s_ff))
    scale = np.sqrt(np.where(power > 0, power, 1.0))
    scaled = np.linalg.svd(s_ff / scale[:, :, None] / scale[:, None, :], compute_uv=False, hermitian=True)
    largest = scaled[:, :1]
    rank = np.sum(scaled > RANK_TOLERANCE * np.where(largest > 0, largest, np.inf), axis=1)
    rank = np.minimum(rank, spectra.n_segments)
    condition = np.divide(largest[:, 0], scaled[:, -1], out=np.full(len(scaled), np.inf), where=scaled[:, -1] > 0)
    independent = rank == n_inputs
    warnings = _warnings(spectra, independent, rank, condition, band)
    return InputIndependence(spectra.frequencies, raw, condition, rank, independent, spectra.n_tests, warnings)


def independent_lines(spectra: CrossSpectra) -> NDArray[np.bool_]:
    """The flag ``independent`` of :func:`input_independence` alone, in half the time.

    Returns
    -------
    (n_frequencies,), bool
    """
    s_ff = spectra.input_spectra
    power = np.real(np.einsum("kii->ki", s_ff))
    scale = np.sqrt(np.where(power > 0, power, 1.0))
    scaled = s_ff / scale[:, :, None] / scale[:, None, :]
    n = s_ff.shape[1]
    # unit diagonal: the other eigenvalues' product is at most (n/(n-1))^(n-1), so that a large determinant proves it
    proof = RANK_TOLERANCE * n * (n / max(n - 1, 1)) ** (n - 1)
    found = np.real(np.linalg.det(scaled)) > proof
    doubtful = ~found & (power > 0).all(axis=1)
    values = np.linalg.eigvalsh(scaled[doubtful])
    found[doubtful] = values[:, 0] > RANK_TOLERANCE * values[:, -1]
    return np.asarray(found & (spectra.n_segments >= n))


def _warnings(
    spectra: CrossSpectra,
    independent: NDArray[np.bool_],
    rank: NDArray[np.int64],
    condition: NDArray[np.float64],
    band: tuple[float, float] | None,
) -> tuple[str, ...]:
    f = spectra.frequencies
    asked = f > 0 if band is None else (f >= band[0]) & (f <= band[1])
    n_inputs = spectra.input_spectra.shape[1]
    remedy = "add a test with another immersion, or mill porous material"
    warnings = []
    dependent = asked & ~independent
    if dependent.any():
        lowest = int(rank[dependent].min())
        warnings.append(
            f"the {n_inputs} inputs are not independent on {dependent.sum()} of {asked.sum()} lines "
            f"({bands_text(f, dependent)}): rank {lowest}; no FRF is given there: {remedy}"
        )
    poor = asked & independent & (condition > 1e3)
    if poor.any():
        warnings.append(
            f"the inputs are nearly dependent on {poor.sum()} of {asked.sum()} lines ({bands_text(f, poor)}): "
            f"condition up to {condition[poor].max():.1e}; the FRF is noisy there: {remedy}"
        )
    return tuple(warnings)


def bands_text(frequencies: NDArray[np.float64], chosen: NDArray[np.bool_], most: int = 4) -> str:
    """Runs of chosen lines as text, the widest few.

    Examples
    --------
    >>> bands_text(np.arange(6.0), np.array([1, 1, 0, 0, 1, 0], dtype=bool))
    '0-1 Hz, 4 Hz'
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    runs = [(int(start), int(stop) - 1) for start, stop in zip(edges[::2], edges[1::2], strict=True)]
    widest = sorted(sorted(runs, key=lambda run: run[0] - run[1])[:most])
    text = [
        f"{frequencies[a]:.4g} Hz" if a == b else f"{frequencies[a]:.4g}-{frequencies[b]:.4g} Hz" for a, b in widest
    ]
    return ", ".join(text) + (f" and {len(runs) - most} more bands" if len(runs) > most else "")
