"""FRFs as separate columns or arrays, in one file or several."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from .entries import FrfEntry
from .frf_mapping import PARTS, FrfMapping, FrfTable, SingleFrf, single_frfs
from .sources import FrfSource, TextSource, complex_values, frequency_unit_of, hertz, shape_text, stated_phase_unit
from .units import HOW_TO_STATE, FrfUnit, doubts_of_unit, frf_unit, unit_of_mapping

Places = Mapping[str, int | str]

_VALUES = ("values", "real", "imaginary", "magnitude", "phase")


@dataclass(frozen=True)
class Parts:
    """Places of the parts of one FRF or one matrix in a file, and the rules by which numbers are read."""

    source: FrfSource
    places: Places
    table: FrfTable
    unit: FrfUnit
    inferred: tuple[str, ...]
    doubts: tuple[str, ...] = ()

    def frequencies(self, n_lines: int) -> Real:
        """Return the frequencies (Hz) of the file, or evenly spaced frequencies for ``n_lines`` lines."""
        if "frequency" in self.places:
            values = self.source.array(self.places["frequency"], "frequency")
            return hertz(values, self.table.frequency_unit, self.source.path)
        step = self.table.frequency_step_hz
        assert step is not None
        return np.asarray(self.table.frequency_start_hz + step * np.arange(n_lines))


def parts_of(source: FrfSource, mapping: FrfMapping, entry: SingleFrf | None = None) -> Parts:
    """Find places, units and signs from the entry, then from ``[frf]``, then from what the file clearly states."""
    entry_places: Places = {} if entry is None else entry.places
    table = mapping.frf
    places = _places(source, table, entry_places)
    stated = {*table.places, *entry_places, *(["frequency"] if table.frequency else [])}
    guessed = [f"{name} = {places[name]}" for name in ("frequency", *PARTS) if name in places and name not in stated]
    inferred = [f"of {source.contents()} taken {', '.join(guessed)}"] if guessed else []
    account = (source.table.account,) if isinstance(source, TextSource) else ()
    table = _with_stated_units(source, places, table)
    if table.frequency_unit not in (None, "Hz"):
        inferred.append(f"frequencies converted from {table.frequency_unit} to Hz")
    if table.unit is not None or table.quantity == "transfer":
        unit = unit_of_mapping(table.quantity, table.unit)
        said = source.unit(next(places[name] for name in _VALUES if name in places))
        doubts = doubts_of_unit(unit, said, source.path.name)
        return Parts(source, places, table, unit, (*inferred, *account), doubts)
    unit, unit_text = _stated_unit(source, places, table)
    return Parts(source, places, table, unit, (*inferred, unit_text, *account))


def _places(source: FrfSource, table: FrfTable, entry_places: Places) -> dict[str, int | str]:
    """Find the place of each part.

    The values of the FRF are taken from the first of entry, table and file that states them.
    """
    file_places = source.roles()
    places: dict[str, int | str] = {}
    for stated in (entry_places, table.places, file_places):
        if not set(places) & set(_VALUES):
            places |= {name: place for name, place in stated.items() if name in _VALUES}
        # a file of several FRFs has headings of several coherences: the coherence found may belong to another entry
        of_other_entry = stated is file_places and set(entry_places) & set(_VALUES)
        if "coherence" in stated and not of_other_entry:
            places.setdefault("coherence", stated["coherence"])
    if table.frequency is not None:
        places["frequency"] = table.frequency
    elif (
        table.frequency_step_hz is None
        and "frequency" in file_places
        and _has_axis_of(source, file_places["frequency"], places)
    ):
        places["frequency"] = file_places["frequency"]
    if not set(places) & set(_VALUES):
        raise InputError(
            f"{source.path}: which of its {source.contents()} is the FRF? Write values (complex), or real and "
            "imaginary, or magnitude and phase under [frf] of a mapping"
        )
    if "frequency" not in places and table.frequency_step_hz is None:
        raise InputError(
            f"{source.path}: which of its {source.contents()} is the frequency? Write frequency, or frequency_step_hz, "
            "under [frf] of a mapping"
        )
    return places


def _has_axis_of(source: FrfSource, place: int | str, places: Places) -> bool:
    """Return whether a list is as long as an axis of the FRF's values."""
    part = next((name for name in _VALUES if name in places), None)
    return part is not None and source.array(place, "frequency").size in source.array(places[part], part).shape


def _with_stated_units(source: FrfSource, places: Places, table: FrfTable) -> FrfTable:
    """Fill in the units of frequency, phase and decibels that the columns state and the table does not."""
    update: dict[str, Any] = {}
    if "frequency" in places:
        said, name = source.unit(places["frequency"]), f"{source.path}: the frequency {places['frequency']!r}"
        update["frequency_unit"] = frequency_unit_of(said, name, table.frequency_unit)
    if table.phase_unit is None and "phase" in places:
        update["phase_unit"] = stated_phase_unit(source.unit(places["phase"]))
    if table.decibels is None and "magnitude" in places:
        update["decibels"] = source.unit(places["magnitude"]).strip().lower() == "db"
    return table.model_copy(update=update)


def _stated_unit(source: FrfSource, places: Places, table: FrfTable) -> tuple[FrfUnit, str]:
    """Return the unit that the file states, and a sentence about it."""
    text = source.unit(next(places[name] for name in ("values", "real", "magnitude") if name in places))
    if not text or table.decibels:
        state = "in decibels of no stated unit" if table.decibels else "in no stated unit"
        raise InputError(f"{source.path}: the FRF is {state}: {HOW_TO_STATE} of a mapping")
    try:
        frf_unit(text)
    except InputError as error:
        raise InputError(
            f"{source.path}: {error}; a unit under [frf] of a mapping takes precedence over the file's"
        ) from error
    unit = unit_of_mapping(table.quantity, text)
    return unit, f"taken as {unit.quantity}, from the unit {text}"


def entries_of(
    sources: Sequence[FrfSource], mapping: FrfMapping
) -> tuple[list[FrfEntry], FrfUnit, tuple[str, ...], tuple[str, ...]]:
    """Read all entries that a mapping lists, in SI units, with their unit, what was inferred and what is doubtful.

    A mapping without entries describes one response and one excitation of the only file.
    """
    entries: list[FrfEntry] = []
    units: dict[str, FrfUnit] = {}
    inferred: dict[str, list[str]] = {}
    doubts: dict[str, None] = {}
    for source, frf in _with_sources(sources, mapping):
        parts = parts_of(source, mapping, frf)
        entries.append(_entry(parts, frf))
        doubts |= dict.fromkeys(parts.doubts)
        units.setdefault(f"{parts.unit.quantity} ({source.path.name})", parts.unit)
        for text in parts.inferred:
            inferred.setdefault(text, []).append(source.path.name)
    if len({unit.quantity for unit in units.values()}) > 1:
        raise InputError(
            f"FRFs of different quantities: {', '.join(sorted(units))}; convert those of one quantity at a time"
        )
    remarks = tuple(f"{_files_text(names)}: {text}" for text, names in inferred.items())
    return entries, next(iter(units.values())), remarks, tuple(doubts)


def _files_text(names: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(names))
    return distinct[0] if len(distinct) == 1 else f"{distinct[0]} and {len(distinct) - 1} more"


def _with_sources(sources: Sequence[FrfSource], mapping: FrfMapping) -> list[tuple[FrfSource, SingleFrf]]:
    """Pair each FRF of a mapping with its file."""
    frfs = single_frfs(mapping)
    by_name = {source.path.name: source for source in sources}
    if len(by_name) < len(sources):
        raise InputError("two input files have the same name; entries name files without folders, so rename one")
    if not frfs:
        return [(sources[0], _only_frf(sources, mapping.frf))]
    if len(sources) > 1 and any(frf.file is None for frf in frfs):
        raise InputError(f'{len(sources)} files are given and an entry names none; write file = "NAME" in each entry')
    absent = [frf.file for frf in frfs if frf.file is not None and frf.file not in by_name]
    if absent:
        raise InputError(
            f"the mapping's entry of file {absent[0]} has no such input; give the file or remove the entry"
        )
    pairs = [(by_name[frf.file] if frf.file else sources[0], frf) for frf in frfs]
    unused = [name for name, source in by_name.items() if not any(source is used for used, _ in pairs)]
    if unused:
        raise InputError(f"no entry of the mapping names the file {unused[0]}; add an entry, or leave the file out")
    return pairs


def _only_frf(sources: Sequence[FrfSource], table: FrfTable) -> SingleFrf:
    if len(sources) == 1 and len(table.responses) == len(table.excitations) == 1:
        return SingleFrf(table.responses[0], table.excitations[0])
    if len(sources) > 1:
        raise InputError(
            f"which of the {len(sources)} files is which FRF? Write for each in a mapping: [[entries]] "
            f'file = "{sources[0].path.name}", response = "1:+Z", excitation = "2:+Z"'
        )
    raise InputError(
        f'{sources[0].path}: of which response and excitation is it? Write responses = ["1:+Z"] and excitations = '
        '["2:+Z"] under [frf] of a mapping, or [[entries]] where it holds several FRFs'
    )


def _entry(parts: Parts, frf: SingleFrf) -> FrfEntry:
    source, table = parts.source, parts.table
    arrays = {name: _column(source, place, name) for name, place in parts.places.items() if name in _VALUES}
    values = complex_values(arrays, table, source.path)
    f = parts.frequencies(len(values))
    if len(f) != len(values):
        raise InputError(f"{source.path}: {len(f)} frequencies but {len(values)} values; name arrays of one length")
    coherence = None
    if "coherence" in parts.places:
        place = parts.places["coherence"]
        percent = 100.0 if source.unit(place).strip() == "%" else 1.0
        coherence = np.asarray(_column(source, place, "coherence"), dtype=float) / percent
        if len(coherence) != len(values):
            raise InputError(
                f"{source.path}: {len(values)} values but {len(coherence)} of coherence; name arrays of one length"
            )
    averages = frf.averages or table.averages or 0
    with np.errstate(invalid="ignore"):  # infinity at 0 Hz, a line that is left out
        values = parts.unit.factor * values
    return FrfEntry(frf.response, frf.excitation, f, values, source.path.name, coherence, averages)


def _column(source: FrfSource, place: int | str, part: str) -> NDArray[Any]:
    """Return an array as (n_lines,); only one of its axes may be longer than 1."""
    array = source.array(place, part)
    if array.ndim > 1 and max(array.shape) != array.size:
        raise InputError(
            f'{source.path}: {part} = "{place}" has the shape {shape_text(array.shape)}; name a column of it, as in '
            f'"{place}[2]", or give axes, responses and excitations under [frf] instead of entries'
        )
    return array.reshape(-1)
