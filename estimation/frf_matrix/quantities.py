"""Name and unit of an FRF's quantity, and its conversion to receptance."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition import Channel
from foundation import InputError

from ..band_recordings import DERIVATIVE_ORDERS, before_high_pass
from .frf import Frf, FrfCovariance

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
