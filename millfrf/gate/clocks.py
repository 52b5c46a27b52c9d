"""Checks of time: sample rates against clocks, and against each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import ClockFindings, Recording, check_clock
from estimation import CrossSpectra
from millfrf.core import InputError, Real

from .settings import GATE


def clock_warnings(recording: Recording, stream: str) -> list[str]:
    """Return warnings about the sample rate and the gaps of a stream; none if the stream has no stored clock pairs.

    Parameters
    ----------
    recording
        Recording, open for reading, whose clock pairs are compared with its sample rate.
    stream
        Name of the stream.
    """
    clock = _compare_clock(recording, stream)
    return [*([_wrong_rate(clock, stream)] if clock.rate_is_wrong else []), *_gaps(clock, stream)]


def check_clock_of(recording: Recording, stream: str) -> list[str]:
    """Refuse a stream whose sample rate is wrong, and return warnings about its gaps."""
    clock = _compare_clock(recording, stream)
    if clock.rate_is_wrong:
        raise InputError(f"{recording.path.name}: {_wrong_rate(clock, stream)}")
    return _gaps(clock, stream)


def missing_sample_warnings(recording: Recording, stream: str) -> list[str]:
    """Return a warning about rows that a recovery could not restore; an empty list if there are no such rows.

    Parameters
    ----------
    recording
        Recording, open for reading, whose missing rows are listed.
    stream
        Name of the stream.
    """
    gaps = recording.missing(stream)
    if not gaps:
        return []
    count = sum(gap.end - gap.first for gap in gaps)
    first = gaps[0]
    return [
        f"{count} samples of stream {stream} are missing in {len(gaps)} places, the first at samples {first.first} to "
        f"{first.end - 1} ({first.reason}): leave them out with 'estimate --exclude', or record again"
    ]


def _compare_clock(recording: Recording, stream: str) -> ClockFindings:
    return check_clock(recording.clock_pairs(stream), recording.stream(stream).sample_rate)


def _wrong_rate(clock: ClockFindings, stream: str) -> str:
    percent = 100 * (clock.true_rate / clock.stated_rate - 1)
    return (
        f"stream {stream} has a sample rate of {clock.true_rate:.4g} Hz by the computer that recorded it, "
        f"and the file says {clock.stated_rate:.6g} Hz ({percent:+.2g} %): every frequency would have this error; "
        "check the device's clock, and record again"
    )


def _gaps(clock: ClockFindings, stream: str) -> list[str]:
    if not clock.gaps:
        return []
    first = clock.gaps[0]
    more = f", and {len(clock.gaps) - 1} more" if len(clock.gaps) > 1 else ""
    return [
        f"stream {stream}: {first.seconds:.2g} s are missing after {first.after_sample / clock.stated_rate:.4g} s by "
        f"the computer that recorded it{more}: samples were lost there, or the computer was asleep; record again, or "
        "cut out what lies on one side of the gap with 'millfrf convert --span'"
    ]


@dataclass(frozen=True)
class Gain:
    """Root of the response power over the force power of one test, on a logarithmic frequency axis.

    Parameters
    ----------
    name
        Name of the recording.
    rate : Hz
        Sample rate that the recording states.
    first
        Number of the first step; the frequency of step k is ``exp(k GATE.log_step)`` Hz.
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
    """Compute the gain of one test from its cross spectra.

    The gain is averaged over logarithmic frequency steps, so that a wrong sample rate only shifts the curve.
    """
    force = np.real(np.einsum("kii->k", spectra.input_spectra))
    response = np.real(np.einsum("kii->k", spectra.output_spectra))
    positive = spectra.frequencies > 0
    steps = np.round(np.log(spectra.frequencies[positive]) / GATE.log_step).astype(int)
    first = int(steps.min())
    n_lines, force_power, response_power = (
        np.bincount(steps - first, weight) for weight in (np.ones(len(steps)), force[positive], response[positive])
    )
    mean = force_power / np.maximum(n_lines, 1)
    known = (n_lines > 0) & (mean > GATE.gain_driven * mean.max()) & (response_power > 0)
    values = np.full(len(n_lines), np.nan)
    values[known] = 0.5 * np.log(response_power[known] / force_power[known])
    channel_power = np.real(np.einsum("kii->i", spectra.input_spectra[positive]))
    shares = channel_power / channel_power.sum() if channel_power.any() else channel_power
    return Gain(name, rate, first, values, shares)


def check_sample_rates(gains: Sequence[Gain]) -> list[str]:
    """Compare the gain of each recording with the first gain, with unchanged and with scaled frequencies.

    Parameters
    ----------
    gains
        Gains of the recordings of one set-up.

    Returns
    -------
    list of str
        Warnings: recordings of one stated rate that agree only when the frequencies of one are scaled.

    Raises
    ------
    InputError
        The stated rates differ, and the spectra do not agree as they would if both rates were right.
    """
    warnings = []
    for other in gains[1:]:
        reference = gains[0]
        spread, best = _spread(reference, other, 0), _best_factor(reference, other)
        # `not spread < ...` also covers a spread of NaN: too few common steps are no proof of agreement
        wrong = best is not None and best[1] < GATE.gain_same and not spread < GATE.gain_different
        if reference.rate != other.rate and not spread < GATE.gain_same:
            ratio = reference.rate / other.rate
            if _spread(reference, other, round(np.log(ratio) / GATE.log_step)) < GATE.gain_same:
                best, wrong = (ratio, 0.0), True
            raise InputError(_differing(reference, other, best[0] if wrong and best else None))
        if wrong and best is not None:
            warnings.append(
                f"{other.name}: its spectra agree with those of {reference.name} only when its frequencies are "
                f"multiplied by {best[0]:.3g}; check the sample rate of both files ({other.rate:g} and "
                f"{reference.rate:g} Hz)"
            )
    return warnings


def _differing(reference: Gain, other: Gain, factor: float | None) -> str:
    rates = f"{other.name} states {other.rate:g} Hz, {reference.name} {reference.rate:g} Hz"
    if factor is None:
        return f"{rates}, and their spectra do not show that both are right; record or resample at one rate"
    return (
        f"{rates}, and their spectra agree only when the frequencies of {other.name} are multiplied by {factor:.3g}: "
        "one of the rates is wrong; correct it"
    )


def _best_factor(reference: Gain, other: Gain) -> tuple[float, float] | None:
    """Find the factor on the frequencies of ``other`` with the smallest spread.

    Return the factor and the spread; None if the gains have too few common steps for every factor.
    """
    smallest, largest = (round(np.log(f) / GATE.log_step) for f in (GATE.rate_factor_min, GATE.rate_factor_max))
    shifts = [sign * shift for shift in range(smallest, largest + 1) for sign in (-1, 1)]
    n_shared = {shift: len(_shared(reference, other, shift)[0]) for shift in (0, *shifts)}
    # gains agree by chance if their overlap is small: at least half of the largest overlap is needed
    enough = max(GATE.gain_steps_min, 0.5 * max(n_shared.values()))
    candidates = [(_spread(reference, other, shift), shift) for shift in shifts if n_shared[shift] >= enough]
    candidates = [candidate for candidate in candidates if np.isfinite(candidate[0])]
    if not candidates:
        return None
    spread, shift = min(candidates)
    return float(np.exp(GATE.log_step * shift)), spread


def _shared(reference: Gain, other: Gain, shift: int) -> tuple[Real, Real]:
    """Return the values of both gains at their common known steps, after a shift of ``other`` by ``shift`` steps."""
    start = other.first + shift
    low = max(reference.first, start)
    high = min(reference.first + len(reference.values), start + len(other.values))
    if high <= low or not _same_force_directions(reference, other):
        return np.empty(0), np.empty(0)
    first = reference.values[low - reference.first : high - reference.first]
    second = other.values[low - start : high - start]
    known = np.isfinite(first) & np.isfinite(second)
    return first[known], second[known]


def _same_force_directions(reference: Gain, other: Gain) -> bool:
    size = float(np.linalg.norm(reference.shares) * np.linalg.norm(other.shares))
    return size > 0 and float(reference.shares @ other.shares) >= GATE.force_direction_cosine * size


def _spread(reference: Gain, other: Gain, shift: int) -> float:
    """Return the spread of two gains: standard deviation of their difference over the rms of their deviations.

    The spread is NaN if the gains have too few common steps.
    """
    first, second = _shared(reference, other, shift)
    own = float(np.sqrt((first.var() + second.var()) / 2)) if len(first) >= GATE.gain_steps_min else 0.0
    return float((first - second).std()) / own if own > 0 else float("nan")
