"""Noise where forces do not repeat: in silent stretches, else an upper bound from what narrow bands leave over."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from foundation import InputError

from ..band_recordings import BandRecording
from ..estimators import local_half_width, local_polynomial
from .noise_type import BOUND, SILENCE, MeasuredNoise, averaged_lines, parted
from .period_search import find_repeats

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

QUIET = 0.05
"""Force over its root mean square in the recording below which a block is silent."""

RUNG_OUT = 1.5
"""Power of a response in a silent block, over the middle of the quieter half of blocks, from which it still rings."""

FEWEST = 4
"""Silent blocks at least."""


def noise_in_silence(
    recordings: Sequence[BandRecording], band: tuple[float, float], block: float | None = None
) -> MeasuredNoise | None:
    """Noise in blocks without force, once the structure has rung out; None where there are fewer than four.

    The covariance is the mean of those of the Hann-windowed blocks. A silent structure is not the one that works:
    noise that comes with the force (cables that move, range of the converter) is not seen.

    Parameters
    ----------
    recordings
        Recordings of the same channels and sample rate.
    band : Hz
        Lowest and highest frequency of the lines.
    block : s
        Length of a block; None: eight lines within the band, or a quarter of a second where that is longer.
    """
    first = recordings[0]
    seconds = max(8.0 / (band[1] - band[0]), 0.25, 2.0 / band[0]) if block is None else block
    n = round(seconds * first.rate)
    window = np.hanning(n + 1)[:-1, None]
    window = window / np.sqrt(np.sum(window**2))
    spectra = [rfft((cut - cut.mean(axis=0)) * window, axis=0) for one in recordings for cut in _silent_blocks(one, n)]
    if len(spectra) < FEWEST:
        return None
    frequencies = np.arange(n // 2 + 1) * first.rate / n
    kept = (frequencies >= band[0]) & (frequencies <= band[1])
    lines = np.array(spectra)[:, kept].transpose(1, 2, 0)
    m = first.force.shape[1]
    averaged, freedom = averaged_lines(lines @ lines.conj().transpose(0, 2, 1) / len(spectra), len(spectra))
    level = _levels(recordings, band)
    own = np.sqrt(np.einsum("kpp->kp", averaged).real.mean(axis=0)) / level
    responses, forces, cross = parted(averaged, m)
    said = (
        f"{len(spectra)} blocks of {n / first.rate:.3g} s without force (below {100 * QUIET:g} % of its root mean "
        "square), after the structure rang out; noise that comes with the force is not in it."
    )
    return MeasuredNoise(
        frequencies[kept], first.rate, responses, forces, cross, SILENCE, freedom, own[m:], own[:m], said
    )


def noise_bound(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Upper bound of the noise: what forces do not explain in narrow bands, in the responses alone.

    Around each line the response is a polynomial FRF times the forces and a polynomial transient
    (:func:`local_polynomial`); the misfit holds noise of responses and forces, and all distortion that is not smooth in
    frequency. Forces must be rough in frequency.

    Parameters
    ----------
    recordings
        Recordings of the same channels and sample rate; all are cut to the shortest.
    band : Hz
        Lowest and highest frequency of the lines.

    Raises
    ------
    InputError
        See :func:`local_polynomial`; forces that repeat, or that are dependent at every line.
    """
    for one in recordings:
        if find_repeats(one.force) is not None:  # few lines are excited, and their FRF takes up all that they hold
            raise InputError(f"{one.name}: the forces repeat, and this would be no bound; use noise_of_periods")
    frf = local_polynomial(recordings, band)
    if frf.covariance is None or not frf.valid.any():
        raise InputError(f"forces are dependent at every line from {band[0]:g} to {band[1]:g} Hz; excite them apart")
    m, tests = frf.values.shape[2], len(recordings)
    freedom = (2 * local_half_width(tests, m) + 1) * tests - 3 * (m + tests)
    covariance = frf.covariance.response[frf.valid]
    averaged, behind = averaged_lines(covariance, freedom)
    own = np.sqrt(np.einsum("kpp->kp", averaged).real.mean(axis=0)) / _levels(recordings, band)[m:]
    none = np.zeros((len(averaged), m, m), dtype=complex)
    said = (
        f"What {tests} recording{'s' if tests > 1 else ''} leave of a local polynomial FRF and transient in bands of "
        f"{2 * local_half_width(tests, m) + 1} lines: an upper bound, because distortion is counted as noise."
    )
    return MeasuredNoise(
        frf.frequencies[frf.valid],
        recordings[0].rate,
        averaged,
        none,
        np.zeros((len(averaged), averaged.shape[1], m), dtype=complex),
        BOUND,
        behind,
        own,
        np.full(m, np.nan),
        said,
    )


def _silent_blocks(recording: BandRecording, n: int) -> list[Real]:
    """Blocks (n, n_channels) without force in which no response rings any more."""
    force = recording.force - np.median(recording.force, axis=0)
    power = np.sum(force**2, axis=1)
    limit = QUIET**2 * power.mean()
    joint = np.concatenate([recording.force, recording.response], axis=1)
    quiet = [
        joint[first : first + n]
        for first in range(0, len(power) - n + 1, n)
        if limit > 0 and power[first : first + n].mean() < limit and power[first : first + n].max() < 25 * limit
    ]
    if len(quiet) < FEWEST:
        return []
    level = np.array([cut[:, force.shape[1] :].var(axis=0) for cut in quiet])
    usual = np.median(np.sort(level, axis=0)[: (len(level) + 1) // 2], axis=0)
    return [cut for cut, own in zip(quiet, level, strict=True) if np.all(own <= RUNG_OUT * usual)]


def _levels(recordings: Sequence[BandRecording], band: tuple[float, float]) -> Real:
    """Root mean square line of forces, then responses, inside the band, (n_channels,)."""
    powers = []
    for one in recordings:
        joint = np.concatenate([one.force, one.response], axis=1)
        spectrum = rfft(joint - joint.mean(axis=0), axis=0) / np.sqrt(len(joint))
        axis = np.arange(len(spectrum)) * one.rate / len(joint)
        powers.append(np.mean(np.abs(spectrum[(axis >= band[0]) & (axis <= band[1])]) ** 2, axis=0))
    return np.asarray(np.sqrt(np.maximum(np.mean(powers, axis=0), 1e-300)))
