"""Inputs of a job that inverts them: have they power, are they independent, on enough of the lines that they drive?"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimation import (
    RANK_TOLERANCE,
    BandRecording,
    CrossSpectra,
    bands_text,
    input_independence,
    spectra_for_judging,
    sum_tests,
)
from millfrf.core import Band, InputError

from .sample_rates import check_sample_rates, gain_of

DRIVEN = 1e-4
"""A line is driven where the power of one of the inputs is above this share of that input's largest."""

LEAST_SHARE = 0.5
"""Share of the driven lines on which a fit needs independent inputs; below it the model guesses most of the band."""


def driven_lines(spectra: CrossSpectra) -> NDArray[np.bool_]:
    """Lines above 0 Hz on which the inputs have power at all, each input weighed by its own largest.

    Returns
    -------
    (n_frequencies,), bool
    """
    power = np.real(np.einsum("kii->ki", spectra.input_spectra))
    largest = power.max(axis=0)
    share = np.max(power / np.where(largest > 0, largest, 1.0), axis=1)
    return np.asarray((share > DRIVEN) & (spectra.frequencies > 0))


def check_inputs(total: CrossSpectra, band: Band | None = None, least_share: float = 0.0) -> list[str]:
    """Judge rank and condition of the stacked inputs on the lines that they drive.

    Parameters
    ----------
    total
        Spectra of all tests, summed.
    band
        Lines that the job uses, Hz; None: all.
    least_share
        Share of the driven lines on which the inputs must be independent. 0, for an FRF that is estimated line by line:
        one line is enough, and the others are flagged as not valid. :data:`LEAST_SHARE` for a fit over the band.

    Returns
    -------
    list of str
        Doubts: bands in which the inputs are dependent or nearly so.

    Raises
    ------
    InputError
        An input without any power, no driven line in the band, or dependent inputs on more of them than the job bears.
    """
    f = total.frequencies
    inside = np.ones(len(f), dtype=bool) if band is None else (f >= band[0]) & (f <= band[1])
    _refuse_silent(total, inside)
    driven = driven_lines(total) & inside
    if not driven.any():
        where = "" if band is None else f" between {band[0]:g} and {band[1]:g} Hz"
        raise InputError(f"the inputs have no power on any line{where}; check the excitation channels")
    lines = f[driven]
    judged = input_independence(total, (float(lines[0]), float(lines[-1])))
    good = judged.independent & driven
    share = float(good.sum() / driven.sum())
    if share == 0 or share < least_share:
        raise InputError(_dependent(total, driven, share, driven & ~judged.independent))
    return list(judged.warnings)


def check_band_recordings(
    recordings: Sequence[BandRecording], band: Band, names: Sequence[str], rates: Sequence[float]
) -> list[str]:
    """Judge the inputs and the sample rates of recordings that are fitted together.

    Their spectra are those of :func:`estimation.spectra_for_judging`.

    Parameters
    ----------
    recordings
        Records of one set-up.
    band : Hz
        Lowest and highest frequency of the fit.
    names, rates
        Names of the recordings they were made from, and their sample rates (Hz) as the files state them.

    Raises
    ------
    InputError
        As :func:`check_inputs` and :func:`millfrf.gate.sample_rates.check_sample_rates`.
    """
    tests = spectra_for_judging(recordings)
    doubts = check_sample_rates([gain_of(*each) for each in zip(tests, names, rates, strict=True)])
    return doubts + check_inputs(sum_tests(tests), band, LEAST_SHARE)


def _refuse_silent(total: CrossSpectra, inside: NDArray[np.bool_]) -> None:
    power = np.real(np.einsum("kii->ki", total.input_spectra))[inside & (total.frequencies > 0)]
    silent = [channel.name for channel, one in zip(total.excitations, power.T, strict=True) if not (one > 0).any()]
    if silent and len(silent) < len(total.excitations):
        raise InputError(
            f"excitation {', '.join(silent)} has no power in any test: no FRF can be had for it; check its cable, or "
            "name the others with --excitation"
        )


def _dependent(total: CrossSpectra, driven: NDArray[np.bool_], share: float, bad: NDArray[np.bool_]) -> str:
    n_inputs, lines = len(total.excitations), total.frequencies[driven]
    if share == 0:
        where = f"every line they drive ({lines[0]:.4g} to {lines[-1]:.4g} Hz)"
    else:
        where = f"{100 * (1 - share):.0f} % of the lines they drive ({bands_text(total.frequencies, bad)})"
    return (
        f"the {n_inputs} inputs are dependent on {where} in {total.n_tests} test{'s' if total.n_tests != 1 else ''} of "
        f"{total.n_segments} segments (an input direction has less than {RANK_TOLERANCE:g} of the power): give at "
        f"least {n_inputs} tests with different immersions, porous material, or shorter segments"
    )
