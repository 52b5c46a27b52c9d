"""Checks of time: sample rates against clocks, and against each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import ClockFindings, Recording, check_clock
from estimation import CrossSpectra
from millfrf.core import InputError, Real


def clock_concerns(recording: Recording, stream: str) -> list[str]:
    """Doubts about the rate and the gaps of a stream, one sentence each; empty where the pairs say nothing.

    Parameters
    ----------
    recording
        Recording, open for reading, whose pairs are looked at.
    stream
        Name of the stream.
    """
    found = _findings(recording, stream)
    return [*([_wrong_rate(found, stream)] if found.rate_is_wrong else []), *_gaps(found, stream)]


def check_clock_of(recording: Recording, stream: str) -> list[str]:
    """Refuse a stream whose sample rate is wrong; returns doubts about gaps.

    Parameters
    ----------
    recording
        Recording, open for reading, whose pairs are looked at.
    stream
        Name of the stream.

    Raises
    ------
    InputError
        The true rate is another one than the file says.
    """
    found = _findings(recording, stream)
    if found.rate_is_wrong:
        raise InputError(f"{recording.path.name}: {_wrong_rate(found, stream)}")
    return _gaps(found, stream)


def missing_concerns(recording: Recording, stream: str) -> list[str]:
    """Doubts about rows that a recovery could not give back, one sentence in all.

    Parameters
    ----------
    recording
        Recording, open for reading, whose pairs are looked at.
    stream
        Name of the stream.
    """
    gone = recording.missing(stream)
    if not gone:
        return []
    count = sum(one.end - one.first for one in gone)
    first = gone[0]
    return [
        f"{count} samples of stream {stream} are missing in {len(gone)} places, the first at samples {first.first} to "
        f"{first.end - 1} ({first.reason}): leave them out with 'estimate --exclude', or record again"
    ]


def _findings(recording: Recording, stream: str) -> ClockFindings:
    return check_clock(recording.clock_pairs(stream), recording.stream(stream).sample_rate)


def _wrong_rate(found: ClockFindings, stream: str) -> str:
    percent = 100 * (found.true_rate / found.stated_rate - 1)
    return (
        f"stream {stream} has a sample rate of {found.true_rate:.4g} Hz by the computer that recorded it, "
        f"and the file says {found.stated_rate:.6g} Hz ({percent:+.2g} %): every frequency would be off as much; "
        "check the device's clock, and record again"
    )


def _gaps(found: ClockFindings, stream: str) -> list[str]:
    if not found.gaps:
        return []
    first = found.gaps[0]
    more = f", and {len(found.gaps) - 1} more" if len(found.gaps) > 1 else ""
    return [
        f"stream {stream}: {first.seconds:.2g} s are missing after {first.after_sample / found.stated_rate:.4g} s by "
        f"the computer that recorded it{more}: samples were lost there, or the computer was asleep; record again, or "
        "cut out what lies on one side of the gap with 'millfrf convert --span'"
    ]


STEP = 0.01
"""Resolution of the logarithmic frequency axis; a resonance of 1 % damping is two steps wide."""

DRIVEN = 1e-3
"""Share of the forces' largest power from which a line has a gain."""

AGREES = 0.5
"""Spread of two gains' difference over their own, up to which they are of one shape; one set-up gives 0.07 to 0.4."""

DIFFERS = 0.75
"""Spread from which they are not; a rate that is wrong by a factor of 2 gives 0.87 and more."""

FACTORS = (1.2, 12.0)
"""Smallest and largest factor by which a rate may be wrong."""

SAME_FORCES = 0.1
"""Likeness (cosine) of the channels' shares in the force power from which two tests are compared: taps along
different axes (0.0) show different modes, cuts of different immersions (0.18 and more) do not."""

LEAST = 20
"""Steps that both gains must share."""


@dataclass(frozen=True)
class Gain:
    """Root of response over force power of one test, over the logarithm of frequency.

    Parameters
    ----------
    name
        Name of the recording.
    rate : Hz
        Sample rate that the recording states.
    first
        Number of the first step; the frequency of step k is ``exp(STEP k)`` Hz.
    values : (n_steps,)
        Natural logarithm of the gain; NaN where the forces have no power.
    shares : (n_excitations,)
        Share of each channel in the force power.
    """

    name: str
    rate: float
    first: int
    values: Real
    shares: Real


def gain_of(spectra: CrossSpectra, name: str, rate: float) -> Gain:
    """The gain of one test's spectra."""
    force = np.real(np.einsum("kii->k", spectra.input_spectra))
    response = np.real(np.einsum("kii->k", spectra.output_spectra))
    inside = spectra.frequencies > 0
    steps = np.round(np.log(spectra.frequencies[inside]) / STEP).astype(int)
    first = int(steps.min())
    lines, powers, moved = (
        np.bincount(steps - first, weight) for weight in (np.ones(len(steps)), force[inside], response[inside])
    )
    mean = powers / np.maximum(lines, 1)
    known = (lines > 0) & (mean > DRIVEN * mean.max()) & (moved > 0)
    values = np.full(len(lines), np.nan)
    values[known] = 0.5 * np.log(moved[known] / powers[known])
    each = np.real(np.einsum("kii->i", spectra.input_spectra[inside]))
    return Gain(name, rate, first, values, each / each.sum() if each.any() else each)


def check_sample_rates(gains: Sequence[Gain]) -> list[str]:
    """Compare each recording's gain with the first one's, as it is and moved by a factor.

    Parameters
    ----------
    gains
        Gains of the recordings of one set-up.

    Returns
    -------
    list of str
        Doubts: recordings of one stated rate that agree only when one of them is moved.

    Raises
    ------
    InputError
        Stated rates that differ, and no agreement of the spectra that would show both to be right.
    """
    doubts = []
    for other in gains[1:]:
        one = gains[0]
        spread, moved = _spread(one, other, 0), _best_factor(one, other)
        wrong = moved is not None and moved[1] < AGREES and not spread < DIFFERS
        if one.rate != other.rate and not spread < AGREES:
            ratio = one.rate / other.rate
            if _spread(one, other, round(np.log(ratio) / STEP)) < AGREES:
                moved, wrong = (ratio, 0.0), True
            raise InputError(_differing(one, other, moved[0] if wrong and moved else None))
        if wrong and moved is not None:
            doubts.append(
                f"{other.name}: its spectra agree with those of {one.name} only when its frequencies are multiplied by "
                f"{moved[0]:.3g}; check the sample rate of both files ({other.rate:g} and {one.rate:g} Hz)"
            )
    return doubts


def _differing(one: Gain, other: Gain, factor: float | None) -> str:
    rates = f"{other.name} states {other.rate:g} Hz, {one.name} {one.rate:g} Hz"
    if factor is None:
        return f"{rates}, and their spectra do not show that both are right; record or resample at one rate"
    return (
        f"{rates}, and their spectra agree only when the frequencies of {other.name} are multiplied by {factor:.3g}: "
        "one of the rates is wrong; correct it"
    )


def _best_factor(one: Gain, other: Gain) -> tuple[float, float] | None:
    """Factor on the other's frequencies at which both agree best, and their spread there; None: nothing to compare."""
    least, most = (round(np.log(factor) / STEP) for factor in FACTORS)
    shifts = [sign * shift for shift in range(least, most + 1) for sign in (-1, 1)]
    shared = {shift: _shared(one, other, shift) for shift in (0, *shifts)}
    enough = max(LEAST, 0.5 * max(len(pair[0]) for pair in shared.values()))
    found = [(_spread(one, other, shift), shift) for shift in shifts if len(shared[shift][0]) >= enough]
    found = [pair for pair in found if np.isfinite(pair[0])]
    if not found:
        return None
    spread, shift = min(found)
    return float(np.exp(STEP * shift)), spread


def _shared(one: Gain, other: Gain, shift: int) -> tuple[Real, Real]:
    """Values of both where both are known, the other's moved up by ``shift`` steps."""
    if not _excited_alike(one, other):
        return np.empty(0), np.empty(0)
    start = other.first + shift
    low = max(one.first, start)
    high = min(one.first + len(one.values), start + len(other.values))
    if high <= low:
        return np.empty(0), np.empty(0)
    mine, theirs = one.values[low - one.first : high - one.first], other.values[low - start : high - start]
    both = np.isfinite(mine) & np.isfinite(theirs)
    return mine[both], theirs[both]


def _excited_alike(one: Gain, other: Gain) -> bool:
    size = float(np.linalg.norm(one.shares) * np.linalg.norm(other.shares))
    return size > 0 and float(one.shares @ other.shares) >= SAME_FORCES * size


def _spread(one: Gain, other: Gain, shift: int) -> float:
    """Deviation of the difference over the root mean square deviation of both; NaN where too little is shared."""
    mine, theirs = _shared(one, other, shift)
    own = float(np.sqrt((mine.var() + theirs.var()) / 2)) if len(mine) >= LEAST else 0.0
    return float((mine - theirs).std()) / own if own > 0 else float("nan")
