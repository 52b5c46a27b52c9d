"""Checks of FRFs and of the inputs that they are estimated from."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import (
    RECORDINGS,
    BandRecording,
    CrossSpectra,
    Frf,
    bands_text,
    input_independence,
    local_half_width,
    spectra_for_judging,
    sum_tests,
)
from millfrf.core import Band, InputError, Real, listed, shared_band

from .clocks import check_sample_rates, gain_of
from .passivity import (
    POWERS,
    DrivePoint,
    check_reciprocity,
    drive_points,
    entries_with_rising_phase,
    magnitude_warnings,
    returned_power,
    rising_phase,
)
from .settings import GATE


def incoherence_warnings(frf: Frf) -> list[str]:
    """Return a warning if an FRF without covariance and averages has most of its energy on incoherent lines.

    The relative random error of a value from n averages with the coherence c is ``sqrt((1 - c) / (2 n c))`` (Bendat &
    Piersol, Random Data, 4th ed., section 9.2.4). If n or a covariance is known, fit and limits use this error; if not,
    no later step detects that the FRF is mostly noise. Only valid lines in the FRF's band are checked, weighted by the
    energy of the mobility.
    """
    coherence = _coherence(frf)
    if coherence is None or frf.entry_variance() is not None:
        return []
    low, high = frf.band or (0.0, np.inf)
    f = frf.frequencies
    in_band = frf.valid & (f > 0) & (f >= low) & (f <= high)
    weight = np.where(f > 0, f, 1.0) ** (2 * POWERS.get(frf.quantity, 0))
    energy = (np.abs(frf.values) ** 2 * weight[:, None, None])[in_band]
    known = coherence[in_band]
    energy = np.where(np.isnan(known), 0.0, energy)
    total = energy.sum(axis=(0, 2))
    coherent = (energy * (known >= GATE.coherent)).sum(axis=(0, 2))
    poor = [p for p in range(len(frf.responses)) if total[p] > 0 and coherent[p] < GATE.coherent_energy_min * total[p]]
    if not poor:
        return []
    share = 100 * (1 - coherent[poor].sum() / total[poor].sum())
    names = ", ".join(frf.responses[p] for p in poor)
    return [
        f"{names}: {share:.0f} % of the motion lies on lines whose coherence is below {GATE.coherent:g} (median "
        f"{np.nanmedian(known[:, poor]):.2g}), and the FRF gives neither a covariance nor averages: results that are "
        "computed from it have no error bars; average more, or give the averages and the coherence of each entry"
    ]


def _coherence(frf: Frf) -> Real | None:
    """Return the coherence of each entry of the FRF matrix on each line: the multiple, else the ordinary coherence."""
    if frf.multiple_coherence is not None:
        return np.broadcast_to(frf.multiple_coherence[:, :, None], frf.values.shape)
    return frf.coherence


def check_frf(frf: Frf, name: str = "the FRF", band: Band | None = None) -> list[str]:
    """Check an FRF before it is used for lobes, a fit or a calibration.

    Parameters
    ----------
    frf
        Measured, imported or evaluated from a model.
    name
        Name of its file, for the message.
    band : Hz
        Lines that are used; the size of the motion is checked there. None: the FRF's own band, or all its lines.

    Returns
    -------
    list of str
        Warnings: a coherence below a half where the errors are not known; drive points that return part of the power,
        or that are more or less flexible than machines are.

    Raises
    ------
    InputError
        Frequencies that are negative, not finite or not increasing; no valid line; a coherence outside 0 to 1; values
        that are all zero; the sign convention ``exp(-i w t)``; a drive point that moves against its own force.
    """
    _check_axis(frf, name)
    _check_values(frf, name)
    rising = rising_phase(frf)
    if rising is not None and rising > GATE.rising_phase_max:
        raise InputError(_early(frf, rising, name))
    warnings = incoherence_warnings(frf)
    if frf.quantity == "transfer":  # a ratio of two motions has no power and no unit to check
        return warnings
    return [*warnings, *_check_drive_points(frf, name), *magnitude_warnings(frf, band)]


def check_frf_for_fit(frf: Frf, band: Band, name: str = "the FRF") -> list[str]:
    """Check an FRF as :func:`check_frf` does, and check whether the fit's band (Hz) lies in the band of the FRF.

    Returns
    -------
    list of str
        Warnings of :func:`check_frf` and :func:`check_reciprocity`, and one if a tenth or more of the fit's band lies
        outside the band of the FRF.

    Raises
    ------
    InputError
        As :func:`check_frf`, or where both bands have nothing in common.
    """
    warnings = [*check_frf(frf, name, band), *check_reciprocity(frf, name, band)]
    if frf.band is None:
        return warnings
    shared = shared_band(band, frf.band)
    assert shared is not None
    missing = 1 - (shared[1] - shared[0]) / (band[1] - band[0])
    if missing >= GATE.fit_outside_max:
        warnings.append(
            f"{100 * missing:.0f} % of the fit's band, {band[0]:g} to {band[1]:g} Hz, lies outside the {frf.band[0]:g} "
            f"to {frf.band[1]:g} Hz in which {name} is driven and coherent; fit inside it"
        )
    return warnings


def _early(frf: Frf, rising: float, name: str) -> str:
    """Say what makes motions come before their forces: in all entries the sign convention, in some their channels."""
    if entries := entries_with_rising_phase(frf):
        return (
            f"{name}: the phase of {listed(entries, 3)} rises with frequency, that of other entries falls: there the "
            "motion comes before the force; exchange force and response of these entries if they are swapped, or "
            "correct their places or delays"
        )
    return (
        f"{name}: the phase rises with frequency on {100 * rising:.0f} % of the energy: the values stand for "
        "exp(-i w t), this program's for exp(+i w t); conjugate the values, or convert them with conjugate = true "
        "under [frf] of the mapping; or exchange force and response if they are swapped"
    )


def _check_axis(frf: Frf, name: str) -> None:
    f = frf.frequencies
    if not len(f) or not np.isfinite(f).all():
        raise InputError(f"{name}: frequencies are missing or not finite; give each line a frequency in Hz")
    if f[0] < 0:
        raise InputError(f"{name}: frequencies begin at {f[0]:g} Hz; give the lines from 0 Hz on")
    if (np.diff(f) <= 0).any():
        line = int(np.argmax(np.diff(f) <= 0))
        raise InputError(
            f"{name}: frequencies do not increase ({f[line]:g} Hz is followed by {f[line + 1]:g} Hz); sort the "
            "lines and keep each once"
        )


def _check_values(frf: Frf, name: str) -> None:
    if not frf.valid.any():
        raise InputError(f"{name}: no line is valid; estimate it again from tests with independent inputs")
    if not np.abs(frf.values[frf.valid]).any():
        raise InputError(f"{name}: every value is zero; check the channels it was estimated from")
    coherence = frf.multiple_coherence
    if coherence is None:
        return
    known = coherence[frf.valid]
    wrong = known[~((known >= -1e-6) & (known <= 1 + 1e-6))]
    if len(wrong):
        raise InputError(
            f"{name}: a multiple coherence is {wrong[0]:g}; a coherence lies between 0 and 1: estimate the FRF anew, "
            "or leave the coherence out"
        )


def _check_drive_points(frf: Frf, name: str) -> list[str]:
    for points in drive_points(frf.responses, frf.excitations).values():
        for point in points:
            share = returned_power(frf, [point])
            if share is not None and share > GATE.returned_wrong_sign:
                raise InputError(_wrong_sign(frf, point, share, name))
    return nodes_with_returned_power(frf)


def nodes_with_returned_power(frf: Frf) -> list[str]:
    """Return a sentence on each node that gives back power, which no passive structure does.

    Parameters
    ----------
    frf
        Measured, imported or evaluated from a model.
    """
    sentences = []
    for node, points in drive_points(frf.responses, frf.excitations).items():
        shares = [returned_power(frf, some) for some in (*([point] for point in points), points)]
        worst = max([share for share in shares if share is not None], default=0.0)
        if worst > GATE.returned_max:
            axes = ", ".join(point.name.partition(":")[2] for point in points)
            sentences.append(
                f"{node} gives back {100 * worst:.0f} % of the power that forces along {axes} feed in: a passive "
                f"structure gives none; {_rewired(frf, points) or 'check for swapped axes, a wrong sign, or noise'}"
            )
    return sentences


def _rewired(frf: Frf, points: Sequence[DrivePoint]) -> str:
    """Return which two responses of a node, exchanged, make it passive, each with its sign or turned; else nothing."""
    best, text = GATE.returned_max, ""
    for first, second in itertools.combinations(range(len(points)), 2):
        for turned in itertools.product((1.0, -1.0), repeat=2):
            exchanged, names = list(points), [points[k].name.partition(":")[2] for k in (first, second)]
            for k, other, sign in zip((first, second), (second, first), turned, strict=True):
                exchanged[k] = replace(points[k], row=points[other].row, sign=sign * points[k].sign)
            share = returned_power(frf, exchanged)
            if share is not None and share < best:
                signs = [f", {name} turned" for name, sign in zip(names, turned, strict=True) if sign < 0]
                best = share
                text = (
                    f"with the responses along {' and '.join(names)} exchanged{''.join(signs)}, it would give back "
                    f"{100 * share:.1f} %: correct the names of these channels and measure or convert again"
                )
    return text


def _wrong_sign(frf: Frf, point: DrivePoint, share: float, name: str) -> str:
    response, excitation = frf.responses[point.row], frf.excitations[point.column]
    return (
        f"{name}: {response} moves against its own force at {excitation} on {100 * share:.0f} % of the energy; turn "
        "the sign of one of the two channels, exchange force and response if their names are swapped, or correct the "
        "unit if it is another quantity"
    )


def driven_lines(spectra: CrossSpectra) -> NDArray[np.bool_]:
    """Return for each line whether it lies above 0 Hz and any input has power there, relative to its largest power."""
    power = np.real(np.einsum("kii->ki", spectra.input_spectra))
    largest = power.max(axis=0)
    share = np.max(power / np.where(largest > 0, largest, 1.0), axis=1)
    return np.asarray((share > GATE.input_driven) & (spectra.frequencies > 0))


def check_inputs(total: CrossSpectra, band: Band | None = None, least_share: float = 0.0) -> list[str]:
    """Check that the inputs of all tests are independent on the lines that they drive.

    Parameters
    ----------
    total
        Spectra of all tests, summed.
    band
        Lines that the job uses, Hz; None: all.
    least_share
        Share of the driven lines on which the inputs must be independent. 0, for an FRF that is estimated line by line:
        one line is enough, and the others are flagged as not valid.

    Returns
    -------
    list of str
        Warnings: bands in which the inputs are dependent or nearly so.

    Raises
    ------
    InputError
        An input without any power, no driven line in the band, or dependent inputs on too many of the driven lines.
    """
    f = total.frequencies
    in_band = np.ones(len(f), dtype=bool) if band is None else (f >= band[0]) & (f <= band[1])
    _refuse_silent(total, in_band)
    driven = driven_lines(total) & in_band
    if not driven.any():
        where = "" if band is None else f" between {band[0]:g} and {band[1]:g} Hz"
        raise InputError(f"the inputs have no power on any line{where}; check the excitation channels")
    lines = f[driven]
    inputs = input_independence(total, (float(lines[0]), float(lines[-1])))
    good = inputs.independent & driven
    share = float(good.sum() / driven.sum())
    if share == 0 or share < least_share:
        raise InputError(_dependent(total, driven, share, driven & ~inputs.independent))
    return list(inputs.warnings)


def check_band_recordings(
    recordings: Sequence[BandRecording], band: Band, names: Sequence[str], rates: Sequence[float]
) -> list[str]:
    """Check the inputs and the sample rates of recordings that are fitted together.

    The checks use the spectra of :func:`estimation.spectra_for_judging`.

    Parameters
    ----------
    recordings
        Records of one set-up.
    band : Hz
        Lowest and highest frequency of the fit.
    names, rates
        Names of the source recordings, and their sample rates (Hz) as the files state them.

    Raises
    ------
    InputError
        As :func:`check_inputs` and :func:`check_sample_rates`.
    """
    tests = spectra_for_judging(recordings)
    warnings = check_sample_rates([gain_of(*test) for test in zip(tests, names, rates, strict=True)])
    return warnings + check_inputs(sum_tests(tests), band, GATE.independent_lines_min)


def _refuse_silent(total: CrossSpectra, in_band: NDArray[np.bool_]) -> None:
    power = np.real(np.einsum("kii->ki", total.input_spectra))[in_band & (total.frequencies > 0)]
    silent = [channel.name for channel, p in zip(total.excitations, power.T, strict=True) if not (p > 0).any()]
    if silent and len(silent) < len(total.excitations):
        raise InputError(
            f"excitation {', '.join(silent)} has no power in any test: no FRF can be estimated for it; check its "
            "cable, or name the others with --excitation"
        )


def _dependent(total: CrossSpectra, driven: NDArray[np.bool_], share: float, bad: NDArray[np.bool_]) -> str:
    n_inputs, lines, tolerance = len(total.excitations), total.frequencies[driven], RECORDINGS.independent
    if share == 0:
        where = f"every line they drive ({lines[0]:.4g} to {lines[-1]:.4g} Hz)"
    else:
        where = f"{100 * (1 - share):.0f} % of the lines they drive ({bands_text(total.frequencies, bad)})"
    return (
        f"the {n_inputs} inputs are dependent on {where} in {total.n_tests} test{'s' if total.n_tests != 1 else ''} of "
        f"{total.n_segments} segments (an input direction has less than {tolerance:g} of the power): give at "
        f"least {n_inputs} tests with different immersions, porous material, or shorter segments"
    )


def check_local_frf(frf: Frf, n_tests: int) -> list[str]:
    """Return warnings about the errors of an FRF that is estimated with local polynomials.

    The transient of a record and the force of a slow sweep are both smooth in frequency. If they cannot be separated,
    the error bars are large. A fit weights the lines accordingly, but a reader of the curves needs a warning.

    Parameters
    ----------
    frf
        FRF with the covariance that :func:`estimation.local_polynomial` gives.
    n_tests
        Number of records from which it is estimated.
    """
    lines = 2 * local_half_width(n_tests, len(frf.excitations)) + 1
    shared = (
        f"errors of {lines} neighbouring lines are correlated (a window of local polynomials): a fit's error bars are "
        f"too small by up to {np.sqrt(lines):.0f} times"
    )
    return [shared, *_noisy_lines(frf)]


def _noisy_lines(frf: Frf) -> list[str]:
    variance = frf.entry_variance()
    if variance is None or not frf.valid.any():
        return []
    size = np.sqrt(np.sum(np.abs(frf.values) ** 2, axis=(1, 2)))
    error = np.sqrt(np.sum(variance, axis=(1, 2)))
    noisy = frf.valid & (error > GATE.line_error_max * size)
    if noisy.sum() <= GATE.noisy_lines_max * frf.valid.sum():
        return []
    return [
        f"on {int(noisy.sum())} of {int(frf.valid.sum())} lines ({bands_text(frf.frequencies, noisy)}) the standard "
        f"error is above {100 * GATE.line_error_max:.0f} % of the FRF: the force is weak there, or too smooth in "
        "frequency for local polynomials, as that of a slow sweep; compare with --estimator h1"
    ]


def check_window_damping(frf: Frf, name: str = "the FRF") -> None:
    """Refuse an FRF with an exponential window for a direct use of its values, because the window adds damping."""
    tau = frf.exponential_time_constant
    if tau is not None:
        raise InputError(
            f"{name} was windowed by exp(-t / {tau:.4g} s): its values show each mode with {1 / (2 * np.pi * tau):.3g} "
            "Hz of damping (half its half-power bandwidth) too much; fit it, which takes that off, and use the model"
        )
