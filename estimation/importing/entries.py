"""Entries of an imported FRF matrix, one response and one excitation each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, DegreeOfFreedom, FileFormatError, InputError, Real

from ..frf.frf_matrix import Frf
from .frf_mapping import EntryMapping, FrfMapping
from .units import SI

_SAME_AXIS = 1e-5
"""Relative departure of two frequency axes that are one: headers of UFF files hold six digits."""

_NAMED = 3
"""Missing entries that a message names; of more it says how many."""


@dataclass(frozen=True)
class FrfEntry:
    """One FRF as it was read, in SI units.

    Parameters
    ----------
    response, excitation
        Degrees of freedom, ``node:direction``.
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines.
    values : (n_frequencies,), complex
        Values of the FRF on the lines, in SI units.
    source
        Name of the file and place in it, for messages.
    coherence : (n_frequencies,) or None
        Ordinary coherence of each line, 0 to 1.
    averages
        Number of averages; 0 where it is not known.
    """

    response: str
    excitation: str
    frequencies: Real
    values: Complex
    source: str
    coherence: Real | None = None
    averages: int = 0

    @property
    def name(self) -> str:
        """Name of the entry, ``response / excitation``."""
        return f"{self.response} / {self.excitation}"


@dataclass(frozen=True)
class ImportedFrf:
    """An FRF from another program's files, and what its reader has to say of it.

    Parameters
    ----------
    frf
        The FRF, in SI units.
    inferred
        Facts that the files state by themselves, so that nobody had to write them down; one sentence each.
    doubts
        Facts that the files leave open or that were assumed; one sentence each.
    """

    frf: Frf
    inferred: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def assembled(entries: Sequence[FrfEntry], quantity: str, unit: str) -> Frf:
    """Assemble one FRF matrix of all entries; responses and excitations keep the order in which they first appear.

    A line at which every entry is 0, or 0 Hz with values that are not finite, has no FRF and is not valid.

    Parameters
    ----------
    entries
        One FRF or more, on the same frequency axis.
    quantity, unit
        Quantity and unit of all entries; ``unit`` counts for a ``transfer`` only.

    Raises
    ------
    FileFormatError
        An entry that is given twice or missing, axes that differ, values that are not finite, or no degree of freedom.
    """
    first = entries[0]
    table: dict[tuple[str, str], FrfEntry] = {}
    for entry in entries:
        for label in (entry.response, entry.excitation):
            DegreeOfFreedom.parse(label)
        twin = table.setdefault((entry.response, entry.excitation), entry)
        if twin is not entry:
            raise FileFormatError(f"{entry.source} gives {entry.name} twice, as {twin.source} does; give each FRF once")
        _require_same_axis(first, entry)
    responses = tuple(dict.fromkeys(entry.response for entry in entries))
    excitations = tuple(dict.fromkeys(entry.excitation for entry in entries))
    _require_all(table, responses, excitations, first.source)
    rows = [[table[p, q] for q in excitations] for p in responses]
    values = np.asarray(_stack([[entry.values for entry in row] for row in rows]), dtype=complex)
    valid = values.any(axis=(1, 2)) & ~_without_line_at_zero(first.frequencies, values)
    _require_finite(entries, valid)
    averages = np.array([[entry.averages for entry in row] for row in rows], dtype=np.int64)
    return Frf(
        first.frequencies,
        np.where(valid[:, None, None], values, 0),
        responses,
        excitations,
        quantity,
        SI.get(quantity, unit),
        valid,
        coherence=_coherence(rows, len(first.frequencies)),
        averages=averages if averages.any() else None,
    )


def _require_same_axis(first: FrfEntry, entry: FrfEntry) -> None:
    one, other = first.frequencies, entry.frequencies
    if len(one) == len(other) and np.allclose(one, other, rtol=_SAME_AXIS, atol=1e-9):
        return
    raise FileFormatError(
        f"{entry.source}: {entry.name} has {_axis(other)}, {first.name} in {first.source} has {_axis(one)}; export all "
        "FRFs on one frequency axis"
    )


def _axis(f: Real) -> str:
    return f"{len(f)} lines from {f[0]:g} to {f[-1]:g} Hz" if len(f) else "no line"


def _require_all(
    table: dict[tuple[str, str], FrfEntry], responses: Sequence[str], excitations: Sequence[str], source: str
) -> None:
    missing = [f"{p} / {q}" for q in excitations for p in responses if (p, q) not in table]
    if not missing:
        return
    more = f" and {len(missing) - _NAMED} more" if len(missing) > _NAMED else ""
    raise FileFormatError(
        f"{source}: the matrix of {len(responses)} responses and {len(excitations)} excitations lacks "
        f"{', '.join(missing[:_NAMED])}{more}; export all of it, or choose responses and excitations in a mapping"
    )


def _without_line_at_zero(f: Real, values: Complex) -> NDArray[np.bool_]:
    """Drop a value at 0 Hz that is not finite: analysers divide 0 by 0 there, so it is no damage."""
    return np.asarray((f == 0) & ~np.isfinite(values).all(axis=(1, 2)))


def _require_finite(entries: Sequence[FrfEntry], valid: NDArray[np.bool_]) -> None:
    for entry in entries:
        wrong = np.flatnonzero(valid & ~np.isfinite(entry.values))
        if len(wrong):
            raise FileFormatError(
                f"{entry.source}: {entry.name} holds {entry.values[wrong[0]].real:g} at "
                f"{entry.frequencies[wrong[0]]:g} Hz; mend or cut that line before converting"
            )


def _coherence(rows: Sequence[Sequence[FrfEntry]], n_lines: int) -> Real | None:
    """NaN for entries without one; None where no entry has one."""
    unknown = np.full(n_lines, np.nan)
    given = [[entry.coherence for entry in row] for row in rows]
    if all(one is None for row in given for one in row):
        return None
    return np.asarray(_stack([[unknown if one is None else one for one in row] for row in given]), dtype=float)


def _stack(rows: Sequence[Sequence[NDArray[np.inexact]]]) -> NDArray[np.inexact]:
    """(n_frequencies, n_responses, n_excitations)."""
    return np.ascontiguousarray(np.array(rows).transpose(2, 0, 1))


Places = Mapping[str, int | str]


@dataclass(frozen=True)
class OneFrf:
    """An entry of a mapping with one response, one excitation and one place for each part.

    Parameters
    ----------
    response, excitation
        Degrees of freedom, ``node:direction``.
    given
        Places of those parts that the entry names, by part.
    file, record, averages
        Name of the file, place of its data set and number of averages, as in an `EntryMapping`.
    """

    response: str
    excitation: str
    given: Places = field(default_factory=dict)
    file: str | None = None
    record: int | None = None
    averages: int | None = None


def single_frfs(mapping: FrfMapping) -> tuple[OneFrf, ...]:
    """All FRFs that a mapping names; empty where it names none.

    Parts that are lists under ``[frf]`` run along its responses, for each entry that has an excitation only; along its
    excitations, for each entry that has a response only; without entries along whichever has several.

    Raises
    ------
    InputError
        Lists of different lengths, or an entry of which response and excitation are not known.
    """
    entries = mapping.entries or ((_implied(mapping),) if mapping.frf.listed else ())
    return tuple(one for number, entry in enumerate(entries, 1) for one in _of_entry(mapping, entry, number))


def _implied(mapping: FrfMapping) -> EntryMapping:
    """Give the end that is the same for all FRFs of a list, where the mapping has no entries."""
    table = mapping.frf
    if len(table.excitations) == 1:
        return EntryMapping(excitation=table.excitations[0])
    if len(table.responses) == 1:
        return EntryMapping(response=table.responses[0])
    raise InputError(
        "parts under [frf] are lists, but there are several responses and several excitations, or none; name one of "
        "either there, or give entries"
    )


def _of_entry(mapping: FrfMapping, entry: EntryMapping, number: int) -> list[OneFrf]:
    """FRFs of one entry."""
    lists = {**mapping.frf.listed, **entry.listed}
    if entry.response is not None and entry.excitation is not None:
        return [OneFrf(entry.response, entry.excitation, entry.given, entry.file, entry.record, entry.averages)]
    if entry.response is None and entry.excitation is None:
        raise InputError(f"entries[{number}] names neither response nor excitation; give both, or one and a list")
    along = "responses" if entry.response is None else "excitations"
    labels: tuple[str, ...] = getattr(mapping.frf, along)
    lengths = {along: len(labels), **{name: len(places) for name, places in lists.items()}}
    if not lists or len(set(lengths.values())) > 1:
        said = ", ".join(f"{length} {name}" for name, length in lengths.items())
        raise InputError(
            f"entries[{number}] has no {along.removesuffix('s')}: give it, or under [frf] {along} and lists of as many "
            f"values, real, imaginary ... (there are {said})"
        )
    found = []
    for k, label in enumerate(labels):
        given = {name: places[k] for name, places in lists.items()} | entry.given
        ends = (entry.response or label, entry.excitation or label)
        found.append(OneFrf(*ends, given, entry.file, entry.record, entry.averages))
    return found
