"""FRFs that a job uses: ordered axes, coherence from 0 to 1, some motion, sign convention, passive drive points."""

import numpy as np

from estimation import Frf
from millfrf.core import Band, InputError, shared_band

from .incoherence import incoherence_doubts
from .passivity import DrivePoint, drive_points, returned_power, rising_phase
from .reciprocity import check_reciprocity
from .sizes import size_doubts

RISING = 0.5
"""Share of the phase's weighted steps that may rise; measured structures have below 0.02, conjugates above 0.98."""

RETURNED = 0.9
"""Share of the power that one axis may give back: above it the sign is wrong."""

DOUBTED = 0.15
"""Share of the power that a node may give back without a doubt; measured tips have below 0.05, swapped axes 0.3."""

BEYOND = 0.1
"""Share of a fit's band that may lie outside the band of its FRF without a doubt."""


def check_frf(frf: Frf, name: str = "the FRF") -> list[str]:
    """Judge an FRF before lobes, a fit or a calibration stand on it.

    Parameters
    ----------
    frf
        Measured, imported or evaluated from a model.
    name
        Name of its file, for the message.

    Returns
    -------
    list of str
        Doubts: a coherence below a half where nothing else tells the errors; drive points that give back part of the
        power, or that are softer or stiffer than machines are.

    Raises
    ------
    InputError
        Frequencies that are negative, not finite or not increasing; no valid line; a coherence outside 0 to 1; values
        that are all zero; the sign convention ``exp(-i w t)``; a drive point that moves against its own force.
    """
    _check_axis(frf, name)
    _check_values(frf, name)
    rising = rising_phase(frf)
    if rising is not None and rising > RISING:
        raise InputError(
            f"{name}: the phase rises with frequency on {100 * rising:.0f} % of the energy: the values stand for "
            "exp(-i w t), this program's for exp(+i w t); conjugate the values"
        )
    doubts = incoherence_doubts(frf)
    return doubts if frf.quantity == "transfer" else [*doubts, *_check_drive_points(frf, name), *size_doubts(frf)]


def check_frf_for_fit(frf: Frf, band: Band, name: str = "the FRF") -> list[str]:
    """Judge an FRF as :func:`check_frf` does, and whether the fit's band (Hz) lies in that of the FRF.

    Returns
    -------
    list of str
        Doubts of :func:`check_frf` and :func:`check_reciprocity`; and where
        the fit's band reaches beyond the FRF's by a tenth of its width or more.

    Raises
    ------
    InputError
        As :func:`check_frf`, or where both bands have nothing in common.
    """
    doubts = [*check_frf(frf, name), *check_reciprocity(frf, name, band)]
    if frf.band is None:
        return doubts
    shared = shared_band(band, frf.band)
    assert shared is not None
    missing = 1 - (shared[1] - shared[0]) / (band[1] - band[0])
    if missing >= BEYOND:
        doubts.append(
            f"{100 * missing:.0f} % of the fit's band, {band[0]:g} to {band[1]:g} Hz, lies outside the {frf.band[0]:g} "
            f"to {frf.band[1]:g} Hz in which {name} is driven and coherent; fit inside it"
        )
    return doubts


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
    doubts = []
    for node, points in drive_points(frf.responses, frf.excitations).items():
        shares = [returned_power(frf, [point]) for point in points]
        for point, share in zip(points, shares, strict=True):
            if share is not None and share > RETURNED:
                raise InputError(_against(frf, point, share, name))
        together = returned_power(frf, points)
        worst = max([share for share in (*shares, together) if share is not None], default=0.0)
        if worst > DOUBTED:
            axes = ", ".join(point.name.partition(":")[2] for point in points)
            doubts.append(
                f"{node} gives back {100 * worst:.0f} % of the power that forces along {axes} feed in: a passive "
                "structure gives none; check for swapped axes, a wrong sign, or noise"
            )
    return doubts


def _against(frf: Frf, point: DrivePoint, share: float, name: str) -> str:
    response, excitation = frf.responses[point.row], frf.excitations[point.column]
    return (
        f"{name}: {response} moves against its own force at {excitation} on {100 * share:.0f} % of the energy; turn "
        "the sign of one of the two channels, exchange force and response if their names are swapped, or correct the "
        "unit if it is another quantity"
    )
