"""Quantity, unit and known band of an FRF: conversion to receptance, integration of acceleration."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import SI_UNITS, Band, InputError

from ..band_recordings.channel_matching import DERIVATIVE_ORDERS, before_high_pass, kinematic_factor
from .frf_matrix import Frf, FrfCovariance

_NAMES = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
FRF_ORDERS = {name: DERIVATIVE_ORDERS[motion] for motion, name in _NAMES.items()}
"""Times that a receptance is differentiated to give the FRF."""


def frf_quantity(responses: Sequence[Channel], excitations: Sequence[Channel]) -> tuple[str, str]:
    """Quantity and unit of the FRF between channels.

    Raises
    ------
    InputError
        Responses (or excitations) of different quantities: an FRF matrix has one unit.
    """
    for role, channels in (("responses", responses), ("excitations", excitations)):
        kinds = sorted({channel.quantity for channel in channels})
        if len(kinds) > 1:
            raise InputError(f"{role} of different quantities ({', '.join(kinds)}); choose channels of one quantity")
    response, excitation = responses[0], excitations[0]
    name = _NAMES.get(response.quantity, "transfer") if excitation.quantity == "force" else "transfer"
    return name, f"{response.unit}/{excitation.unit}"


def to_receptance(frf: Frf) -> Frf:
    """Displacement over force: divide by ``s^n``, n = 2 for accelerance, 1 for mobility.

    ``s`` is ``i w``, or ``i w + 1/tau`` where an exponential window was used (:attr:`estimation.Frf.laplace`). The line
    at 0 Hz has no receptance from motion that was differentiated: it is zeroed and not valid.
    A ``transfer`` is returned as it is.

    Raises
    ------
    InputError
        An unknown quantity.
    """
    if frf.quantity in ("receptance", "transfer"):
        return frf
    if frf.quantity not in FRF_ORDERS:
        raise InputError(f"cannot turn {frf.quantity!r} into receptance; use receptance, mobility or accelerance")
    s, moving = frf.laplace, frf.frequencies > 0
    factor = np.divide(1.0, s ** FRF_ORDERS[frf.quantity], out=np.zeros_like(s), where=moving)
    covariance = frf.covariance
    if covariance is not None:
        covariance = FrfCovariance(covariance.response * (np.abs(factor) ** 2)[:, None, None], covariance.excitation)
    return replace(
        frf,
        values=frf.values * factor[:, None, None],
        quantity="receptance",
        unit=frf.unit.replace("m/s^2", "m").replace("m/s", "m"),
        valid=frf.valid & moving,
        covariance=covariance,
    )


def correct_high_pass(
    frf: Frf, corners: Sequence[float | None], force_corners: Sequence[float | None] | None = None
) -> Frf:
    """Take out the first-order high-passes ``s / (s + 2 pi corner)`` of the responses' and the excitations' sensors.

    Each row is divided by the high-pass of its response, each column multiplied by that of its excitation:
    ``H = diag(1 / h_p) H_measured diag(h_q)``.

    Parameters
    ----------
    frf
        Measured FRF to correct.
    corners : Hz
        Corner of each response's high-pass; None or 0: none.
    force_corners : Hz
        Corner of each excitation's high-pass, likewise; None: none has one.

    Raises
    ------
    InputError
        Not one corner for each response, or for each excitation.
    """
    forces = [None] * len(frf.excitations) if force_corners is None else list(force_corners)
    for found, wanted, what in ((corners, frf.responses, "responses"), (forces, frf.excitations, "excitations")):
        if len(found) != len(wanted):
            raise InputError(f"{len(found)} high-pass corners for {len(wanted)} {what}; give one for each")
    if not any(corners) and not any(forces):
        return frf
    rows, columns = (before_high_pass(frf.laplace, [one or 0.0 for one in found]) for found in (corners, forces))
    columns = 1 / columns
    covariance = frf.covariance
    if covariance is not None:
        covariance = FrfCovariance(
            covariance.response * rows[:, :, None] * rows.conj()[:, None, :],
            covariance.excitation * columns[:, :, None] * columns.conj()[:, None, :],
        )
    valid = frf.valid & (frf.frequencies > 0)
    values = frf.values * rows[:, :, None] * columns[:, None, :]
    return replace(frf, values=values, covariance=covariance, valid=valid)


EXCITATIONS = ("force", "moment", "voltage", "acceleration")
"""Quantities that may drive a rig: the last one is that of a shaken base."""

FAMILIES = (
    ("displacement", "velocity", "acceleration"),
    ("angle", "angular_velocity"),
)
"""Responses that are one motion and its derivatives."""


def quantities_of_unit(unit: str) -> tuple[str, str]:
    """Quantities of response and excitation of an FRF in a unit such as ``m/N``, ``m/s^2/V`` or ``rad/(N m)``.

    Parameters
    ----------
    unit
        SI unit of the response, a stroke, SI unit of the excitation, with or without brackets around either.

    Raises
    ------
    InputError
        A unit that is not made of two that channels have.

    Examples
    --------
    >>> quantities_of_unit("m/s^2/N m"), quantities_of_unit("m/V")
    (('acceleration', 'moment'), ('displacement', 'voltage'))
    """
    plain = unit.replace("(", "").replace(")", "")
    for response, excitation in product(SI_UNITS, EXCITATIONS):
        if plain == f"{SI_UNITS[response]}/{SI_UNITS[excitation]}":
            return response, excitation
    raise InputError(
        f"unit {unit!r} does not say what drives and what answers; write response over excitation in SI units, "
        "such as m/N, m/V, rad/(N m) or m/s^2/V"
    )


def family_of(response: str) -> tuple[str, ...]:
    """Quantities that are the same motion as a response; the quantity alone where it is no motion.

    Examples
    --------
    >>> family_of("angular_velocity"), family_of("voltage")
    (('angle', 'angular_velocity'), ('voltage',))
    """
    return next((family for family in FAMILIES if response in family), (response,))


def displacement_from_acceleration(
    acceleration: NDArray[np.float64], sample_rate: float, low_cut: float
) -> NDArray[np.float64]:
    """Integrate twice: divide by ``-(2 pi f)^2`` above ``low_cut``, nothing below, a cosine step between.

    The step runs from 0.7 to 1 times ``low_cut``. The record's straight line is taken off and
    it is mirrored at both ends, so that no jump leaks into the band. Within some ten periods of the low cut from
    either end the result is a guess all the same: what came before the record is not known.

    Parameters
    ----------
    acceleration : (n_samples, n_channels), m/s^2
        Acceleration of each channel.
    sample_rate : Hz
        Samples a second.
    low_cut : Hz
        Frequency below which everything is left out: drift, the sensor's own high-pass, thermal wander.

    Returns
    -------
    (n_samples, n_channels), m

    Raises
    ------
    InputError
        A low cut that is not between 0 and half the sample rate, or a record shorter than four of its periods.
    """
    data = np.asarray(acceleration, dtype=float)
    if not 0 < low_cut < sample_rate / 2:
        raise InputError(f"low cut {low_cut:g} Hz must lie between 0 and {sample_rate / 2:g} Hz")
    if len(data) < 4 * sample_rate / low_cut:
        raise InputError(
            f"{len(data) / sample_rate:.3g} s are fewer than four periods of the low cut {low_cut:g} Hz; raise it"
        )
    n = len(data)
    time = np.linspace(-1, 1, n)[:, None]
    centred = data - data.mean(axis=0)
    centred = centred - time * (time * centred).sum(axis=0) / (time**2).sum()
    margin = min(n - 1, int(4 * sample_rate / low_cut))
    before, after = centred[margin:0:-1], centred[-2 : -margin - 2 : -1]
    padded = np.concatenate([before, centred, after])
    f = np.asarray(np.fft.rfftfreq(len(padded), 1 / sample_rate), dtype=float)
    rise = np.clip((f / low_cut - 0.7) / 0.3, 0.0, 1.0)
    gain = np.zeros(len(f), dtype=complex)
    gain[1:] = 0.5 * (1 - np.cos(np.pi * rise[1:])) / kinematic_factor(f[1:], np.array([2]), (0.0,))[:, 0]
    whole = np.fft.irfft(np.fft.rfft(padded, axis=0) * gain[:, None], len(padded), axis=0)
    return np.asarray(whole[margin : margin + n])


COHERENT = 0.5
"""Multiple coherence of the best response from which a line says something of the structure."""

BRIDGED = 8
"""Lines of a gap that is bridged: a multisine drives every second or fourth line, and single lines fail by chance."""


def known_band(frf: Frf, driven: NDArray[np.bool_]) -> Band | None:
    """Find the stretch of known lines that holds most of the structure's motion.

    A line is known where it is valid, driven, above 0 Hz and coherent in one response at least. If there
    are several stretches (a sweep of a cutter drives one for each harmonic of its teeth), the one with the most energy
    of the mobility counts.

    Parameters
    ----------
    frf
        Estimated FRF, with its multiple coherence if it is known.
    driven : (n_frequencies,), bool
        Whether the inputs have power on the line.

    Returns
    -------
    Band or None
        None where fewer than two lines are known.

    Examples
    --------
    >>> axis, ones = np.arange(100.0), np.ones(100, dtype=bool)
    >>> frf = Frf(axis, np.ones((100, 1, 1), complex), ("A:+X",), ("A:+X",), "mobility", "m/s/N", ones)
    >>> known_band(frf, (axis > 20) & (axis < 61))
    (21.0, 60.0)
    """
    f = frf.frequencies
    known = frf.valid & driven & (f > 0)
    if frf.multiple_coherence is not None:
        known &= frf.multiple_coherence.max(axis=1) >= COHERENT
    lines = np.flatnonzero(known)
    if len(lines) < 2:
        return None
    energy = np.sum(np.abs(frf.values) ** 2, axis=(1, 2)) * np.where(f > 0, f, 1.0) ** (
        2.0 - 2.0 * FRF_ORDERS.get(frf.quantity, 1)
    )
    stretches = [part for part in np.split(lines, np.flatnonzero(np.diff(lines) > BRIDGED) + 1) if len(part) > 1]
    if not stretches:
        return None
    best = max(stretches, key=lambda part: float(energy[part].sum()))
    return float(f[best[0]]), float(f[best[-1]])
