"""Entries that several taps gave, by least squares: values, coherence and averages."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .sums import TapSums

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
DRIVEN = 1e-4
"""Power of the force over its largest, down to which an FRF is given: 40 dB."""

INDEPENDENT = 1e-4
"""Smallest over largest eigenvalue of the scaled force spectra of several inputs, as for H1."""


@dataclass(frozen=True)
class Entries:
    """Some rows and columns of an FRF matrix.

    Parameters
    ----------
    values : (n_frequencies, n_rows, n_columns), complex
        Values of the FRF in these rows and columns.
    coherence : (n_frequencies, n_rows, n_columns)
        Ordinary coherence, 0 to 1; NaN where it is not known.
    averages : (n_rows, n_columns), int
        Number of averages behind each entry.
    valid : (n_frequencies,), bool
        Whether the line has an FRF.
    """

    values: Complex
    coherence: Real
    averages: NDArray[np.int64]
    valid: NDArray[np.bool_]


def solve_entries(tests: Sequence[TapSums], responses: Sequence[str], excitations: Sequence[str]) -> Entries:
    """``S_xf S_ff^-1`` over all taps of tests that measured the same responses, with what it leaves unexplained."""
    n, n_rows, n_columns = len(tests[0].frequencies), len(responses), len(excitations)
    power, cross = np.zeros((n, n_columns, n_columns), complex), np.zeros((n, n_rows, n_columns), complex)
    output, counts = np.zeros((n, n_rows)), np.zeros(n_columns, dtype=np.int64)
    for test in tests:
        columns = [excitations.index(label) for label in test.excitations]
        rows = [test.responses.index(label) for label in responses]
        power[np.ix_(range(n), columns, columns)] += test.input_power
        cross[:, :, columns] += test.cross[:, rows]
        output += test.output_power[:, rows]
        counts[columns] += test.counts
    valid = _independent(power)
    inverse = np.zeros_like(power)
    inverse[valid] = np.linalg.inv(power[valid])
    values = cross @ inverse
    explained = np.real(np.einsum("kpq,kpq->kp", values, cross.conj()))
    spare, own = int(counts.sum()) - n_columns, np.maximum(counts - 1, 0)
    coherence = np.full(values.shape, np.nan)
    if spare > 0:
        noise = np.maximum(output - explained, 0.0) / spare
        variance = noise[:, :, None] * np.real(np.einsum("kqq->kq", inverse))[:, None, :]
        size = np.abs(values) ** 2
        whole = size + own * variance
        known = valid[:, None, None] & (own > 0) & (whole > 0)
        np.divide(size, whole, out=coherence, where=known)
    return Entries(values, coherence, np.tile(counts, (n_rows, 1)), valid)


def _independent(power: Complex) -> NDArray[np.bool_]:
    own = np.real(np.einsum("kqq->kq", power))
    valid = np.asarray((own > DRIVEN * own.max(axis=0)).all(axis=1))
    if own.shape[1] > 1 and valid.any():
        scale = np.sqrt(own[valid])
        eigenvalues = np.linalg.eigvalsh(power[valid] / scale[:, :, None] / scale[:, None, :])
        valid[valid] = eigenvalues[:, 0] > INDEPENDENT * eigenvalues[:, -1]
    return valid
