"""Units of imported FRFs, and their conversion to SI."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from millfrf.core import InputError, unit_factor

SI = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}
"""FRF quantities whose unit is fixed, and that unit."""

_INVERSE = {"dynamic stiffness": "N/m", "impedance": "N s/m", "apparent mass": "N s^2/m"}
_GRAVITY = re.compile(r"(?<![\w.])(?:g|gn|g0|G)(?![\w.])")
_SIGNS = (
    ("²", "^2"),
    ("\N{REPLACEMENT CHARACTER}", "^2"),  # a superscript in an old code page, which readers of text cannot tell
    ("·", "*"),
    ("⋅", "*"),
    ("µ", "u"),
    ("μ", "u"),
    ("[", "("),
    ("]", ")"),
)


@dataclass(frozen=True)
class FrfUnit:
    """What a unit says of an FRF.

    Parameters
    ----------
    quantity
        ``receptance``, ``mobility`` or ``accelerance``.
    factor
        Takes a number in the unit to SI: to m/N, m/s/N or m/s^2/N.
    """

    quantity: str
    factor: float


def frf_unit(text: str) -> FrfUnit:
    """Quantity and factor of an FRF's unit; ``g`` is standard gravity, for no FRF has grams.

    Parameters
    ----------
    text
        ``m/s^2/N``, ``g/N``, ``(m/s²)/(N)``, ``um/N``, ``mm/s/kN``, ``in/lbf`` ...

    Raises
    ------
    InputError
        Not a unit, the unit of a stiffness, or a unit of anything that is no motion over force.

    Examples
    --------
    >>> frf_unit("g/N")
    FrfUnit(quantity='accelerance', factor=9.80665)
    >>> frf_unit("um/kN").quantity, round(frf_unit("um/kN").factor, 15)
    ('receptance', 1e-09)
    """
    plain = _plain(text)
    if not plain:
        raise InputError('the unit of the FRF is empty; write it as in unit = "m/s^2/N"')
    spellings = [plain, _GRAVITY.sub("standard_gravity", plain)]
    beside = re.fullmatch(r"\(([^()]+)\)\s*\(([^()]+)\)", plain)  # side by side, as SignalCalc writes
    if beside is not None:
        ratio = f"({beside[1]})/({beside[2]})"
        spellings += [ratio, _GRAVITY.sub("standard_gravity", ratio)]
    for spelling in spellings:
        for quantity, unit in SI.items():
            factor = unit_factor(spelling, unit)
            if factor is not None:
                return FrfUnit(quantity, factor)
    for name, unit in _INVERSE.items():
        if any(unit_factor(spelling, unit) is not None for spelling in spellings):
            raise InputError(f"unit {text!r} is that of a {name}, force over motion; give the FRF, its inverse")
    raise InputError(
        f"unit {text!r} is no motion over force; write it as m/N, um/N, m/s/N, m/s^2/N or g/N, or give "
        'quantity = "transfer" where it is another ratio'
    )


def _plain(text: str) -> str:
    plain = text.strip()
    for written, read in _SIGNS:
        plain = plain.replace(written, read)
    return re.sub(r"(?<![a-zA-Z])s2(?![0-9])", "s^2", plain)


_MOTION = {8: "receptance", 11: "mobility", 12: "accelerance"}
_FORCES = (9, 13)  # reaction and excitation force
_ASKED = 'write unit = "m/s^2/N" (or m/N, m/s/N, g/N ...) under [frf] in a mapping'


@dataclass(frozen=True)
class StatedUnit:
    """Quantity and unit of FRFs, and the factor that takes them to SI.

    Parameters
    ----------
    quantity, unit
        Quantity and unit, as in an `Frf`.
    factor
        Factor from the file's numbers to ``unit``.
    inferred, doubts
        Sentences about what was inferred or left open, as in an `ImportedFrf`.
    """

    quantity: str
    unit: str
    factor: float
    inferred: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def stated_unit(
    path: Path,
    frfs: Sequence[dict[str, Any]],
    units: Sequence[dict[str, Any]],
    quantity: str | None = None,
    unit: str | None = None,
) -> StatedUnit:
    """Find quantity, unit and factor of all FRFs of a file.

    Parameters
    ----------
    path
        Path of the file, for messages.
    frfs
        Data sets 58 of the file.
    units
        Data sets 164 of the file.
    quantity, unit
        Quantity and unit that a mapping states; they count for more than the file.

    Raises
    ------
    InputError
        FRFs of different quantities or units, or a file that does not say what they are, or contradicts itself.
    """
    if unit is not None or quantity == "transfer":
        return given_unit(quantity, unit)
    seen = {_one(path, one, units, quantity) for one in frfs}
    if len(seen) > 1:
        kinds = ", ".join(sorted(f"{found.quantity} in {found.unit} times {found.factor:g}" for found in seen))
        raise InputError(f"{path} holds FRFs of different kinds ({kinds}); choose responses of one kind in a mapping")
    return seen.pop()


def given_unit(quantity: str | None, unit: str | None) -> StatedUnit:
    """What a mapping says of its FRFs.

    Raises
    ------
    InputError
        Neither, a unit that is not understood or not that of the quantity, or a quantity without a unit.
    """
    if quantity == "transfer":
        return StatedUnit("transfer", unit or "1", 1.0)
    if unit is None:
        known = f"{quantity} needs its unit" if quantity else "what the FRF is must be said"
        raise InputError(f"{known}: {_ASKED}")
    found = frf_unit(unit)
    if quantity not in (None, found.quantity):
        raise InputError(f"unit {unit!r} is that of {found.quantity}, not of {quantity}; correct one of the two")
    return StatedUnit(found.quantity, SI[found.quantity], found.factor)


def _one(path: Path, one: dict[str, Any], units: Sequence[dict[str, Any]], quantity: str | None) -> StatedUnit:
    label, over = (_text(one.get(f"{side}_axis_units_lab")) for side in ("ordinate", "orddenom"))
    if _text(one.get("ordinate_axis_lab")) == "transfer":  # what this program writes for ratios that are no FRF
        return StatedUnit("transfer", label or "1", 1.0)
    stated = _stated_quantity(one)
    if quantity is not None and stated not in (None, quantity):
        raise InputError(f"{path}: the mapping says {quantity}, the file {stated}; correct the mapping")
    stated = stated or quantity
    found = _labelled(label, over)
    inferred: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    if found is not None and stated is None:
        inferred = (f"{path.name}: taken as {found.quantity}, from the unit {_ratio(label, over)}",)
    if found is None and stated and label and not over:
        found = _labelled(label, "N")
        doubts = (f"{path.name}: force taken in N: only the response's unit {label} is stated",)
    if found is not None and stated not in (None, found.quantity):
        raise InputError(
            f"{path}: data set {one['place']} calls itself {stated} but has the unit {_ratio(label, over)}; {_ASKED}"
        )
    if found is not None:
        return StatedUnit(found.quantity, SI[found.quantity], found.factor, inferred, doubts)
    if stated is None or label:
        said = f"unit {label!r}" if label else "no unit"
        raise InputError(
            f"{path}: data set {one['place']} does not say what its FRF is (ordinate type "
            f"{int(one['ordinate_spec_data_type'])}, {said}); {_ASKED}"
        )
    return _by_file_units(path, stated, units)


def _ratio(label: str, over: str) -> str:
    return " / ".join(text for text in (label, over) if text).replace("\N{REPLACEMENT CHARACTER}", "²")


def _stated_quantity(one: dict[str, Any]) -> str | None:
    if int(one.get("orddenom_spec_data_type", 0)) not in _FORCES:
        return None
    return _MOTION.get(int(one["ordinate_spec_data_type"]))


def _labelled(label: str, over: str) -> FrfUnit | None:
    """The unit by the axes' labels: response over force apart, or the whole ratio at the ordinate."""
    for text in (f"({label})/({over})", label) if over else (label,):
        try:
            return frf_unit(text)
        except InputError:
            continue
    return None


def _by_file_units(path: Path, quantity: str, units: Sequence[dict[str, Any]]) -> StatedUnit:
    """Set 164 holds the file's units of length and force a metre and a newton."""
    if units:
        factor = float(units[0]["force"]) / float(units[0]["length"])
        said = f"by the file's units (set 164): times {factor:g}" if factor != 1 else "by the file's units (set 164)"
    else:
        factor, said = 1.0, "as its numbers, since the file states no unit"
    told = (f"{path.name}: taken as {quantity} in {SI[quantity]} {said}",)
    return StatedUnit(quantity, SI[quantity], factor, told if units else (), () if units else told)


def _text(value: Any) -> str:
    text = str(value or "").strip()
    return "" if text.upper() == "NONE" else text
