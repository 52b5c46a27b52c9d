"""Quantity and unit of imported FRFs, and the factor to SI."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from millfrf.core import InputError, unit_factor

# quantities of an FRF with a fixed unit
SI = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}
HOW_TO_STATE = 'write unit = "m/s^2/N" (or m/N, m/s/N, g/N ...) under [frf]'  # for messages

_INVERSE = {"dynamic stiffness": "N/m", "impedance": "N s/m", "apparent mass": "N s^2/m"}
_GRAVITY = re.compile(r"(?<![\w.])(?:g|gn|g0|G)(?![\w.])")
_SPELLINGS = (
    ("²", "^2"),
    ("\N{REPLACEMENT CHARACTER}", "^2"),  # a superscript in an old code page that was not decoded
    ("·", "*"),
    ("⋅", "*"),
    ("µ", "u"),
    ("μ", "u"),
    ("[", "("),
    ("]", ")"),
)
# quantities by the number of the ordinate in UFF data set 58
_QUANTITIES = {8: "receptance", 11: "mobility", 12: "accelerance"}
_FORCES = (9, 13)  # reaction and excitation force


@dataclass(frozen=True)
class FrfUnit:
    """Quantity of an FRF, its unit in SI, and the factor from a file's numbers to that unit.

    ``inferred`` and ``doubts`` are sentences as in an :class:`ImportedFrf`.
    """

    quantity: str
    unit: str
    factor: float
    inferred: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def frf_unit(text: str) -> FrfUnit:
    """Find quantity and factor of a unit such as ``m/s^2/N``, ``g/N``, ``(m/s²)/(N)``, ``um/N`` or ``in/lbf``.

    ``g`` is read as standard gravity, because no FRF is in grams.

    Examples
    --------
    >>> frf_unit("g/N").quantity, frf_unit("g/N").factor
    ('accelerance', 9.80665)
    >>> frf_unit("um/kN").quantity, round(frf_unit("um/kN").factor, 15)
    ('receptance', 1e-09)
    """
    plain = text.strip()
    for spelling, replacement in _SPELLINGS:
        plain = plain.replace(spelling, replacement)
    plain = re.sub(r"(?<![a-zA-Z])s2(?![0-9])", "s^2", plain)
    if not plain:
        raise InputError('the unit of the FRF is empty; write it as in unit = "m/s^2/N"')
    readings = [plain, _GRAVITY.sub("standard_gravity", plain)]
    pair = re.fullmatch(r"\(([^()]+)\)\s*\(([^()]+)\)", plain)  # SignalCalc writes no slash: (m/s²)(N)
    if pair is not None:
        ratio = f"({pair[1]})/({pair[2]})"
        readings += [ratio, _GRAVITY.sub("standard_gravity", ratio)]
    for reading in readings:
        for quantity, unit in SI.items():
            factor = unit_factor(reading, unit)
            if factor is not None:
                return FrfUnit(quantity, unit, factor)
    for name, unit in _INVERSE.items():
        if any(unit_factor(reading, unit) is not None for reading in readings):
            raise InputError(f"unit {text!r} is that of a {name}, force over motion; give the FRF, its inverse")
    raise InputError(
        f"unit {text!r} is no motion over force; write it as m/N, um/N, m/s/N, m/s^2/N or g/N, or give "
        'quantity = "transfer" where it is another ratio'
    )


def unit_is_of_frf(text: str) -> bool:
    """Return whether a text is a unit of motion over force that ``frf_unit`` knows.

    >>> unit_is_of_frf("um/N"), unit_is_of_frf("V")
    (True, False)
    """
    try:
        frf_unit(text)
    except InputError:
        return False
    return True


def unit_of_mapping(quantity: str | None, unit: str | None) -> FrfUnit:
    """Return the unit of FRFs whose quantity or unit a mapping states."""
    if quantity == "transfer":
        return FrfUnit("transfer", unit or "1", 1.0)
    if unit is None:
        missing = f"{quantity} needs its unit" if quantity else "the quantity of the FRF is not stated"
        raise InputError(f"{missing}: {HOW_TO_STATE} in a mapping")
    stated = frf_unit(unit)
    if quantity not in (None, stated.quantity):
        raise InputError(f"unit {unit!r} is that of {stated.quantity}, not of {quantity}; correct one of the two")
    return stated


def doubts_of_unit(stated: FrfUnit, said: str, source: str) -> tuple[str, ...]:
    """Return a doubt where a file says another unit than its mapping, which takes precedence.

    >>> doubts_of_unit(frf_unit("m/s^2/N"), "g/N", "a.csv")
    ('a.csv says g/N: 9.81 times what the mapping says (m/s^2/N), which was taken; correct one of the two',)
    """
    if not said or stated.quantity == "transfer" or not unit_is_of_frf(said):
        return ()
    own = frf_unit(said)
    if own.quantity == stated.quantity:
        if abs(own.factor / stated.factor - 1) < 1e-6:
            return ()
        ratio = f"{own.factor / stated.factor:.3g} times what the mapping says"
    else:
        ratio = f"{own.quantity}, not the {stated.quantity} that the mapping says"
    return (f"{source} says {said}: {ratio} ({stated.unit}), which was taken; correct one of the two",)


def unit_of_uff(
    path: Path,
    frfs: Sequence[Mapping[str, Any]],
    file_units: Sequence[Mapping[str, Any]],
    quantity: str | None = None,
    unit: str | None = None,
) -> FrfUnit:
    """Find the unit of all FRFs (data sets 58) of a UFF file with units in data sets 164.

    Quantity and unit stated by a mapping take precedence over the file.
    """
    if unit is not None or quantity == "transfer":
        stated = unit_of_mapping(quantity, unit)
        labels = {_ratio_text(frf) for frf in frfs}
        doubts = tuple(text for label in sorted(labels) for text in doubts_of_unit(stated, label, path.name))
        return replace(stated, doubts=doubts)
    units = {_unit_of_set(path, frf, file_units, quantity) for frf in frfs}
    if len(units) > 1:
        kinds = ", ".join(sorted(f"{each.quantity} in {each.unit} times {each.factor:g}" for each in units))
        raise InputError(f"{path} holds FRFs of different kinds ({kinds}); choose responses of one kind in a mapping")
    return units.pop()


def _unit_of_set(
    path: Path, frf: Mapping[str, Any], file_units: Sequence[Mapping[str, Any]], quantity: str | None
) -> FrfUnit:
    label, denominator = (_text(frf.get(f"{side}_axis_units_lab")) for side in ("ordinate", "orddenom"))
    if _text(frf.get("ordinate_axis_lab")) == "transfer":  # millfrf writes ratios that are no FRF so
        return FrfUnit("transfer", label or "1", 1.0)
    types = int(frf["ordinate_spec_data_type"]), int(frf.get("orddenom_spec_data_type") or 0)
    if quantity is None and types[0] in _QUANTITIES and types[1] in _QUANTITIES:
        return _transmissibility(path, label, denominator, types)
    stated = None
    if int(frf.get("orddenom_spec_data_type", 0)) in _FORCES:
        stated = _QUANTITIES.get(int(frf["ordinate_spec_data_type"]))
    if quantity is not None and stated not in (None, quantity):
        raise InputError(f"{path}: the mapping states {quantity}, the file {stated}; correct the mapping")
    stated = stated or quantity
    ratio = _ratio_text(frf)
    unit = _unit_of_labels(label, denominator)
    inferred: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    if unit is not None and stated is None:
        inferred = (f"{path.name}: taken as {unit.quantity}, from the unit {ratio}",)
    if unit is None and stated and label and not denominator:
        unit = _unit_of_labels(label, "N")
        doubts = (f"{path.name}: force taken in N: only the response's unit {label} is stated",)
    if unit is not None and stated not in (None, unit.quantity):
        raise InputError(
            f"{path}: data set {frf['place']} calls itself {stated} but has the unit {ratio}; {HOW_TO_STATE} in a "
            "mapping"
        )
    if unit is not None:
        return FrfUnit(unit.quantity, unit.unit, unit.factor, inferred, doubts)
    if stated is None or label:
        label_text = f"unit {label!r}" if label else "no unit"
        raise InputError(
            f"{path}: data set {frf['place']} does not state what its FRF is (ordinate type "
            f"{int(frf['ordinate_spec_data_type'])}, {label_text}); {HOW_TO_STATE} in a mapping"
        )
    return _unit_of_file(path, stated, file_units)


def _ratio_text(frf: Mapping[str, Any]) -> str:
    """Write the unit of a data set from the labels of its axes."""
    labels = [_text(frf.get(f"{side}_axis_units_lab")) for side in ("ordinate", "orddenom")]
    return " / ".join(text for text in labels if text).replace("\N{REPLACEMENT CHARACTER}", "²")


def _transmissibility(path: Path, label: str, denominator: str, types: tuple[int, int]) -> FrfUnit:
    """Return the unit of a ratio of two motions, which is no FRF."""
    alike = types[0] == types[1]
    unit = "1" if alike and label == denominator else f"({label or '1'})/({denominator or '1'})"
    factor = unit_factor(unit, "1") if alike else None
    text = (
        f"{path.name}: a ratio of two motions ({label or 'no unit'} over {denominator or 'no unit'}), kept as transfer"
    )
    return FrfUnit("transfer", unit if factor is None else "1", factor or 1.0, (text,))


def _unit_of_labels(label: str, denominator: str) -> FrfUnit | None:
    """Find the unit from the labels of the axes: response and force separately, or the whole ratio on the ordinate."""
    for text in (f"({label})/({denominator})", label) if denominator else (label,):
        try:
            return frf_unit(text)
        except InputError:
            continue
    return None


def _unit_of_file(path: Path, quantity: str, file_units: Sequence[Mapping[str, Any]]) -> FrfUnit:
    """Find the unit from data set 164, which holds the file's units of length and force per metre and newton."""
    if not file_units:
        doubt = f"{path.name}: taken as {quantity} in {SI[quantity]}, since the file states no unit"
        return FrfUnit(quantity, SI[quantity], 1.0, doubts=(doubt,))
    factor = float(file_units[0]["force"]) / float(file_units[0]["length"])
    times = f": times {factor:g}" if factor != 1 else ""
    inferred = f"{path.name}: taken as {quantity} in {SI[quantity]} by the file's units (set 164){times}"
    return FrfUnit(quantity, SI[quantity], factor, (inferred,))


def _text(value: Any) -> str:
    text = str(value or "").strip()
    return "" if text.upper() == "NONE" else text
