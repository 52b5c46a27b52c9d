"""Forces of a cut against what the recording states of it: tooth passing, mean force, coupling of the channels."""

import tomllib
from collections.abc import Sequence
from itertools import permutations, product

import numpy as np
import scipy

from estimation import widest_band
from millfrf.core import InputError, Real
from millfrf.cutting import force_harmonics, process_from_table

from .cutting_data import stated_cut
from .record_blocks import RecordBlocks
from .settings import GATE


def check_cuts(tests: Sequence[RecordBlocks]) -> list[str]:
    """Return warnings about forces that contradict the cut which their recording states, or that have lost their mean.

    Parameters
    ----------
    tests
        Blocks of recordings of one set-up.
    """
    coupled = _coupling(tests)
    return [*coupled, *_tooth_passing(tests), *([] if coupled else _mean_direction(tests))]


def _significant_mean(values: Real) -> bool:
    """Return whether the mean of the blocks differs from zero, by a t-test."""
    error = float(values.std(ddof=1)) / np.sqrt(len(values))
    return bool(error > 0 and 2 * scipy.stats.t.sf(abs(values.mean()) / error, len(values) - 1) < GATE.p_value)


def _coupling(tests: Sequence[RecordBlocks]) -> list[str]:
    """Return a warning about forces without a mean though they act to one side, as only a high-pass makes them."""
    wrong = []
    for test in tests:
        if len(test.means) < 4 or any(channel.high_pass_hz for channel in test.excitations):
            continue
        skewed = np.array([np.mean(force**3, axis=0) for force in test.force])
        one_sided = [q for q in range(len(test.excitations)) if _significant_mean(skewed[:, q])]
        if len(one_sided) > 1 and not any(_significant_mean(test.means[:, q]) for q in one_sided):
            wrong.append(test.name)
    if not wrong:
        return []
    return [
        f"{', '.join(wrong)}: the forces push to one side in pulses and have no mean: an AC coupling turns their phase "
        "above its corner, too; state high_pass_hz of the force channels, or record them coupled to DC"
    ]


def _tooth_passing(tests: Sequence[RecordBlocks]) -> list[str]:
    """Compare the tooth passing in the forces with the stated speed and number of teeth."""
    ratios, warnings, teeth, width = [], [], 1, GATE.comb_width
    for test in tests:
        passing = _stated_passing(test)
        if passing is None:
            continue
        if passing.max() > widest_band(test.rate_recorded):
            warnings.append(
                f"{test.name}: teeth pass at {passing.max():.4g} Hz, and {test.rate_recorded:g} Hz show forces up to "
                f"{widest_band(test.rate_recorded):.4g} Hz: the tooth passing is aliased; record at a higher rate"
            )
            continue
        teeth = stated_cut(test.setup).teeth or 1
        # half of what the speed changes by within a block
        shares = np.abs(np.gradient(passing, test.times)) * len(test.force[0]) / test.rate / passing / 2
        width = max(width, float(shares.max()))
        ratios += [_comb(force, test.rate, float(f), width) for force, f in zip(test.force, passing, strict=True)]
    if len(ratios) < 4 or warnings:
        return warnings
    deviation = np.log(np.array(ratios))
    middle = float(np.median(deviation))
    same = int(np.sum(np.abs(deviation - middle) < width))
    # a sign test: blocks whose comb is found by chance agree with the median in half of the cases at most
    if (
        abs(middle) < np.log(1 + GATE.speed_tolerance)
        or scipy.stats.binom.sf(same - 1, len(ratios), 0.5) > GATE.p_value
    ):
        return warnings
    turns = teeth * np.exp(middle)
    if turns < teeth and abs(turns - round(turns)) < width * teeth:  # runout: lines at multiples of the spindle's speed
        return warnings
    return [
        f"teeth pass at {np.exp(middle):.3g} times the frequency that speed and teeth of the set-up give: check the "
        "sample rate, the speed and the number of teeth"
    ]


def _stated_passing(test: RecordBlocks) -> Real | None:
    """Return the tooth-passing frequency (Hz) in the middle of each block, as the set-up states it; None without it."""
    stated = stated_cut(test.setup)
    if stated.teeth is None:
        return None
    if stated.sweep is not None:
        share = (test.times - test.times[0]) / (test.times[-1] - test.times[0])
        margin = test.times[0] / (test.times[0] + test.times[-1])
        rpm = stated.sweep[0] + (stated.sweep[1] - stated.sweep[0]) * (margin + share * (1 - 2 * margin))
    elif stated.rpm is not None:
        rpm = np.full(len(test.times), stated.rpm)
    else:
        return None
    return np.asarray(stated.teeth * rpm / 60)


def _comb(force: Real, rate: float, passing: float, half_width: float) -> float:
    """Return by which factor the harmonics of the tooth passing in a force lie higher than stated."""
    window = np.hanning(len(force))[:, None]
    amplitude = np.sqrt(np.sum(np.abs(np.fft.rfft(window * force, axis=0)) ** 2, axis=1))
    width = max(3, round(2 * half_width * passing * len(force) / rate))
    amplitude = np.convolve(amplitude, np.ones(width) / width, mode="same")
    frequencies = np.fft.rfftfreq(len(force), 1 / rate)
    factors = np.exp(np.arange(-180, 181) * 0.005)
    orders = np.arange(1, GATE.comb_harmonics + 1)
    lines = np.interp(np.outer(factors, orders) * passing, frequencies, amplitude, right=0.0)
    between = np.interp(np.outer(factors, orders - 0.5) * passing, frequencies, amplitude, right=0.0)
    return float(factors[int(np.argmax((lines - between).sum(axis=1)))])


def _mean_direction(tests: Sequence[RecordBlocks]) -> list[str]:
    """Compare the mean forces with those of the stated cutting data: signs, axes, and units of all recordings alike."""
    pairs = [(test.means.mean(axis=0), stated) for test in tests if (stated := _stated_mean(test)) is not None]
    if not pairs:
        return []
    measured, predicted = (np.array(side) for side in zip(*pairs, strict=True))
    freedom = measured.size - 1
    if freedom < 2 or not np.abs(measured).any():
        return []
    fits = {key: _fitted(measured[:, list(key[0])] * np.array(key[1]), predicted) for key in _places()}
    identity = ((0, 1, 2), (1, 1, 1))
    best = min(fits, key=lambda key: fits[key][0])
    misfit, gain = fits[identity]
    ratio = misfit / max(fits[best][0], 1e-300)
    if best != identity and scipy.stats.f.sf(ratio, freedom, freedom) < GATE.p_value:
        names = [channel.name for channel in tests[0].excitations]
        now = ", ".join(f"{'-' if sign < 0 else ''}{names[k]}" for k, sign in zip(*best, strict=True))
        return [
            f"the mean forces are those of the stated cut only if {', '.join(names)} are taken as {now}: are they "
            "forces on the workpiece, or are axes turned? Correct node, direction or sign of the force channels"
        ]
    if gain > 0 and abs(np.log10(gain)) > GATE.unit_decades:
        return [
            f"the mean forces are {gain:.2g} times those of the stated cut: check the unit and sensitivity of the "
            "forces, and the cutting data of the set-up"
        ]
    return []


def _places() -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    return list(product(permutations(range(3)), product((1, -1), repeat=3)))


def _fitted(measured: Real, predicted: Real) -> tuple[float, float]:
    """Return the misfit of ``measured = gain predicted`` with a gain that is not negative, and the gain."""
    gain = max(float(np.sum(measured * predicted) / np.sum(predicted**2)), 0.0)
    return float(np.sum((measured - gain * predicted) ** 2)), gain


def _stated_mean(test: RecordBlocks) -> Real | None:
    """Return the mean force on the tool (N) that the set-up predicts; None where it states too little."""
    axes = [channel.direction for channel in test.excitations]
    if axes != ["+X", "+Y", "+Z"] or any(channel.quantity != "force" for channel in test.excitations):
        return None
    try:
        content = tomllib.loads(test.setup)
        process = process_from_table(content["cutting"], "the set-up")
        depth = float(content["cut"]["depth_m"])
        return np.asarray(depth * force_harmonics(process, 0)[0].real)
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError, InputError):
        return None
