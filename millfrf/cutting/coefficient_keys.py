"""Keys of force coefficients that the tables ``[cutting]`` and ``[turning]`` share."""

import math
from typing import Any

from millfrf.core import InputError

from .chip_law import ChipLaw
from .process import MillingProcess, check_covariance

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
