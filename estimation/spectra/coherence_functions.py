"""Coherence functions, and the test whether the inputs of a test are independent."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Index, Real

from ..settings import RECORDINGS
from .cross_spectra import CrossSpectra
from .trusted_samples import runs_of_true


def powers(spectra: Complex) -> Real:
    """Return the real diagonals (n_lines, n) of spectral matrices (n_lines, n, n)."""
    return np.asarray(np.real(np.einsum("kii->ki", spectra)))


def scaled_by(spectra: Complex, power: Real) -> Complex:
    """Divide spectral matrices by the roots of powers (n_lines, n) on both sides; a power of 0 leaves its row unscaled.

    Coherences and ranks then do not depend on the units of the channels.
    """
    scale = np.sqrt(np.where(power > 0, power, 1.0))
    return np.asarray(spectra / scale[:, :, None] / scale[:, None, :])


def input_coherence(spectra: CrossSpectra) -> Real:
    """Compute the ordinary coherence between inputs, ``|S_mn|^2 / (S_mm S_nn)`` (Mohammadi & Ahmadi, Eq. 9).

    Returns
    -------
    (n_frequencies, n_excitations, n_excitations), 0 to 1; 0 where an input has no power.
    """
    s, power = spectra.input_spectra, powers(spectra.input_spectra)
    product = power[:, :, None] * power[:, None, :]
    return np.asarray(np.minimum(np.divide(np.abs(s) ** 2, product, out=np.zeros(s.shape), where=product > 0), 1.0))


def multiple_coherence(spectra: CrossSpectra) -> Real:
    """Compute the share (n_frequencies, n_responses) of each response's power that all inputs explain (Eq. 10).

    It is ``S_pF S_FF^-1 S_pF^H / S_pp``, with a pseudo-inverse where the inputs are dependent; 0 where a response has
    no power.
    """
    power = powers(spectra.input_spectra)
    cross = spectra.cross_spectra / np.sqrt(np.where(power > 0, power, 1.0))[:, None, :]
    inverse = np.linalg.pinv(scaled_by(spectra.input_spectra, power), rcond=1e-10, hermitian=True)
    explained = np.real(np.einsum("kpi,kij,kpj->kp", cross, inverse, cross.conj(), optimize=True))
    return explained_share(explained, spectra)


def explained_share(explained: Real, spectra: CrossSpectra) -> Real:
    """Return explained power over total power of each response (n_frequencies, n_responses), limited to 0 to 1."""
    total = powers(spectra.output_spectra)
    return np.asarray(np.clip(np.divide(explained, total, out=np.zeros(total.shape), where=total > 0), 0.0, 1.0))


@dataclass(frozen=True)
class InputIndependence:
    """Number of independent inputs on each line."""

    frequencies: Real  # (n_frequencies,), Hz
    # (n_frequencies, n_excitations), N^2/Hz for forces; singular values of the input spectra, largest first
    singular_values: Real
    # (n_frequencies,); largest over smallest singular value after each input is scaled to unit power on the line
    condition: Real
    rank: Index  # (n_frequencies,); number of singular values of the scaled matrix above 1e-4 of the largest
    # (n_frequencies,); whether the rank equals the number of inputs; no FRF is given on other lines
    independent: NDArray[np.bool_]
    n_tests: int  # number of tests that are stacked
    warnings: tuple[str, ...]  # one sentence each, with bands and remedy


def input_independence(spectra: CrossSpectra, band: tuple[float, float] | None = None) -> InputIndependence:
    """Compute singular values, condition and rank of the input spectra on every line.

    A single segment has rank one for any inputs, so that the rank is at most the number of segments.

    Parameters
    ----------
    spectra
        Spectra of one test, or of several summed.
    band : Hz
        Band in which dependent inputs give a warning; None: all lines.
    """
    s_ff = spectra.input_spectra
    singular_values = np.asarray(np.linalg.svd(s_ff, compute_uv=False, hermitian=True), dtype=np.float64)
    scaled = np.linalg.svd(scaled_by(s_ff, powers(s_ff)), compute_uv=False, hermitian=True)
    largest = scaled[:, :1]
    rank = np.sum(scaled > RECORDINGS.independent * np.where(largest > 0, largest, np.inf), axis=1)
    rank = np.minimum(rank, spectra.n_segments)
    condition = np.divide(largest[:, 0], scaled[:, -1], out=np.full(len(scaled), np.inf), where=scaled[:, -1] > 0)
    independent = rank == s_ff.shape[1]
    warnings = _warnings(spectra, independent, rank, condition, band)
    return InputIndependence(
        spectra.frequencies, singular_values, condition, rank, independent, spectra.n_tests, warnings
    )


def independent_lines(spectra: CrossSpectra) -> NDArray[np.bool_]:
    """Compute only the flag ``independent`` (n_frequencies,) of :func:`input_independence`, in half the time."""
    power = powers(spectra.input_spectra)
    scaled = scaled_by(spectra.input_spectra, power)
    n = scaled.shape[1]
    # with a unit diagonal, the product of the other eigenvalues is at most (n/(n-1))^(n-1): a determinant above this
    # bound proves that the smallest eigenvalue is large enough
    proof = RECORDINGS.independent * n * (n / max(n - 1, 1)) ** (n - 1)
    independent = np.real(np.linalg.det(scaled)) > proof
    undecided = ~independent & (power > 0).all(axis=1)
    values = np.linalg.eigvalsh(scaled[undecided])
    independent[undecided] = values[:, 0] > RECORDINGS.independent * values[:, -1]
    return np.asarray(independent & (spectra.n_segments >= n))


def _warnings(
    spectra: CrossSpectra,
    independent: NDArray[np.bool_],
    rank: Index,
    condition: Real,
    band: tuple[float, float] | None,
) -> tuple[str, ...]:
    f = spectra.frequencies
    inside = f > 0 if band is None else (f >= band[0]) & (f <= band[1])
    n_inputs = spectra.input_spectra.shape[1]
    remedy = "add a test with another immersion, or mill porous material"
    warnings = []
    dependent = inside & ~independent
    if dependent.any():
        warnings.append(
            f"the {n_inputs} inputs are not independent on {dependent.sum()} of {inside.sum()} lines "
            f"({bands_text(f, dependent)}): rank {int(rank[dependent].min())}; no FRF is given there: {remedy}"
        )
    poor = inside & independent & (condition > RECORDINGS.nearly_dependent)
    if poor.any():
        warnings.append(
            f"the inputs are nearly dependent on {poor.sum()} of {inside.sum()} lines ({bands_text(f, poor)}): "
            f"condition up to {condition[poor].max():.1e}; the FRF is noisy there: {remedy}"
        )
    return tuple(warnings)


def bands_text(frequencies: Real, chosen: NDArray[np.bool_], most: int = 4) -> str:
    """Write the widest runs of chosen lines (n_frequencies,) as text.

    Examples
    --------
    >>> bands_text(np.arange(6.0), np.array([1, 1, 0, 0, 1, 0], dtype=bool))
    '0-1 Hz, 4 Hz'
    """
    runs = [(start, stop - 1) for start, stop in runs_of_true(chosen)]
    widest = sorted(sorted(runs, key=lambda run: run[0] - run[1])[:most])
    text = [
        f"{frequencies[a]:.4g} Hz" if a == b else f"{frequencies[a]:.4g}-{frequencies[b]:.4g} Hz" for a, b in widest
    ]
    return ", ".join(text) + (f" and {len(runs) - most} more bands" if len(runs) > most else "")
