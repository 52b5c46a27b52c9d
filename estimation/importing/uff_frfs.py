"""FRFs and coherences of Universal File Format files (data set 58)."""

import os
import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import read_uff_sets
from millfrf.core import FileFormatError, InputError, Real

from ..frf.frf_matrix import Frf
from .entries import FrfEntry, ImportedFrf, assembled
from .units import StatedUnit, stated_unit

ORDINARY, MULTIPLE = 6, 26
"""Function types of data set 58."""

_NAMED = 3


@dataclass(frozen=True)
class Coherence:
    """One coherence as a file holds it.

    Parameters
    ----------
    response, excitation
        Degrees of freedom, ``node:direction``.
    values : (n_frequencies,)
        Ordinary coherence of each line, 0 to 1.
    has_reference
        Whether the file names a node of the excitation; some programs leave it out.
    source
        Name of the file and place in it, for messages.
    """

    response: str
    excitation: str
    values: Real
    has_reference: bool
    source: str

    @property
    def name(self) -> str:
        """Name of the entry, ``response / excitation``."""
        return f"{self.response} / {self.excitation}"


def coherences_of(
    functions: Sequence[Mapping[str, Any]], kind: int, labels: Mapping[int, tuple[str, str]], sources: Mapping[int, str]
) -> list[Coherence]:
    """All coherences of one function type among data sets 58 whose degrees of freedom are known."""
    return [
        Coherence(
            *labels[one["place"]], np.real(one["data"]).astype(float), int(one["ref_node"]) > 0, sources[one["place"]]
        )
        for one in functions
        if one["func_type"] == kind and one["place"] in labels
    ]


def with_coherences(
    entries: Sequence[FrfEntry], coherences: Sequence[Coherence]
) -> tuple[list[FrfEntry], tuple[str, ...]]:
    """Entries with their ordinary coherence, matched by response and excitation; also what belongs to none.

    A coherence without a reference belongs to the only FRF of its response.

    Raises
    ------
    FileFormatError
        A coherence that is given twice, or is as long as no FRF.
    """
    given: dict[tuple[str, str], Coherence] = {}
    lost: list[str] = []
    known = {(entry.response, entry.excitation) for entry in entries}
    for one in coherences:
        ends = [end for end in known if end[0] == one.response]
        place = (one.response, one.excitation)
        if place not in known and not one.has_reference and len(ends) == 1:
            place = ends[0]
        if place not in known:
            lost.append(one.name)
        elif place in given:
            raise FileFormatError(f"{one.source} gives the coherence of {one.name} twice; export it once")
        else:
            given[place] = one
    found = [_with(entry, given.get((entry.response, entry.excitation))) for entry in entries]
    more = f" and {len(lost) - _NAMED} more" if len(lost) > _NAMED else ""
    said = f"coherence of {', '.join(lost[:_NAMED])}{more} belongs to none of the FRFs and is left out"
    return found, (said,) if lost else ()


def _with(entry: FrfEntry, coherence: Coherence | None) -> FrfEntry:
    if coherence is None:
        return entry
    if len(coherence.values) != len(entry.values):
        raise FileFormatError(
            f"{coherence.source}: {entry.name} has {len(entry.values)} lines, its coherence {len(coherence.values)}; "
            "export both on one frequency axis"
        )
    return replace(entry, coherence=coherence.values)


def with_multiple_coherence(frf: Frf, coherences: Sequence[Coherence]) -> Frf:
    """The FRF with its multiple coherence, where each response has one on the axis of the FRF."""
    found = {one.response: one.values for one in coherences if len(one.values) == len(frf.frequencies)}
    if not all(response in found for response in frf.responses):
        return frf
    return replace(frf, multiple_coherence=np.stack([found[response] for response in frf.responses], axis=1))


_FUNCTION, _UNITS = 58, 164
_FRF = 4
_READ = (_FRF, ORDINARY, MULTIPLE)
_AXES = ("S", "X", "Y", "Z", "RX", "RY", "RZ")
_OURS = re.compile(r"\w+ ([^:]+:[+-]\w+) / ([^:]+:[+-]\w+)")
"""First identification line that this program writes: degrees of freedom in full."""

DataSet = dict[str, Any]


@dataclass(frozen=True)
class UffChoice:
    """The part of a mapping that concerns a UFF file; each field may be left out.

    Parameters
    ----------
    quantity, unit
        Quantity and unit of the FRFs, where the file does not say it or says it wrong.
    responses, excitations
        Degrees of freedom to take; empty: all.
    places
        Response and excitation of data sets by their place in the file, counted from 1; None: as the file says. Those
        that are not named are left out.
    conjugate
        Whether the file's phases stand for ``exp(-i w t)``.
    averages
        Number of averages behind each FRF; None: not known.
    """

    quantity: str | None = None
    unit: str | None = None
    responses: tuple[str, ...] = ()
    excitations: tuple[str, ...] = ()
    places: dict[int, tuple[str, str]] | None = None
    conjugate: bool = False
    averages: int | None = None


@dataclass(frozen=True)
class _Content:
    """What one file holds; the unit is None where it has no FRF, as a file of coherences alone."""

    entries: list[FrfEntry]
    unit: StatedUnit | None
    coherences: list[Coherence]
    multiple: list[Coherence]
    kinds: str


def read_frf_uff(path: str | os.PathLike[str]) -> Frf:
    """Read all FRFs of a UFF file as one matrix; lines that are 0 in every entry are not valid.

    Ordinary coherences (function type 6) are matched to their FRF by response and reference, multiple ones (26) by
    response.

    Raises
    ------
    InputError
        No such file, or one that does not say what its FRFs are.
    FileFormatError
        A damaged file, no FRF inside, entries that are missing or given twice, or unlike axes.
    """
    return import_uff(Path(path)).frf


def import_uff(path: Path, choice: UffChoice | None = None) -> ImportedFrf:
    """As :func:`read_frf_uff`, with what a mapping says of the file.

    Raises
    ------
    InputError, FileFormatError
        As :func:`read_frf_uff`.
    """
    return import_uffs([path], choice or UffChoice())


def import_uffs(paths: Sequence[Path], choice: UffChoice) -> ImportedFrf:
    """As :func:`import_uff` of several files, such as one for each position of a roving hammer.

    Raises
    ------
    InputError, FileFormatError
        As :func:`read_frf_uff`; also files whose FRFs are of different quantities.
    """
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
    entries = [
        replace(one, values=one.values.conj() if choice.conjugate else one.values, averages=choice.averages or 0)
        for content in contents
        for one in content.entries
    ]
    entries, lost = with_coherences(entries, [one for content in contents for one in content.coherences])
    frf = assembled(entries, first.quantity, first.unit)
    frf = with_multiple_coherence(frf, [one for content in contents for one in content.multiple])
    inferred = tuple(text for unit in units.values() for text in unit.inferred)
    doubts = tuple(text for unit in units.values() for text in unit.doubts)
    return ImportedFrf(frf, inferred, (*doubts, *(f"{paths[0].name}: {text}" for text in lost)))


def _content(path: Path, choice: UffChoice) -> _Content:
    sets = read_uff_sets(path, (_FUNCTION, _UNITS))
    functions = [one for one in sets if one["type"] == _FUNCTION]
    if choice.places is not None:
        functions = [one for one in functions if one["place"] in choice.places]
    named = _numbers_with_several_names(functions)
    labels = {one["place"]: _labels(path, one, named, choice) for one in functions if one["func_type"] in _READ}
    frfs = [one for one in functions if one["func_type"] == _FRF]
    chosen = [one for one in frfs if _taken(labels[one["place"]], choice)]
    if frfs and not chosen:
        raise InputError(
            f"{path} holds none of the chosen responses and excitations; it has "
            f"{', '.join(sorted({f'{p} / {q}' for p, q in (labels[one['place']] for one in frfs)}))}"
        )
    _require_translations(path, chosen, labels)
    units = [one for one in sets if one["type"] == _UNITS]
    unit = stated_unit(path, chosen, units, choice.quantity, choice.unit) if chosen else None
    factor = 1.0 if unit is None else unit.factor
    sources = {one["place"]: _source(path, one) for one in functions}
    driven = {labels[one["place"]][1] for one in frfs}  # another excitation than these is none that could be left out
    taken = {
        place: (response, excitation)
        for place, (response, excitation) in labels.items()
        if _taken((response, excitation), choice if excitation in driven else replace(choice, excitations=()))
    }
    ordinary, multiple = (coherences_of(functions, kind, taken, sources) for kind in (ORDINARY, MULTIPLE))
    entries = [_entry(path, one, labels[one["place"]], factor) for one in chosen]
    return _Content(entries, unit, ordinary, multiple, _kinds(functions))


def _kinds(functions: Sequence[DataSet]) -> str:
    kinds = sorted({int(one["func_type"]) for one in functions})
    return f"function types {', '.join(map(str, kinds))}" if kinds else "no function at all"


def _taken(label: tuple[str, str], choice: UffChoice) -> bool:
    response, excitation = label
    return (not choice.responses or response in choice.responses) and (
        not choice.excitations or excitation in choice.excitations
    )


def _entry(path: Path, one: DataSet, label: tuple[str, str], factor: float) -> FrfEntry:
    return FrfEntry(*label, one["x"], factor * np.asarray(one["data"], dtype=np.complex128), _source(path, one))


def _source(path: Path, one: DataSet) -> str:
    return f"{path.name}, data set {one['place']}"


def _labels(path: Path, one: DataSet, named: Collection[int], choice: UffChoice) -> tuple[str, str]:
    """Response and excitation: as the mapping, as this program wrote them, else by number of node and direction."""
    given = (choice.places or {}).get(one["place"])
    if given is not None:
        return given
    ours = _OURS.fullmatch(str(one["id1"]).strip())
    if ours is not None:
        return ours[1], ours[2]
    return _label(path, one, "rsp", named), _label(path, one, "ref", named)


def _label(path: Path, one: DataSet, side: str, named: Collection[int]) -> str:
    direction = int(one[f"{side}_dir"])
    if abs(direction) >= len(_AXES):
        raise FileFormatError(
            f"{_source(path, one)}: direction {direction} is none; give response and excitation of the data set in a "
            "mapping"
        )
    name = _entity(one, side)
    number = int(one[f"{side}_node"])
    node = name if name and number <= 0 else f"{name}.{number}" if name and number in named else str(number)
    return f"{node.replace(':', '_')}:{'-' if direction < 0 else '+'}{_AXES[abs(direction)]}"


def _entity(one: DataSet, side: str) -> str:
    name = str(one.get(f"{side}_ent_name", "")).strip()
    return "" if name.upper() == "NONE" else name


def _numbers_with_several_names(functions: Sequence[DataSet]) -> set[int]:
    """Node numbers that components of the structure share, so that the number alone does not say which node it is."""
    names: dict[int, set[str]] = defaultdict(set)
    for one in functions:
        for side in ("rsp", "ref"):
            names[int(one[f"{side}_node"])].add(_entity(one, side))
    return {number for number, found in names.items() if len(found - {""}) > 1}


def _require_translations(path: Path, frfs: Sequence[DataSet], labels: dict[int, tuple[str, str]]) -> None:
    for one in frfs:
        turning = [label for label in labels[one["place"]] if label.partition(":")[2][1:].startswith("R")]
        if turning:
            raise FileFormatError(
                f"{_source(path, one)}: {turning[0]} is a rotation, whose FRF has another unit; choose the "
                "translations by responses and excitations in a mapping"
            )
