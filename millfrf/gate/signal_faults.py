"""Faults of signals: copied channels, clipping, repeated rows, mains hum."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Stream
from estimation import rounding_step
from millfrf.core import Real

from .settings import GATE


@dataclass
class Copies:
    """Pairs of channels that are equal or proportional in all samples so far, as pairs of column numbers."""

    names: tuple[str, ...]
    same: set[tuple[int, int]] | None = None  # equal or opposite; None before the first block
    proportional: set[tuple[int, int]] = field(default_factory=set)

    def add(self, rows: NDArray[np.float64]) -> None:
        """Add the next rows of samples, all finite, with one column per channel."""
        if len(rows) < 2:
            return
        centred = rows - rows.mean(axis=0)
        size = np.sqrt(np.sum(centred**2, axis=0))
        safe = np.where(size > 0, size, 1.0)
        near = 1 - np.abs((centred / safe).T @ (centred / safe)) < GATE.copied
        moving = size > 0
        pairs = {
            (int(a), int(b)) for a, b in np.argwhere(np.triu(near & moving[:, None] & moving[None, :], 1)).tolist()
        }
        equal = {(a, b) for a, b in pairs if (rows[:, a] == rows[:, b]).all() or (rows[:, a] == -rows[:, b]).all()}
        if self.same is None:
            self.same, self.proportional = equal, pairs
        else:
            self.same &= equal
            self.proportional &= pairs

    def equal_pairs(self) -> list[tuple[str, str]]:
        """Return the names of channels with equal samples, or equal but for the sign."""
        return [(self.names[a], self.names[b]) for a, b in sorted(self.same or set())]

    def proportional_pairs(self) -> list[tuple[str, str]]:
        """Return the names of channels that are proportional but not equal."""
        return [(self.names[a], self.names[b]) for a, b in sorted(self.proportional - (self.same or set()))]


@dataclass
class Extreme:
    """Numbers of samples at the largest value of a channel and at the next lower value, counted block by block."""

    value: float = -np.inf
    following: float = -np.inf
    count: int = 0  # samples at `value`
    n_following: int = 0
    visits: int = 0  # runs of samples at `value`
    longest: int = 0  # samples of the longest run

    def add(self, samples: Real) -> None:
        """Add the next samples: at least one, all finite."""
        high = np.sort(samples[samples >= self.following])[::-1]
        if not len(high):
            return
        if high[0] > self.value:
            self._raise_to(float(high[0]), high)
        self.count += int(np.sum(high == self.value))
        lower = high[high < self.value]
        if len(lower) and lower[0] > self.following:
            self.following, self.n_following = float(lower[0]), 0
        self.n_following += int(np.sum(lower == self.following))
        lengths = run_lengths(samples == self.value)
        self.visits += len(lengths)
        self.longest = max(self.longest, int(lengths.max(initial=0)))

    def _raise_to(self, value: float, high: Real) -> None:
        """Replace the largest value; the old value becomes the next lower value if no sample lies between."""
        between = high[high < value]
        if not len(between) or between[0] <= self.value:
            self.following, self.n_following = self.value, self.count
        self.value, self.count, self.visits, self.longest = value, 0, 0, 0

    def piled(self, peak: float) -> bool:
        """Return whether many samples have the extreme value, as at a limit; ``peak`` is the channel's peak."""
        if self.visits < GATE.clip_visits or self.count < GATE.clip_samples or self.longest < 2:
            return False
        return self.count > GATE.clip_ratio * max(self.n_following, 1) and abs(self.value) > GATE.clip_zero * peak


def run_lengths(flags: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the lengths of all runs of True, in order of their position.

    Examples
    --------
    >>> run_lengths(np.array([True, True, False, True])).tolist()
    [2, 1]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return np.asarray(edges[1::2] - edges[::2], dtype=np.int64)


def _no_hashes() -> NDArray[np.uint64]:
    return np.empty(0, dtype=np.uint64)


@dataclass
class RepeatedRows:
    """Counts of rows that repeat earlier rows, updated block by block; the previous block is kept for comparison."""

    n_rows: int = 0
    n_held: int = 0  # rows in long runs of equal rows
    n_repeated: int = 0  # rows in long runs that equal earlier rows, at most one block before, at one distance
    _before: NDArray[np.uint64] = field(default_factory=_no_hashes)

    def add(self, rows: NDArray[np.float64]) -> None:
        """Add the next rows of samples, with one column per channel."""
        if rows.shape[1] == 0 or not len(rows):
            return
        hashes = np.concatenate([self._before, _row_hashes(rows)])
        fresh = len(self._before)
        same = np.concatenate([[False], hashes[1:] == hashes[:-1]])
        held = _in_long_runs(same, GATE.held_rows - 1)
        held[fresh:] &= ~_ends_by_a_step(held[fresh:], rows)
        lag = np.where(same, 0, _distances(hashes))
        steady = np.concatenate([[False], (lag[1:] == lag[:-1]) & (lag[1:] > 0)])
        again = _in_long_runs(steady, GATE.repeated_rows - 1)
        self.n_rows += len(rows)
        self.n_held += int(held[fresh:].sum())
        self.n_repeated += int(again[fresh:].sum())
        self._before = hashes[fresh:]

    def warnings(self, sample_rate: float) -> list[str]:
        """List the faults, one sentence each."""
        texts = []
        if 0 < self.n_held < self.n_rows:
            texts.append(
                f"all channels hold their last value for {self.n_held / sample_rate:.3g} s in sum ({self.n_held} "
                "samples): buffers were lost; leave these segments out with --exclude, or record anew"
            )
        if 0 < self.n_repeated < GATE.periodic_share * self.n_rows:
            texts.append(
                f"{self.n_repeated} samples of all channels ({self.n_repeated / sample_rate:.3g} s) repeat earlier "
                "ones: a buffer was stored twice; cut the second copy out, or record anew"
            )
        return texts


def _row_hashes(rows: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Hash each row, so that equal rows have equal hashes.

    The hash is the sum of the bits of the values times odd constants, modulo 2^64.
    """
    bits = np.ascontiguousarray(rows, dtype=np.float64).view(np.uint64)
    odd = np.random.default_rng(1).integers(1, 1 << 63, rows.shape[1], dtype=np.uint64) * np.uint64(2) + np.uint64(1)
    mixed = bits ^ (bits >> np.uint64(29))
    return np.asarray((mixed * odd).sum(axis=1, dtype=np.uint64))


def _distances(hashes: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Return the distance of each row to the last equal row before it, in rows; 0 if there is none."""
    distances = np.zeros(len(hashes), dtype=np.int64)
    ordered = np.sort(hashes)
    if (ordered[1:] != ordered[:-1]).all():
        return distances
    order = np.argsort(hashes, kind="stable")
    twice = hashes[order[1:]] == hashes[order[:-1]]
    distances[order[1:][twice]] = (order[1:] - order[:-1])[twice]
    return distances


def _ends_by_a_step(held: NDArray[np.bool_], rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the held rows after which no channel changes by more than the smallest step of these rows.

    A converter at rest holds its value and then changes by one step; after lost buffers the signal goes on elsewhere.
    """
    changes = np.abs(np.diff(rows, axis=0))
    steps = np.min(np.where(changes > 0, changes, np.inf), axis=0, initial=np.inf)
    small = np.append((changes <= 1.5 * steps).all(axis=1), False)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(np.int8), [0]])))
    resting = np.zeros(len(held), dtype=bool)
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        resting[start:stop] = small[stop - 1]
    return resting


def _in_long_runs(flags: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """Return the flags; set runs of True with fewer than ``shortest`` flags to False."""
    starts = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8)])) == 1)
    long_runs = np.zeros(len(flags), dtype=bool)
    for start, length in zip(starts, run_lengths(flags), strict=True):
        if length >= shortest:
            long_runs[start : start + length] = True
    return long_runs


def is_coarse(step: float, deviation: float) -> bool:
    """Return whether rounding to steps is noise of more than a share of a channel's standard deviation."""
    return bool(step / np.sqrt(12) > GATE.rounding_max * deviation > 0)


def has_coarse_channel(stream: Stream, names: Sequence[str]) -> bool:
    """Return whether a channel is coarse in the middle of a recording."""
    length = min(stream.n_samples, GATE.block_samples)
    first = (stream.n_samples - length) // 2
    samples = stream.read(first, first + length, names)
    return any(is_coarse(rounding_step(column) or 0.0, float(column.std())) for column in samples.T)


MAINS_HUM = "mains hum"


def hum_warnings(stream: Stream, names: Sequence[str], known: Sequence[tuple[str, float]] = ()) -> list[str]:
    """Return a warning about channels with mains hum.

    The power of the line at a multiple of the mains over the mean of its neighbours has the F-distribution with 2 and
    2 n degrees of freedom in noise and in a response to a force without lines. A line in all channels, as in a cut
    whose teeth pass at this frequency, is not hum, nor is one that differs between the halves of the recording: hum is
    steady, and what a tap sets in motion decays.

    Parameters
    ----------
    stream
        Stream of an open recording.
    names
        Names of the channels.
    known
        Channels and frequencies (Hz) of hum that is not to be named.
    """
    length = min(stream.n_samples, GATE.hum_samples)
    first = (stream.n_samples - length) // 2
    samples = stream.read(first, first + length, names)
    if length < 8 * GATE.hum_neighbours or not np.isfinite(samples).all():
        return []
    samples = samples - samples.mean(axis=0)
    spectrum = _spectrum(samples)
    halves: list[Real] = []
    result: dict[str, float] = {}
    for mains in GATE.hum:
        for multiple in range(1, GATE.hum_harmonics + 1):
            lines = _line(spectrum, mains * multiple, stream.sample_rate / length)
            if lines is None or lines.all() or not lines.any():
                continue
            halves = halves or [_spectrum(part) for part in (samples[: length // 2], samples[length // 2 :])]
            steady = _steady(halves, mains * multiple, stream.sample_rate / (length // 2))
            for name, hit in zip(names, lines & steady, strict=True):
                same = any(other == name and abs(f - mains * multiple) < 1 for other, f in known)
                if hit and not same:
                    result.setdefault(name, mains * multiple)
    if not result:
        return []
    listed = ", ".join(f"{name} at {line:g} Hz" for name, line in result.items())
    return [
        f"{MAINS_HUM} in {listed}: a line that stands alone there; a fit may take it for a mode, and a tap for "
        "ringing: check shields and grounds, or keep the band away from it"
    ]


def _spectrum(samples: Real) -> Real:
    """Return the power of each line under a Hann window, (n_lines, n_channels)."""
    window = scipy.signal.windows.hann(len(samples), sym=False)[:, None]
    return np.asarray(np.abs(np.fft.rfft(window * samples, axis=0)) ** 2)


def _steady(halves: Sequence[Real], frequency: float, spacing: float) -> NDArray[np.bool_]:
    """Return which channels have a line at a frequency with about one amplitude in both halves of the recording."""
    reach = max(1, round(GATE.hum_tolerance * frequency / spacing))
    centre = round(frequency / spacing)
    first, second = (half[centre - reach : centre + reach + 1].max(axis=0) for half in halves)
    return np.asarray(np.maximum(first, second) <= GATE.hum_steady**2 * np.minimum(first, second))


def _line(spectrum: Real, frequency: float, spacing: float) -> NDArray[np.bool_] | None:
    """Return which channels have a line at a frequency that stands alone; None where its neighbours are not known."""
    reach = max(1, round(GATE.hum_tolerance * frequency / spacing))
    centre, n = round(frequency / spacing), GATE.hum_neighbours
    low, high = centre - reach - 3 - n // 2, centre + reach + 3 + n // 2 + 1
    if low < 1 or high > len(spectrum):
        return None
    inside = spectrum[centre - reach : centre + reach + 1].max(axis=0)
    beside = np.concatenate([spectrum[low : low + n // 2], spectrum[high - n // 2 : high]]).mean(axis=0)
    candidates = (2 * reach + 1) * len(GATE.hum) * GATE.hum_harmonics * spectrum.shape[1]
    # neighbours under a Hann window are correlated: half of them count
    tail = scipy.stats.f.sf(inside / np.maximum(beside, 1e-300), 2, n)
    share = spectrum[centre - reach - 2 : centre + reach + 3].sum(axis=0) / np.maximum(spectrum.sum(axis=0), 1e-300)
    return np.asarray((tail * candidates < GATE.p_value) & (share > GATE.hum_share**2))
