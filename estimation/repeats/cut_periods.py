"""Spectra of the steady periods of a recording, without leakage."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from acquisition import Channel
from millfrf.core import Complex, Index, InputError, Real

from ..band_recordings.band_recording import BandRecording
from ..settings import PERIODS
from .period_search import RepeatedForce, find_repeats

# neighbours on either side from which a value between samples is interpolated: the error is 1e-4 of a line below 80 %
# of half the sample rate
_NEIGHBOURS = 32


@dataclass(frozen=True)
class Realisation:
    """Spectra of the steady periods of one realisation of the forces.

    They are scaled so that white noise of variance v has variance v on each line.
    """

    name: str  # of the recording, with the number of the realisation where it holds several
    forces: Complex  # (n_periods, n_lines, n_excitations)
    responses: Complex  # (n_periods, n_lines, n_responses)
    left_out: int  # periods left out before the steady ones, because of the transient

    @property
    def n_periods(self) -> int:
        """Return the number of steady periods."""
        return len(self.forces)


@dataclass(frozen=True)
class SteadyPeriods:
    """Spectra of periods, realisation by realisation, on the lines k / T."""

    frequencies: Real  # (n_lines,), Hz; lines k / T from k = 1 up to the end of the usable band
    rate: float  # Hz, sample rate
    period: float  # s, T
    realisations: tuple[Realisation, ...]
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]

    @property
    def numbers(self) -> Index:
        """Return the number k of each line, (n_lines,)."""
        return np.rint(self.frequencies * self.period).astype(np.int64)

    @property
    def level(self) -> float:
        """Return the root mean square of the forces on the lines, of all directions and realisations together, N."""
        means = np.array([np.sum(np.abs(each.forces.mean(axis=0)) ** 2) for each in self.realisations])
        return float(np.sqrt(2 * means.mean() / round(self.period * self.rate)))

    def within(self, band: tuple[float, float]) -> "SteadyPeriods":
        """Select the lines in ``band`` (Hz)."""
        inside = (self.frequencies >= band[0]) & (self.frequencies <= band[1])
        if not inside.any():
            raise InputError(f"no line of 1/{self.period:.4g} s between {band[0]:g} and {band[1]:g} Hz; widen the band")
        selected = tuple(
            replace(each, forces=each.forces[:, inside], responses=each.responses[:, inside])
            for each in self.realisations
        )
        return replace(self, frequencies=self.frequencies[inside], realisations=selected)


def steady_periods(recordings: Sequence[BandRecording], repeated: RepeatedForce | None = None) -> SteadyPeriods:
    """Cut the steady periods out of recordings whose forces repeat after the same time.

    Period i of a realisation is left out while ``|X_i+1 - X_i|^2`` in any excited band of 16 lines is above four times
    the median of the later changes and twice the next change: a transient falls from period to period, noise and drift
    do not. The last two changes are never left out, so that a recording of two or three periods counts as steady.

    Parameters
    ----------
    recordings
        Recordings of the same channels, sample rate and level.
    repeated
        Period and stretches of a single recording; None: they are searched.

    Raises
    ------
    InputError
        No recording, forces that do not repeat, or recordings with different periods.
    """
    if not recordings:
        raise InputError("no recording; give at least one")
    first = recordings[0]
    realisations: list[Realisation] = []
    period = 0.0
    for recording in recordings:
        repeats = repeated or find_repeats(recording.force)
        if repeats is None:
            raise InputError(
                f"{recording.name}: the forces do not repeat (correlation below {PERIODS.alike:g} at every lag); "
                "use noise_in_silence or noise_bound"
            )
        own_period = repeats.period / recording.rate
        if period and abs(own_period - period) > 1e-6 * period:
            raise InputError(
                f"{recording.name}: the forces repeat after {own_period:.6g} s, those of the recording before after "
                f"{period:.6g} s; process them separately"
            )
        period = own_period
        realisations += _realisations(recording, repeats)
    n = round(period * first.rate)
    numbers = np.arange(1, int(first.usable_band * period) + 1)
    if len(numbers) > n // 2:
        raise InputError(f"a period of {n} samples is too short; record longer periods")
    return SteadyPeriods(
        numbers / period,
        first.rate,
        period,
        tuple(
            replace(each, forces=each.forces[:, numbers], responses=each.responses[:, numbers]) for each in realisations
        ),
        first.excitations,
        first.responses,
    )


def same_forces(first: Realisation, second: Realisation) -> bool:
    """Return whether two realisations have the same forces, at any level and with any beginning of the period."""
    a, b = first.forces.mean(axis=0), second.forces.mean(axis=0)
    cross = np.sum(a * b.conj(), axis=1)
    # the largest circular correlation over all lags, so that the instant of the beginning does not matter
    correlation = np.abs(np.fft.irfft(np.concatenate([[0.0], cross, np.zeros(len(cross))]))).max() * 2 * len(cross)
    return bool(correlation > PERIODS.same_force * np.linalg.norm(a) * np.linalg.norm(b))


def _realisations(recording: BandRecording, repeats: RepeatedForce) -> list[Realisation]:
    joint = np.concatenate([recording.force, recording.response], axis=1)
    m = recording.force.shape[1]
    realisations = []
    for number, stretch in enumerate(repeats.stretches):
        start, n_periods = float(stretch.start), stretch.n_periods
        if not repeats.period.is_integer():  # interpolation needs neighbours at both ends
            start = max(start, _NEIGHBOURS)
            end = min(len(joint) - _NEIGHBOURS, stretch.start + n_periods * repeats.period)
            n_periods = int((end - start) // repeats.period)
        if n_periods < 2:
            continue
        periods = interpolated_periods(joint, start, repeats.period, n_periods)
        spectra = scipy.fft.rfft(periods - periods.mean(axis=(0, 1)), axis=1) / np.sqrt(periods.shape[1])
        n_transient = _transient_periods(spectra[:, 1:, :m], spectra[:, 1:, m:])
        steady = spectra[n_transient:]
        name = recording.name if len(repeats.stretches) == 1 else f"{recording.name}, realisation {number + 1}"
        realisations.append(Realisation(name, steady[:, :, :m], steady[:, :, m:], n_transient))
    if not realisations:
        raise InputError(f"{recording.name}: no two whole periods of {repeats.period:.6g} samples; record more periods")
    return realisations


def interpolated_periods(samples: Real, start: float, period: float, n_periods: int) -> Real:
    """Cut periods (n_periods, round(period), n) out of samples (n_samples, n), from sample ``start`` on.

    Values between samples are interpolated by a sinc under a Kaiser window.

    Examples
    --------
    >>> time = np.arange(1000.0)
    >>> periods = interpolated_periods(np.cos(2 * np.pi * 3 * time / 100.3)[:, None], 40.0, 100.3, 8)
    >>> bool(np.abs(periods - periods[0]).max() < 1e-4)
    True
    """
    n = round(period)
    if float(start).is_integer() and float(period).is_integer():
        first = int(start)
        return samples[first : first + n_periods * n].reshape(n_periods, n, -1)
    times = start + period * (np.arange(n_periods)[:, None] + np.arange(n) / n)
    result = np.empty((n_periods, n, samples.shape[1]))
    offsets = np.arange(1 - _NEIGHBOURS, _NEIGHBOURS + 1)
    for row, instants in enumerate(times):
        before = np.floor(instants).astype(int)
        distance = (instants - before)[:, None] - offsets
        window = np.i0(10.0 * np.sqrt(np.maximum(0.0, 1 - (distance / _NEIGHBOURS) ** 2))) / np.i0(10.0)
        neighbours = np.clip(before[:, None] + offsets, 0, len(samples) - 1)
        result[row] = np.einsum("ij,ijc->ic", np.sinc(distance) * window, samples[neighbours])
    return result


def _transient_periods(forces: Complex, responses: Complex) -> int:
    """Count the first periods of (n_periods, n_lines, n) in which a transient decays."""
    # power is added up over few lines: a transient rings in few of them, and would be hidden in the sum of all
    bands = np.arange(0, responses.shape[1], PERIODS.band_lines)
    power = np.add.reduceat(np.sum(np.abs(forces) ** 2, axis=(0, 2)), bands)
    driven = power > PERIODS.driven * power.max()
    changes = np.add.reduceat(np.abs(np.diff(responses, axis=0)) ** 2, bands, axis=1)[:, driven]
    n_transient = 0
    while len(changes) - n_transient >= 3:
        change, later = changes[n_transient], changes[n_transient + 1 :]
        if not np.any((change > PERIODS.transient * np.median(later, axis=0)) & (change > 2 * later[0])):
            break
        n_transient += 1
    return n_transient
