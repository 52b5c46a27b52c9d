"""Quantity, unit and known band of an FRF, and its conversion to receptance."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import SI_UNITS, Band, Complex, InputError, Real

from ..band_recordings.channel_matching import DERIVATIVE_ORDERS, before_high_pass
from ..settings import FRFS
from .frf_matrix import Frf, FrfCovariance

_NAMES = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
# how many times a receptance is differentiated to give the FRF
FRF_ORDERS = {name: DERIVATIVE_ORDERS[motion] for motion, name in _NAMES.items()}
_EXCITATIONS = ("force", "moment", "voltage", "acceleration")  # an acceleration drives a shaken base
_FAMILIES = (("displacement", "velocity", "acceleration"), ("angle", "angular_velocity"))


def frf_quantity(responses: Sequence[Channel], excitations: Sequence[Channel]) -> tuple[str, str]:
    """Return quantity and unit of the FRF between channels; refuse channels of several quantities."""
    for role, channels in (("response", responses), ("excitation", excitations)):
        kinds = dict[str, list[str]]()
        for channel in channels:
            kinds.setdefault(channel.quantity, []).append(channel.name)
        if len(kinds) > 1:
            given = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in kinds.items())
            chosen = " ".join(f"--{role} {name}" for name in max(kinds.values(), key=len))
            raise InputError(
                f"{role}s of different quantities ({given}); choose those of one quantity, such as {chosen}"
            )
    response, excitation = responses[0], excitations[0]
    name = _NAMES.get(response.quantity, "transfer") if excitation.quantity == "force" else "transfer"
    return name, f"{response.unit}/{excitation.unit}"


def frf_of_channels(
    frequencies: Real,
    values: Complex,
    responses: Sequence[Channel],
    excitations: Sequence[Channel],
    valid: NDArray[np.bool_],
    covariance: FrfCovariance | None,
    multiple_coherence: Real | None = None,
    spectral_width: float | None = None,
) -> Frf:
    """Make an FRF with the degrees of freedom, the quantity and the unit of the channels."""
    quantity, unit = frf_quantity(responses, excitations)
    rows, columns = (tuple(channel.degree_of_freedom for channel in side) for side in (responses, excitations))
    quality = (valid, multiple_coherence, covariance)
    return Frf(frequencies, values, rows, columns, quantity, unit, *quality, spectral_width=spectral_width)


def to_receptance(frf: Frf) -> Frf:
    """Convert to displacement over force: divide by ``s^n``, n = 2 for accelerance, 1 for mobility.

    ``s`` is ``i w``, or ``i w + 1/tau`` where an exponential window was used (:attr:`estimation.Frf.laplace`). The line
    at 0 Hz has no receptance where velocity or acceleration was measured: it is set to zero and not valid. A
    ``transfer`` is returned as it is.
    """
    if frf.quantity in ("receptance", "transfer"):
        return frf
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
        common_errors=None if frf.common_errors is None else frf.common_errors * factor[:, None, None],
    )


def correct_high_pass(
    frf: Frf, corners: Sequence[float | None], force_corners: Sequence[float | None] | None = None
) -> Frf:
    """Remove the first-order high-passes ``s / (s + 2 pi corner)`` of the responses' and the excitations' sensors.

    Each row is divided by the high-pass of its response, each column multiplied by the high-pass of its excitation:
    ``H = diag(1 / h_p) H_measured diag(h_q)``.

    Parameters
    ----------
    frf
        Measured FRF to correct.
    corners : Hz
        Corner of each response's high-pass; None or 0: none.
    force_corners : Hz
        Corner of each excitation's high-pass, None or 0: none; None for all: no excitation has one.

    Raises
    ------
    InputError
        Not one corner for each response, or for each excitation.
    """
    forces = [None] * len(frf.excitations) if force_corners is None else list(force_corners)
    for side, axis, name in ((corners, frf.responses, "responses"), (forces, frf.excitations, "excitations")):
        if len(side) != len(axis):
            raise InputError(f"{len(side)} high-pass corners for {len(axis)} {name}; give one for each")
    if not any(corners) and not any(forces):
        return frf
    rows, columns = (before_high_pass(frf.laplace, [corner or 0.0 for corner in side]) for side in (corners, forces))
    columns = 1 / columns  # a force that a high-pass made smaller makes the FRF larger
    covariance = frf.covariance
    if covariance is not None:
        covariance = FrfCovariance(
            covariance.response * rows[:, :, None] * rows.conj()[:, None, :],
            covariance.excitation * columns[:, :, None] * columns.conj()[:, None, :],
        )
    valid = frf.valid & (frf.frequencies > 0)
    gain = rows[:, :, None] * columns[:, None, :]
    common = None if frf.common_errors is None else frf.common_errors * gain
    return replace(frf, values=frf.values * gain, covariance=covariance, valid=valid, common_errors=common)


def quantities_of_unit(unit: str) -> tuple[str, str]:
    """Find the quantities of response and excitation of an FRF from its unit.

    Parameters
    ----------
    unit
        SI unit of the response, a slash, SI unit of the excitation, with or without brackets around either: ``m/N``,
        ``m/s^2/V``, ``rad/(N m)``.

    Raises
    ------
    InputError
        A unit that is not made of two units of channels.

    Examples
    --------
    >>> quantities_of_unit("m/s^2/N m"), quantities_of_unit("m/V")
    (('acceleration', 'moment'), ('displacement', 'voltage'))
    """
    plain = unit.replace("(", "").replace(")", "")
    for response, excitation in product(SI_UNITS, _EXCITATIONS):
        if plain == f"{SI_UNITS[response]}/{SI_UNITS[excitation]}":
            return response, excitation
    raise InputError(
        f"unit {unit!r} is not that of a response over an excitation; write both in SI units, such as m/N, m/V, "
        "rad/(N m) or m/s^2/V"
    )


def family_of(response: str) -> tuple[str, ...]:
    """List the quantities that are the same motion as a response; the quantity alone where it is no motion.

    Examples
    --------
    >>> family_of("angular_velocity"), family_of("voltage")
    (('angle', 'angular_velocity'), ('voltage',))
    """
    return next((family for family in _FAMILIES if response in family), (response,))


def known_band(frf: Frf, driven: NDArray[np.bool_]) -> Band | None:
    """Find the range of known lines in which the structure moves most.

    A line is known where it is valid, driven, above 0 Hz and coherent in one response at least. If there are several
    ranges (a sweep of a cutter drives one for each harmonic of its teeth), the range with the most energy of the
    mobility is returned.

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
        known &= frf.multiple_coherence.max(axis=1) >= FRFS.coherent
    lines = np.flatnonzero(known)
    exponent = 2.0 - 2.0 * FRF_ORDERS.get(frf.quantity, 1)  # of w, in the power of the mobility over the FRF's
    energy = np.sum(np.abs(frf.values) ** 2, axis=(1, 2)) * np.where(f > 0, f, 1.0) ** exponent
    ranges = np.split(lines, np.flatnonzero(np.diff(lines) > FRFS.bridged_lines) + 1)
    best = max(
        (part for part in ranges if len(part) > 1), key=lambda part: float(energy[part].sum()), default=lines[:0]
    )
    return (float(f[best[0]]), float(f[best[-1]])) if len(best) else None
