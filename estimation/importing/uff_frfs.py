"""FRFs and coherences of Universal File Format files (data set 58)."""

import os
import re
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import UFF_AXES, read_uff_sets
from millfrf.core import FileFormatError, InputError, Real, counted, listed

from ..frf.frf_matrix import Frf
from .entries import FrfEntry, ImportedFrf, assembled
from .sources import frequency_unit_of, hertz
from .units import FrfUnit, unit_of_uff

DataSet = Mapping[str, Any]

_FUNCTIONS, _UNITS = 58, 164  # types of data sets
_FRF, _ORDINARY, _MULTIPLE = 4, 6, 26  # function types of data set 58: FRF, ordinary and multiple coherence
_UNKNOWN_TYPE, _GENERAL_TYPE, _FREQUENCY_TYPE = 0, 1, 18  # specific data types of the axis of frequencies
# first identification line that millfrf writes: degrees of freedom in full
_OWN_LABELS = re.compile(r"\w+ ([^:]+:[+-]\w+) / ([^:]+:[+-]\w+)")


@dataclass(frozen=True)
class _Coherence:
    response: str
    excitation: str
    values: Real  # (n_frequencies,)
    has_reference: bool  # whether the file names a node of the excitation; some programs leave it out
    source: str  # name of the file and place in it, for messages


@dataclass(frozen=True)
class UffChoice:
    """Choices of a mapping that apply to UFF files."""

    quantity: str | None = None  # takes precedence over the file
    unit: str | None = None  # takes precedence over the file
    responses: tuple[str, ...] = ()  # degrees of freedom that are read; empty: all
    excitations: tuple[str, ...] = ()  # degrees of freedom that are read; empty: all
    # response and excitation of data sets by their place in the file, counted from 1; others are not read
    places: dict[int, tuple[str, str]] | None = None
    frequency_unit: str | None = None  # takes precedence over the file
    conjugate: bool = False  # whether the file's phases are for exp(-i w t)
    averages: int | None = None

    def includes(self, label: tuple[str, str]) -> bool:
        """Return whether an entry of this response and excitation is read."""
        chosen = (self.responses, self.excitations)
        return all(not names or name in names for name, names in zip(label, chosen, strict=True))


@dataclass(frozen=True)
class _Content:
    entries: list[FrfEntry]
    unit: FrfUnit | None  # None for a file without FRFs
    ordinary: list[_Coherence]
    multiple: list[_Coherence]
    kinds: str  # function types of the file, for messages
    account: str  # sentence on what was read, and what not


def read_frf_uff(path: str | os.PathLike[str]) -> Frf:
    """Read all FRFs of a UFF file as one matrix; lines that are 0 in every entry are not valid.

    Ordinary coherences (function type 6) are matched to their FRF by response and reference, multiple ones (26) by
    response.

    Raises
    ------
    InputError
        No such file, or a file that does not state what its FRFs are.
    FileFormatError
        A damaged file, a file without FRFs, entries that are missing or given twice, or axes that differ.
    """
    return import_uffs([Path(path)], UffChoice()).frf


def import_uffs(paths: Sequence[Path], choice: UffChoice) -> ImportedFrf:
    """Read all FRFs of UFF files into one matrix, such as one file for each position of a roving hammer."""
    contents = [_content(path, choice) for path in paths]
    units = {path.name: content.unit for path, content in zip(paths, contents, strict=True) if content.unit is not None}
    if not units:
        raise FileFormatError(
            f"{paths[0]} holds no FRF (data set 58, function type 4) but {contents[0].kinds}; export FRFs, or give a "
            "mapping with channels for time records"
        )
    first = next(iter(units.values()))
    if len({unit.quantity for unit in units.values()}) > 1:
        kinds = ", ".join(f"{name}: {unit.quantity}" for name, unit in units.items())
        raise InputError(f"FRFs of different quantities ({kinds}); convert those of one quantity at a time")
    # coherences may be in another file than their FRFs: they are matched over all files
    entries, unmatched = _with_coherences(
        [entry for content in contents for entry in content.entries],
        [coherence for content in contents for coherence in content.ordinary],
    )
    frf, doubts_of_lines = assembled(entries, first.quantity, first.unit)
    frf = _with_multiple_coherence(frf, [coherence for content in contents for coherence in content.multiple])
    said = (text for unit in units.values() for text in unit.inferred)
    inferred = (*said, *(content.account for content in contents))
    doubts = [*(text for unit in units.values() for text in unit.doubts), *doubts_of_lines]
    if unmatched:
        names = listed(unmatched, 3)
        doubts.append(f"{paths[0].name}: coherence of {names} belongs to none of the FRFs and is left out")
    return ImportedFrf(frf, inferred, tuple(doubts))


def _content(path: Path, choice: UffChoice) -> _Content:
    sets = read_uff_sets(path, (_FUNCTIONS, _UNITS))
    functions = [each for each in sets if each["type"] == _FUNCTIONS]
    if choice.places is not None:
        functions = [each for each in functions if each["place"] in choice.places]
    ambiguous = _ambiguous_numbers(functions)
    labels = {
        each["place"]: _labels(path, each, ambiguous, choice)
        for each in functions
        if each["func_type"] in (_FRF, _ORDINARY, _MULTIPLE)
    }
    all_frfs = [each for each in functions if each["func_type"] == _FRF]
    frfs = [each for each in all_frfs if choice.includes(labels[each["place"]])]
    if all_frfs and not frfs:
        names = sorted({" / ".join(labels[each["place"]]) for each in all_frfs})
        raise InputError(f"{path} holds none of the chosen responses and excitations; it has {', '.join(names)}")
    _require_translations(path, frfs, labels)
    file_units = [each for each in sets if each["type"] == _UNITS]
    unit = unit_of_uff(path, frfs, file_units, choice.quantity, choice.unit) if frfs else None
    driven = {labels[each["place"]][1] for each in all_frfs}

    def coherences(kind: int) -> list[_Coherence]:
        # a coherence often states no excitation: only an excitation of an FRF counts as not chosen
        return [
            _Coherence(*label, np.real(each["data"]).astype(float), int(each["ref_node"]) > 0, _source(path, each))
            for each in functions
            if each["func_type"] == kind
            for label in [labels[each["place"]]]
            if (choice if label[1] in driven else replace(choice, excitations=())).includes(label)
        ]

    factor = 1.0 if unit is None else unit.factor
    entries = [_entry(path, each, labels[each["place"]], factor, choice) for each in frfs]
    types = sorted({int(each["func_type"]) for each in functions})
    kinds = f"function types {', '.join(map(str, types))}" if types else "no function at all"
    ordinary, multiple = coherences(_ORDINARY), coherences(_MULTIPLE)
    others = Counter(int(each["func_type"]) for each in functions)
    others.subtract({_FRF: len(entries), _ORDINARY: len(ordinary), _MULTIPLE: len(multiple)})
    not_read = [f"{counted(n, 'function')} of type {kind}" for kind, n in others.items() if n]
    account = f"{path.name}: {counted(len(entries), 'FRF')} read"
    account += f"; not read: {', '.join(not_read)}" if not_read else ""
    return _Content(entries, unit, ordinary, multiple, kinds, account)


def _entry(path: Path, function: DataSet, label: tuple[str, str], factor: float, choice: UffChoice) -> FrfEntry:
    if not np.iscomplexobj(function["data"]):
        raise InputError(
            f"{_source(path, function)}: the FRF holds real numbers: a magnitude or a real part alone is no FRF; "
            "export complex values"
        )
    values = factor * np.asarray(function["data"], dtype=np.complex128)
    return FrfEntry(
        *label,
        hertz(function["x"], _frequency_unit(path, function, choice), path),
        values.conj() if choice.conjugate else values,
        _source(path, function),
        averages=choice.averages or 0,
    )


def _frequency_unit(path: Path, function: DataSet, choice: UffChoice) -> str:
    """Return the unit of the frequencies of a data set; refuse an axis that is none of frequency."""
    label = str(function.get("abscissa_axis_units_lab") or "").strip()
    said = "" if label.upper() in ("NONE", "UNKNOWN", "NO LABEL") else label
    kind = int(function.get("abscissa_spec_data_type") or 0)
    if not said and kind not in (_UNKNOWN_TYPE, _GENERAL_TYPE, _FREQUENCY_TYPE):
        name = str(function.get("abscissa_axis_lab") or "").strip()
        said = name or f"type {kind}"
    return frequency_unit_of(said, f"{_source(path, function)}: the frequency axis", choice.frequency_unit)


def _with_coherences(entries: Sequence[FrfEntry], coherences: Sequence[_Coherence]) -> tuple[list[FrfEntry], list[str]]:
    """Add the ordinary coherences to the entries; also return the names of coherences that belong to no entry.

    A coherence without a reference belongs to the only FRF of its response.
    """
    matched: dict[tuple[str, str], _Coherence] = {}
    unmatched: list[str] = []
    labels = {(entry.response, entry.excitation) for entry in entries}
    for coherence in coherences:
        label = (coherence.response, coherence.excitation)
        name = " / ".join(label)
        same_response = [each for each in labels if each[0] == coherence.response]
        if label not in labels and not coherence.has_reference and len(same_response) == 1:
            label = same_response[0]
        if label not in labels:
            unmatched.append(name)
        elif label in matched:
            raise FileFormatError(f"{coherence.source} gives the coherence of {name} twice; export it once")
        else:
            matched[label] = coherence
    return [_with_coherence(entry, matched.get((entry.response, entry.excitation))) for entry in entries], unmatched


def _with_coherence(entry: FrfEntry, coherence: _Coherence | None) -> FrfEntry:
    if coherence is None:
        return entry
    if len(coherence.values) != len(entry.values):
        raise FileFormatError(
            f"{coherence.source}: {entry.name} has {len(entry.values)} lines, its coherence {len(coherence.values)}; "
            "export both on one frequency axis"
        )
    return replace(entry, coherence=coherence.values)


def _with_multiple_coherence(frf: Frf, coherences: Sequence[_Coherence]) -> Frf:
    """Add the multiple coherence to the FRF, where each response has one on the axis of the FRF."""
    values = {each.response: each.values for each in coherences if len(each.values) == len(frf.frequencies)}
    if not all(response in values for response in frf.responses):
        return frf
    return replace(frf, multiple_coherence=np.stack([values[response] for response in frf.responses], axis=1))


def _source(path: Path, function: DataSet) -> str:
    return f"{path.name}, data set {function['place']}"


def _labels(path: Path, function: DataSet, ambiguous: Collection[int], choice: UffChoice) -> tuple[str, str]:
    """Return response and excitation: from the mapping, as millfrf wrote them, or by numbers of node and direction."""
    stated = (choice.places or {}).get(function["place"])
    if stated is not None:
        return stated
    own = _OWN_LABELS.fullmatch(str(function["id1"]).strip())
    if own is not None:
        return own[1], own[2]
    return _label(path, function, "rsp", ambiguous), _label(path, function, "ref", ambiguous)


def _label(path: Path, function: DataSet, side: str, ambiguous: Collection[int]) -> str:
    direction = int(function[f"{side}_dir"])
    if abs(direction) >= len(UFF_AXES):
        raise FileFormatError(
            f"{_source(path, function)}: direction {direction} is none; give response and excitation of the data set "
            "in a mapping"
        )
    name, number = _component(function, side), int(function[f"{side}_node"])
    node = name if name and number <= 0 else f"{name}.{number}" if name and number in ambiguous else str(number)
    return f"{node.replace(':', '_')}:{'-' if direction < 0 else '+'}{UFF_AXES[abs(direction)]}"


def _component(function: DataSet, side: str) -> str:
    name = str(function.get(f"{side}_ent_name", "")).strip()
    return "" if name.upper() == "NONE" else name


def _ambiguous_numbers(functions: Sequence[DataSet]) -> set[int]:
    """Return the node numbers that several components of the structure use."""
    components: dict[int, set[str]] = defaultdict(set)
    for function in functions:
        for side in ("rsp", "ref"):
            components[int(function[f"{side}_node"])].add(_component(function, side))
    return {number for number, names in components.items() if len(names - {""}) > 1}


def _require_translations(path: Path, frfs: Sequence[DataSet], labels: Mapping[int, tuple[str, str]]) -> None:
    for frf in frfs:
        rotations = [label for label in labels[frf["place"]] if label.partition(":")[2][1:].startswith("R")]
        if rotations:
            raise FileFormatError(
                f"{_source(path, frf)}: {rotations[0]} is a rotation, whose FRF has another unit; choose the "
                "translations by responses and excitations in a mapping"
            )
