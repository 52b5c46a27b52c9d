"""Correlations of past and future samples, summed over stacked tests: all a subspace fit needs of the data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecord
from foundation import InputError

_CHUNK = 4096


@dataclass(frozen=True)
class CorrelationBlocks:
    """Sum of ``z z^T`` over tests and samples; z = (future force, past force, past response, future response).

    Parameters
    ----------
    matrix : (n, n) with n = 2 block_rows (n_excitations + n_responses)
        The sum, for channels scaled to unit root mean square.
    block_rows
        Number of samples in the past and in the future.
    n_excitations, n_responses
        Numbers of channels on either side.
    response_scale : (n_responses,)
        Root mean square of each response over all tests.
    sample_rate : Hz
        Samples a second.
    n_samples
        Number of columns z that were summed.
    """

    matrix: NDArray[np.float64]
    block_rows: int
    n_excitations: int
    n_responses: int
    response_scale: NDArray[np.float64]
    sample_rate: float
    n_samples: int


def correlation_blocks(records: Sequence[BandRecord], block_rows: int) -> CorrelationBlocks:
    """Sum the correlation blocks of all tests; no test's samples meet another's.

    Raises
    ------
    InputError
        No record, records of different rates or channels, or too few samples for ``block_rows``.
    """
    if not records:
        raise InputError("no record to fit; give at least one recording")
    first = records[0]
    for number, record in enumerate(records[1:], start=2):
        if record.sample_rate != first.sample_rate:
            raise InputError(
                f"test {number} has {record.sample_rate:g} Hz after decimation, test 1 has {first.sample_rate:g} Hz; "
                "stack tests of one sample rate"
            )
        if (record.excitations, record.responses) != (first.excitations, first.responses):
            raise InputError(f"test {number} has other channels than test 1; stack tests of one set-up only")
    excitation_scale = _root_mean_square([r.excitation_samples for r in records])
    response_scale = _root_mean_square([r.response_samples for r in records])
    n_in, n_out = len(excitation_scale), len(response_scale)
    size = 2 * block_rows * (n_in + n_out)
    matrix = np.zeros((size, size))
    n_samples = 0
    for record in records:
        force = (record.excitation_samples - record.excitation_samples.mean(axis=0)) / excitation_scale
        motion = (record.response_samples - record.response_samples.mean(axis=0)) / response_scale
        count = len(force) - 2 * block_rows + 1
        for start in range(0, max(count, 0), _CHUNK):
            stop = min(start + _CHUNK, count)
            rows = _stacked(force, motion, block_rows, start, stop)
            matrix += rows.T @ rows
            n_samples += stop - start
    if n_samples < 2 * size:
        raise InputError(
            f"{n_samples} samples after decimation are too few for {size} correlation rows; "
            "record longer or use fewer block rows"
        )
    return CorrelationBlocks(matrix, block_rows, n_in, n_out, response_scale, first.sample_rate, n_samples)


def _root_mean_square(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    power = sum(np.sum((part - part.mean(axis=0)) ** 2, axis=0) for part in parts) / sum(len(part) for part in parts)
    return np.asarray(np.sqrt(np.where(power > 0, power, 1.0)))


def _stacked(
    force: NDArray[np.float64], motion: NDArray[np.float64], block_rows: int, start: int, stop: int
) -> NDArray[np.float64]:
    """Rows (future force, past force, past response, future response) for samples start..stop-1."""
    shifts = range(block_rows)
    pieces = []
    for samples, offset in ((force, block_rows), (force, 0), (motion, 0), (motion, block_rows)):
        pieces += [samples[start + offset + k : stop + offset + k] for k in shifts]
    return np.hstack(pieces)
