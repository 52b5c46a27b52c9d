"""Keys of force coefficients that the tables ``[cutting]`` and ``[turning]`` share."""

import math
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Strict

from millfrf.core import InputError

from .chip_law import ChipLaw
from .process import MillingProcess, check_covariance

Number = Annotated[float, Strict()]  # neither text nor true or false is accepted as a number


class CoefficientKeys(BaseModel):
    """Dependence of the force coefficients on the chip, process damping, and standard errors.

    Parameters
    ----------
    ktc_exponent
        Exponent m with which the tangential coefficient falls with the chip thickness h (Kienzle),
        ``ktc_pa (h / reference_chip_m)^-m``, 0 to below 1; 0: it does not. Typical: 0.2 to 0.3 for steel. An exponent
        needs the feed and ``edge_radius_m``.
    krc_exponent
        Exponent of the radial coefficient, which is ``krc ktc_pa`` at ``reference_chip_m``; without it that of
        ``ktc_exponent``, so that ``krc`` holds at every chip thickness.
    kac_exponent
        Exponent of the axial coefficient, likewise.
    reference_chip_m : m
        Chip thickness at which ``ktc_pa``, ``krc`` and ``kac`` hold, above 0; 0.001 for Kienzle's kc1.1.
    edge_radius_m : m
        Radius of the cutting edges, 0 or more: for a thinner chip the force follows the tangent of the law. Typical:
        5e-6 to 20e-6 for carbide. Without an exponent it has no effect.
    process_damping_n_per_m : N/m
        Coefficient C of process damping, 0 or more: the force on the flank is ``C v_n / V`` per metre of edge, with v_n
        the speed into the surface and V the cutting speed. 0: no process damping, which is on the safe side.
    ktc_std_pa : Pa
        Standard error of ``ktc_pa``, below it; it enters the confidence bands of the limits. 0: not known.
    krc_std
        Standard error of ``krc``; 0: not known.
    kac_std
        Standard error of ``kac``; 0: not known.
    covariance
        Instead of the three standard errors: covariance of ``ktc_pa``, ``krc``, ``kac``, ``kte_n_per_m``,
        ``kre_n_per_m``, ``kae_n_per_m``, six rows in this order and these units, or nine with ``ktc_exponent``,
        ``krc_exponent``, ``kac_exponent``, as ``millfrf cut identify`` writes it. The bands of the limits use all but
        the edge coefficients.
    """

    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)

    ktc_exponent: Number = 0.0
    krc_exponent: Number | None = None
    kac_exponent: Number | None = None
    reference_chip_m: Number = 1e-3
    edge_radius_m: Number = 0.0
    process_damping_n_per_m: Number = 0.0
    ktc_std_pa: Number = 0.0
    krc_std: Number = 0.0
    kac_std: Number = 0.0
    covariance: tuple[tuple[Number, ...], ...] = ()


_KEYS = {
    "ktc": "ktc_pa",
    "krc": "krc",
    "kac": "kac",
    "kte": "kte_n_per_m",
    "kre": "kre_n_per_m",
    "kae": "kae_n_per_m",
    "process_damping": "process_damping_n_per_m",
}
_ERRORS = {"ktc_std": "ktc_std_pa", "krc_std": "krc_std", "kac_std": "kac_std"}


def coefficient_fields(table: Any) -> dict[str, Any]:
    """Return the fields of `MillingProcess` for coefficients and errors that a table states.

    Raises
    ------
    InputError
        Both standard errors and a covariance, or a covariance that no errors can have.
    """
    stated = {field: getattr(table, key) for field, key in (_KEYS | _ERRORS).items()}
    stated["chip_law"] = _chip_law(table)
    if not table.covariance:
        return stated
    if any(stated[field] for field in _ERRORS):
        raise InputError(f"give either covariance or {', '.join(_ERRORS.values())}, not both")
    check_covariance(table.covariance)
    variances = [table.covariance[k][k] for k in range(3)]
    errors = dict(zip(_ERRORS, map(math.sqrt, variances), strict=True))
    return stated | errors | {"covariance": table.covariance}


def _chip_law(table: Any) -> ChipLaw:
    shared = table.ktc_exponent
    radial, axial = (shared if own is None else own for own in (table.krc_exponent, table.kac_exponent))
    return ChipLaw((shared, radial, axial), table.reference_chip_m, table.edge_radius_m)


def coefficient_entries(process: MillingProcess) -> dict[str, str]:
    """Return keys and TOML values of the coefficients of a process, those of zero left out."""
    needed = ("ktc", "krc", "kac")
    entries = {
        key: repr(float(getattr(process, field)))
        for field, key in _KEYS.items()
        if field in needed or getattr(process, field)
    }
    law = process.chip_law
    if law.varies:
        names = ("ktc_exponent", "krc_exponent", "kac_exponent", "reference_chip_m")
        entries |= {key: repr(float(value)) for key, value in zip(names, (*law.exponents, law.reference), strict=True)}
    if law.edge_radius:
        entries["edge_radius_m"] = repr(float(law.edge_radius))
    if process.covariance:
        rows = [", ".join(repr(float(value)) for value in row) for row in process.covariance]
        return entries | {"covariance": "[\n" + "".join(f"    [{row}],\n" for row in rows) + "]"}
    return entries | {key: repr(float(error)) for field, key in _ERRORS.items() if (error := getattr(process, field))}
