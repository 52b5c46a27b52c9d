"""Periods of a recording as spectra without leakage: cut at fractions of samples, the beginning left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import Complex, InputError, Real

from ..band_recordings.band_recording import BandRecording
from .period_search import ALIKE, RepeatedForce, find_repeats

TRANSIENT = 4.0
"""Power of the change to the next period, over that of later changes, from which a period is part of a transient."""

DRIVEN = 1e-3
"""Power of the forces in a band, over the largest, from which the band is excited."""

GROUP = 16
"""Lines whose power is added up for that: a transient rings in few of them."""

HALF_TAPS = 32
"""Samples on either side from which a sample between samples is interpolated."""

SAME_FORCE = 0.99
"""Correlation of two realisations at the best lag from which they are the same."""


@dataclass(frozen=True)
class Realisation:
    """Steady periods of one realisation of the forces, as spectra.

    Parameters
    ----------
    name
        Recording, with the number of the realisation where it holds several.
    forces : (n_periods, n_lines, n_excitations)
        Spectra of the forces, scaled so that white noise of variance v has variance v a line.
    responses : (n_periods, n_lines, n_responses)
        Spectra of the responses, in the same scale.
    left_out
        Number of periods before them that belong to the transient.
    """

    name: str
    forces: Complex
    responses: Complex
    left_out: int

    @property
    def n_periods(self) -> int:
        """Number of steady periods."""
        return len(self.forces)


@dataclass(frozen=True)
class SteadyPeriods:
    """Spectra of periods, realisation by realisation, on the lines k / T.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Lines k / T from k = 1 up to the end of the usable band.
    rate : Hz
        Sample rate of the recordings.
    period : s
        Period T of the forces.
    realisations
        One entry for each realisation.
    excitations, responses
        Channels along the last axes.
    """

    frequencies: Real
    rate: float
    period: float
    realisations: tuple[Realisation, ...]
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Number k of each line, (n_lines,)."""
        return np.rint(self.frequencies * self.period).astype(np.int64)

    @property
    def level(self) -> float:
        """Root mean square of the forces at the lines, all directions and realisations together, N."""
        means = np.array([np.sum(np.abs(one.forces.mean(axis=0)) ** 2) for one in self.realisations])
        n = round(self.period * self.rate)
        return float(np.sqrt(2 * means.mean() / n))

    def within(self, band: tuple[float, float]) -> "SteadyPeriods":
        """Only the lines inside ``band`` (Hz)."""
        kept = (self.frequencies >= band[0]) & (self.frequencies <= band[1])
        if not kept.any():
            raise InputError(f"no line of 1/{self.period:.4g} s between {band[0]:g} and {band[1]:g} Hz; widen the band")
        cut = tuple(
            Realisation(one.name, one.forces[:, kept], one.responses[:, kept], one.left_out)
            for one in self.realisations
        )
        return SteadyPeriods(self.frequencies[kept], self.rate, self.period, cut, self.excitations, self.responses)


def steady_periods(recordings: Sequence[BandRecording], repeated: RepeatedForce | None = None) -> SteadyPeriods:
    """Cut the steady periods out of recordings whose forces repeat after the same time.

    Period i of a realisation is left out while ``|X_i+1 - X_i|^2`` in any excited band of 16 lines is four times the
    median of the later changes and twice the next: what rings falls from period to period, noise and drift do not. Two
    changes at least are kept, so that a recording of two or three periods is taken as steady.

    Parameters
    ----------
    recordings
        Recordings of the same channels and sample rate; other levels belong into another call.
    repeated
        Period and stretches of the only recording, where they are known; None: looked for.

    Raises
    ------
    InputError
        No recording, forces that do not repeat, or other periods in other recordings.
    """
    if not recordings:
        raise InputError("no recording; give at least one")
    first = recordings[0]
    pieces: list[Realisation] = []
    period = 0.0
    for recording in recordings:
        found = repeated or find_repeats(recording.force)
        if found is None:
            raise InputError(
                f"{recording.name}: the forces do not repeat (correlation below {ALIKE:g} at every lag); "
                "use noise_in_silence or noise_bound"
            )
        own = found.period / recording.rate
        if period and abs(own - period) > 1e-6 * period:
            raise InputError(
                f"{recording.name}: forces repeat after {own:.6g} s, before after {period:.6g} s; part them"
            )
        period = own
        pieces += _realisations(recording, found)
    n = round(period * first.rate)
    kept = np.arange(1, int(first.usable_band * period) + 1)
    lined = tuple(Realisation(one.name, one.forces[:, kept], one.responses[:, kept], one.left_out) for one in pieces)
    if len(kept) > n // 2:
        raise InputError(f"a period of {n} samples is too short; record longer periods")
    return SteadyPeriods(kept / period, first.rate, period, lined, first.excitations, first.responses)


def same_forces(first: Realisation, second: Realisation) -> bool:
    """Whether two realisations are one, whatever the level and the instant at which the period begins."""
    a, b = first.forces.mean(axis=0), second.forces.mean(axis=0)
    cross = np.sum(a * b.conj(), axis=1)
    likeness = np.abs(np.fft.irfft(np.concatenate([[0.0], cross, np.zeros(len(cross))]))).max() * 2 * len(cross)
    return bool(likeness > SAME_FORCE * np.linalg.norm(a) * np.linalg.norm(b))


def _realisations(recording: BandRecording, found: RepeatedForce) -> list[Realisation]:
    joint = np.concatenate([recording.force, recording.response], axis=1)
    m = recording.force.shape[1]
    result = []
    for number, stretch in enumerate(found.stretches):
        start, n_periods = float(stretch.start), stretch.n_periods
        if not found.period.is_integer():  # interpolation needs neighbours at either end
            start = max(start, HALF_TAPS)
            n_periods = int(
                (min(len(joint) - HALF_TAPS, stretch.start + n_periods * found.period) - start) // found.period
            )
        if n_periods < 2:
            continue
        periods = between_samples(joint, start, found.period, n_periods)
        spectra = scipy.fft.rfft(periods - periods.mean(axis=(0, 1)), axis=1) / np.sqrt(periods.shape[1])
        out = _transient(spectra[:, 1:, :m], spectra[:, 1:, m:])
        name = recording.name if len(found.stretches) == 1 else f"{recording.name}, realisation {number + 1}"
        result.append(Realisation(name, spectra[out:, :, :m], spectra[out:, :, m:], out))
    if not result:
        raise InputError(f"{recording.name}: no two whole periods of {found.period:.6g} samples; record more periods")
    return result


def between_samples(samples: Real, start: float, period: float, n_periods: int) -> Real:
    """Periods (n_periods, round(period), n) of samples (n_samples, n), interpolated where ``period`` has a fraction.

    Interpolated by a sinc under a Kaiser window over 64 samples: 1e-4 of a line below 80 % of half the sample rate.

    Parameters
    ----------
    samples : (n_samples, n)
        Samples of all channels.
    start, period : samples
        First sample, and length of a period.
    n_periods
        Number of periods.

    Examples
    --------
    >>> time = np.arange(1000.0)
    >>> cut = between_samples(np.cos(2 * np.pi * 3 * time / 100.3)[:, None], 40.0, 100.3, 8)
    >>> bool(np.abs(cut - cut[0]).max() < 1e-4)
    True
    """
    n = round(period)
    if float(start).is_integer() and float(period).is_integer():
        first = int(start)
        return samples[first : first + n_periods * n].reshape(n_periods, n, -1)
    times = start + period * (np.arange(n_periods)[:, None] + np.arange(n) / n)
    result = np.empty((n_periods, n, samples.shape[1]))
    offsets = np.arange(1 - HALF_TAPS, HALF_TAPS + 1)
    for row, when in enumerate(times):
        whole = np.floor(when).astype(int)
        away = (when - whole)[:, None] - offsets
        shape = np.i0(10.0 * np.sqrt(np.maximum(0.0, 1 - (away / HALF_TAPS) ** 2))) / np.i0(10.0)
        around = np.clip(whole[:, None] + offsets, 0, len(samples) - 1)
        result[row] = np.einsum("ij,ijc->ic", np.sinc(away) * shape, samples[around])
    return result


def _transient(forces: Complex, responses: Complex) -> int:
    """Number of periods at the beginning of (n_periods, n_lines, n_responses) that differ more than later ones do."""
    bands = np.arange(0, responses.shape[1], GROUP)
    power = np.add.reduceat(np.sum(np.abs(forces) ** 2, axis=(0, 2)), bands)
    changes = np.add.reduceat(np.abs(np.diff(responses, axis=0)) ** 2, bands, axis=1)[:, power > DRIVEN * power.max()]
    out = 0
    while len(changes) - out >= 3:
        now, later = changes[out], changes[out + 1 :]
        if not np.any((now > TRANSIENT * np.median(later, axis=0)) & (now > 2 * later[0])):
            break
        out += 1
    return out
