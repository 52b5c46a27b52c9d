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


def correct_high_pass(frf: Frf, corners: Sequence[float | None]) -> Frf:
    """Divide each response by its sensor's first-order high-pass ``s / (s + 2 pi corner)``.

    Parameters
    ----------
    frf
        Measured FRF to correct.
    corners : Hz
        Corner of each response's high-pass; None or 0: none.

    Raises
    ------
    InputError
        Not one corner for each response.
    """
    if len(corners) != len(frf.responses):
        raise InputError(f"{len(corners)} high-pass corners for {len(frf.responses)} responses; give one for each")
    if not any(corners):
        return frf
    factor = before_high_pass(frf.laplace, [corner or 0.0 for corner in corners])
    covariance = frf.covariance
    if covariance is not None:
        scaled = covariance.response * factor[:, :, None] * factor.conj()[:, None, :]
        covariance = FrfCovariance(scaled, covariance.excitation)
    valid = frf.valid & (frf.frequencies > 0)
    return replace(frf, values=frf.values * factor[:, :, None], covariance=covariance, valid=valid)
