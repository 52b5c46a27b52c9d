"""FRFs as separate columns or arrays, in one file or several."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError

from .entries import FrfEntry, OneFrf, single_frfs
from .frf_mapping import PARTS, FrfMapping, FrfTable
from .sources import FrfSource, complex_values, hertz, stated_frequency_unit, stated_phase_unit
from .units import StatedUnit, frf_unit, given_unit

_VALUES = ("values", "real", "imaginary", "magnitude", "phase")
_ASKED = 'write unit = "m/s^2/N" (or m/N, m/s/N, g/N ...) under [frf]'


@dataclass(frozen=True)
class Parts:
    """Places of the parts of one FRF, and how its numbers are read."""

    source: FrfSource
    places: Mapping[str, int | str]
    table: FrfTable
    unit: StatedUnit
    inferred: tuple[str, ...]


def parts_of(source: FrfSource, mapping: FrfMapping, entry: OneFrf | None = None) -> Parts:
    """Places, units and signs by the entry, by ``[frf]``, and else by what the file says without doubt.

    Raises
    ------
    InputError
        A part, a unit or the quantity that nobody says; the message says what to write.
    """
    seen = source.roles()
    places = _places(source, mapping.frf, entry, seen)
    told = {
        *mapping.frf.given,
        *({} if entry is None else entry.given),
        *(["frequency"] if mapping.frf.frequency else []),
    }
    guessed = [f"{name} = {places[name]}" for name in ("frequency", *PARTS) if name in places and name not in told]
    inferred = [f"of {source.contents()} taken {', '.join(guessed)}"] if guessed else []
    table = _with_stated_units(source, places, mapping.frf)
    unit, said = _unit(source, places, table)
    return Parts(source, places, table, unit, (*inferred, *said))


def _places(
    source: FrfSource, table: FrfTable, entry: OneFrf | None, seen: Mapping[str, int | str]
) -> dict[str, int | str]:
    """Part -> place; the FRF's own numbers from the first of entry, table and file that has them."""
    found: dict[str, int | str] = {}
    for given in ({} if entry is None else entry.given, table.given, seen):
        if not set(found) & set(_VALUES):
            found |= {name: place for name, place in given.items() if name in _VALUES}
        own = entry is not None and set(entry.given) & set(_VALUES)  # a heading's coherence is not that of one of many
        if "coherence" in given and not (own and given is seen):
            found.setdefault("coherence", given["coherence"])
    if table.frequency is not None:
        found["frequency"] = table.frequency
    elif table.frequency_step_hz is None and "frequency" in seen and _fits(source, seen["frequency"], found):
        found["frequency"] = seen["frequency"]
    if not set(found) & set(_VALUES):
        raise InputError(
            f"{source.path}: which of its {source.contents()} is the FRF? Write values (complex), or real and "
            "imaginary, or magnitude and phase under [frf] of a mapping"
        )
    if "frequency" not in found and table.frequency_step_hz is None:
        raise InputError(
            f"{source.path}: which of its {source.contents()} is the frequency? Write frequency, or frequency_step_hz, "
            "under [frf] of a mapping"
        )
    return found


def _fits(source: FrfSource, place: int | str, found: Mapping[str, int | str]) -> bool:
    """Whether a list is as long as an axis of the FRF's own numbers."""
    chosen = next((name for name in _VALUES if name in found), None)
    return chosen is not None and source.array(place, "frequency").size in source.array(found[chosen], chosen).shape


def _with_stated_units(source: FrfSource, places: Mapping[str, int | str], table: FrfTable) -> FrfTable:
    """The table, with units of frequency and phase and decibels as the columns state them, where it says none."""
    update: dict[str, Any] = {}
    if table.frequency_unit is None and "frequency" in places:
        update["frequency_unit"] = stated_frequency_unit(source.unit(places["frequency"]))
    if table.phase_unit is None and "phase" in places:
        update["phase_unit"] = stated_phase_unit(source.unit(places["phase"]))
    if table.decibels is None and "magnitude" in places:
        update["decibels"] = source.unit(places["magnitude"]).strip().lower() == "db"
    return table.model_copy(update=update)


def _unit(source: FrfSource, places: Mapping[str, int | str], table: FrfTable) -> tuple[StatedUnit, tuple[str, ...]]:
    if table.unit is not None or table.quantity == "transfer":
        return given_unit(table.quantity, table.unit), ()
    place = next(places[name] for name in ("values", "real", "magnitude") if name in places)
    stated = source.unit(place)
    if not stated or table.decibels:
        said = "in decibels of no stated unit" if table.decibels else "in no stated unit"
        raise InputError(f"{source.path}: the FRF is {said}: {_ASKED} of a mapping")
    try:
        found = frf_unit(stated)
    except InputError as error:
        raise InputError(f"{source.path}: {error}; a unit under [frf] of a mapping counts for more") from error
    unit = given_unit(table.quantity, stated)
    return unit, (f"taken as {found.quantity}, from the unit {stated}",)


def entries_of(sources: Sequence[FrfSource], mapping: FrfMapping) -> tuple[list[FrfEntry], StatedUnit, tuple[str, ...]]:
    """Read all entries that a mapping lists, in SI units, with what they are and what was inferred.

    Parameters
    ----------
    sources
        The files, opened as sources.
    mapping
        Mapping with an entry for each FRF; without entries it describes one response and one excitation of the only
        file.

    Raises
    ------
    InputError
        Files that no entry names, entries whose file is not there, or parts that nobody says.
    """
    listed = _listed(sources, mapping)
    found: list[FrfEntry] = []
    units: list[StatedUnit] = []
    inferred: dict[str, list[str]] = {}
    for source, entry in listed:
        parts = parts_of(source, mapping, entry)
        found.append(_entry(parts, entry))
        units.append(parts.unit)
        for text in parts.inferred:
            inferred.setdefault(text, []).append(source.path.name)
    if len({unit.quantity for unit in units}) > 1:
        kinds = sorted(
            {f"{unit.quantity} ({source.path.name})" for unit, (source, _) in zip(units, listed, strict=True)}
        )
        raise InputError(f"FRFs of different quantities: {', '.join(kinds)}; convert those of one quantity at a time")
    return found, units[0], tuple(f"{_files(names)}: {text}" for text, names in inferred.items())


def _files(names: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(names))
    return distinct[0] if len(distinct) == 1 else f"{distinct[0]} and {len(distinct) - 1} more"


def _listed(sources: Sequence[FrfSource], mapping: FrfMapping) -> list[tuple[FrfSource, OneFrf]]:
    """Each entry with its file."""
    frfs = single_frfs(mapping)
    by_name = {source.path.name: source for source in sources}
    if len(by_name) < len(sources):
        raise InputError("two input files have the same name; entries name files without folders, so rename one")
    if not frfs:
        return [(sources[0], _only_entry(sources, mapping.frf))]
    if len(sources) > 1 and any(entry.file is None for entry in frfs):
        raise InputError(f'{len(sources)} files are given and an entry names none; write file = "NAME" in each entry')
    absent = [entry.file for entry in frfs if entry.file is not None and entry.file not in by_name]
    if absent:
        raise InputError(
            f"the mapping's entry of file {absent[0]} has no such input; give it too, or take the entry out"
        )
    pairs = [(by_name[entry.file] if entry.file else sources[0], entry) for entry in frfs]
    unused = [name for name, source in by_name.items() if not any(source is used for used, _ in pairs)]
    if unused:
        raise InputError(f"no entry of the mapping names the file {unused[0]}; add an entry, or leave the file out")
    return pairs


def _only_entry(sources: Sequence[FrfSource], table: FrfTable) -> OneFrf:
    if len(sources) == 1 and len(table.responses) == len(table.excitations) == 1:
        return OneFrf(table.responses[0], table.excitations[0])
    name = Path(sources[0].path).name
    if len(sources) > 1:
        raise InputError(
            f"which of the {len(sources)} files is which FRF? Write for each in a mapping: [[entries]] "
            f'file = "{name}", response = "1:+Z", excitation = "2:+Z"'
        )
    raise InputError(
        f'{sources[0].path}: of which response and excitation is it? Write responses = ["1:+Z"] and excitations = '
        '["2:+Z"] under [frf] of a mapping, or [[entries]] where it holds several FRFs'
    )


def _entry(parts: Parts, entry: OneFrf) -> FrfEntry:
    source, table = parts.source, parts.table
    arrays = {name: _column(source, place, name) for name, place in parts.places.items() if name in _VALUES}
    values = complex_values(arrays, table, str(source.path))
    f = frequencies_of(parts, len(values))
    if len(f) != len(values):
        raise InputError(f"{source.path}: {len(f)} frequencies but {len(values)} values; name arrays of one length")
    coherence = _column(source, parts.places["coherence"], "coherence") if "coherence" in parts.places else None
    if coherence is not None and len(coherence) != len(values):
        raise InputError(
            f"{source.path}: {len(values)} values but {len(coherence)} of coherence; name arrays of one length"
        )
    averages = entry.averages or table.averages or 0
    return FrfEntry(
        entry.response, entry.excitation, f, parts.unit.factor * values, source.path.name,
        None if coherence is None else np.asarray(coherence, dtype=float), averages,
    )  # fmt: skip


def frequencies_of(parts: Parts, n_lines: int) -> NDArray[np.float64]:
    """Frequencies (Hz) of the file, or evenly spaced ones for ``n_lines`` lines."""
    if "frequency" in parts.places:
        given = parts.source.array(parts.places["frequency"], "frequency")
        return hertz(given, parts.table.frequency_unit, str(parts.source.path))
    step = parts.table.frequency_step_hz
    assert step is not None
    return np.asarray(parts.table.frequency_start_hz + step * np.arange(n_lines))


def _column(source: FrfSource, place: int | str, part: str) -> NDArray[Any]:
    array = source.array(place, part)
    if array.ndim > 1 and max(array.shape) != array.size:
        shape = " x ".join(map(str, array.shape))
        raise InputError(
            f'{source.path}: {part} = "{place}" has the shape {shape}; name a column of it, as in "{place}[2]", or '
            "give axes, responses and excitations under [frf] instead of entries"
        )
    return array.reshape(-1)
