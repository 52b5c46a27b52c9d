"""`FrfMapping`: which array or column of a file holds which part of an FRF, as a checked TOML file."""

import os
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from acquisition import TextOptions
from millfrf.core import DegreeOfFreedom, InputError, checked_toml

_STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
_RANGE = re.compile(r"(?P<prefix>.*?)(?P<first>\d+)\.\.(?P<last>\d+)(?P<suffix>:.+)")
_LONGEST_RANGE = 100_000  # degrees of freedom; more are a mistyped number

# an array's name, a column's heading, or a column's number counted from 1
Place = Annotated[int, Field(ge=1)] | Annotated[str, Field(min_length=1)]
# one place for each response or each excitation
PlaceList = Annotated[tuple[Place, ...], Field(min_length=1)]
Axis = Literal["frequency", "response", "excitation"]


def expanded(labels: tuple[str, ...]) -> tuple[str, ...]:
    """Write out ranges of numbers in degrees of freedom; raise a ValueError for mistakes, as pydantic needs.

    Examples
    --------
    >>> expanded(("1..3:+Z", "TIP:-X"))
    ('1:+Z', '2:+Z', '3:+Z', 'TIP:-X')
    """
    names: list[str] = []
    for label in labels:
        match = _RANGE.fullmatch(label)
        if match is None:
            names.append(label)
            continue
        first, last = int(match["first"]), int(match["last"])
        if not first <= last < first + _LONGEST_RANGE:
            raise ValueError(f"{label!r} runs from {first} to {last}; give the lower number first")
        names += [f"{match['prefix']}{number}{match['suffix']}" for number in range(first, last + 1)]
    try:
        for name in names:
            DegreeOfFreedom.parse(name)
    except InputError as error:
        raise ValueError(str(error)) from error
    return tuple(names)


Labels = Annotated[tuple[str, ...], AfterValidator(expanded)]
Label = Annotated[str, AfterValidator(lambda label: expanded((label,))[0])]


class FrfParts(BaseModel):
    """Places of the numbers: complex ``values``, or ``real`` and ``imaginary``, or ``magnitude`` and ``phase``.

    Parameters
    ----------
    values
        Complex numbers of the FRF.
    real, imaginary
        Real and imaginary part of the FRF.
    magnitude, phase
        Magnitude and phase of the FRF.
    coherence
        Ordinary coherence of the FRF.
    """

    model_config = _STRICT
    values: Place | PlaceList | None = None
    real: Place | PlaceList | None = None
    imaginary: Place | PlaceList | None = None
    magnitude: Place | PlaceList | None = None
    phase: Place | PlaceList | None = None
    coherence: Place | PlaceList | None = None

    @model_validator(mode="after")
    def _one_form(self) -> "FrfParts":
        for pair in (("real", "imaginary"), ("magnitude", "phase")):
            stated = [name for name in pair if getattr(self, name) is not None]
            if len(stated) == 1:
                raise ValueError(f"{stated[0]} is given alone; give {pair[0]} and {pair[1]}")
        forms = [name for name in ("values", "real", "magnitude") if getattr(self, name) is not None]
        if len(forms) > 1:
            raise ValueError(f"{' and '.join(forms)} are both given; give the FRF in one form")
        return self

    @property
    def places(self) -> dict[str, int | str]:
        """Return the place of each part that has a single place."""
        return {name: place for name in PARTS if isinstance(place := getattr(self, name), int | str)}

    @property
    def place_lists(self) -> dict[str, tuple[int | str, ...]]:
        """Return the places of each part that has a list of places."""
        return {name: places for name in PARTS if isinstance(places := getattr(self, name), tuple)}


PARTS = ("values", "real", "imaginary", "magnitude", "phase", "coherence")


class EntryMapping(FrfParts):
    """One FRF of several.

    Parameters
    ----------
    response
        Degree of freedom of the response, ``node:direction``. It or ``excitation`` may be left out where parts are
        lists: they run along the ``responses`` or ``excitations`` under ``[frf]``.
    excitation
        Degree of freedom of the excitation, likewise.
    file
        Name of the file that holds the FRF; left out: the only one.
    record
        Place of the data set in a UFF file, counted from 1.
    averages
        Number of averages; left out: the number under ``[frf]``.
    values, real, imaginary, magnitude, phase, coherence
        Arrays or columns that hold the numbers; left out: those under ``[frf]``.
    """

    response: Label | None = None
    excitation: Label | None = None
    file: str | None = None
    record: Annotated[int, Field(ge=1)] | None = None
    averages: Annotated[int, Field(ge=1)] | None = None


class FrfTable(FrfParts):
    """The part of a mapping that holds for all FRFs, the table ``[frf]``.

    Parameters
    ----------
    quantity
        Quantity of the FRFs, needed for a ``transfer``; left out: from the unit.
    unit
        Unit of the numbers in the file: ``m/s^2/N``, ``g/N``, ``um/N``; of a ``transfer`` the unit to keep.
    frequency
        Array or column of frequencies, in ``frequency_unit``; or instead ``frequency_step_hz`` of evenly spaced lines
        from ``frequency_start_hz`` on.
    values, real, imaginary, magnitude, phase, coherence
        Arrays or columns; ``H[2]`` is the second column of array H. They may be left out where the
        file or its headings are unambiguous. Lists run along ``responses`` or ``excitations``.
    phase_unit
        Unit of the phases, ``deg`` or ``rad``; left out: from the heading, if it states one.
    decibels
        Whether the magnitude is 20 times the decimal logarithm of the ratio to 1 ``unit``; left out: from the
        heading, else false.
    axes
        Order of the axes of arrays that have several; left out: from their lengths, if only one order fits.
    responses
        Degrees of freedom along the axis of responses, in which ``1..68:+Z`` stands for 68 of them; for a UFF file,
        the responses that are read.
    excitations
        Degrees of freedom along the axis of excitations, likewise.
    conjugate
        Whether the file's phases stand for ``exp(-i w t)``, so that the conjugate is taken.
    averages
        Number of averages behind each FRF.
    exponential_time_constant_s : s
        Time constant of an exponential window on force and response, whose damping is still in the FRF.
    title
        Title of the FRF file that is written.
    frequency_unit
        Unit of the frequencies; left out: the heading or Hz.
    frequency_step_hz : Hz
        Distance of evenly spaced lines.
    frequency_start_hz : Hz
        Frequency of the first of evenly spaced lines.
    """

    quantity: Literal["receptance", "mobility", "accelerance", "transfer"] | None = None
    unit: Annotated[str, Field(min_length=1)] | None = None
    frequency: Place | None = None
    frequency_unit: Literal["Hz", "kHz", "MHz", "rad/s", "cpm", "rpm"] | None = None
    frequency_step_hz: Annotated[float, Field(gt=0)] | None = None
    frequency_start_hz: Annotated[float, Field(ge=0)] = 0.0
    phase_unit: Literal["deg", "rad"] | None = None
    decibels: bool | None = None
    axes: tuple[Axis, ...] | None = None
    responses: Labels = ()
    excitations: Labels = ()
    conjugate: bool = False
    averages: Annotated[int, Field(ge=1)] | None = None
    exponential_time_constant_s: Annotated[float, Field(gt=0)] | None = None
    title: str = ""

    @model_validator(mode="after")
    def _consistent(self) -> "FrfTable":
        if self.frequency is not None and self.frequency_step_hz is not None:
            raise ValueError("give either frequency (an array or column) or frequency_step_hz, one of them")
        if self.axes is not None and (len(set(self.axes)) != len(self.axes) or "frequency" not in self.axes):
            raise ValueError(f"axes = {list(self.axes)} must name each axis once, 'frequency' among them")
        for name in ("responses", "excitations"):
            twice = [label for label, count in Counter(getattr(self, name)).items() if count > 1]
            if twice:
                raise ValueError(f"{name} hold {twice[0]} twice; give each degree of freedom once")
        return self


class FrfMapping(BaseModel):
    """A mapping file: the table ``[frf]``, ``[[entries]]`` for separate FRFs, and ``[csv]`` for texts.

    Parameters
    ----------
    frf
        Options that hold for all FRFs, the table ``[frf]``.
    entries
        Separate FRFs, one table ``[[entries]]`` each.
    csv
        Format of a text file, the table ``[csv]``.
    """

    model_config = _STRICT
    frf: FrfTable = FrfTable()
    entries: tuple[EntryMapping, ...] = ()
    csv: TextOptions = TextOptions()

    @model_validator(mode="after")
    def _axes_or_entries(self) -> "FrfMapping":
        if self.entries and self.frf.axes is not None:
            raise ValueError("axes are those of one array; leave them out where entries are given")
        return self


def is_frf_mapping(content: Mapping[str, Any]) -> bool:
    """Return whether the content of a mapping file describes FRFs, not recordings."""
    return "frf" in content or "entries" in content


def load_frf_mapping(path: str | os.PathLike[str]) -> FrfMapping:
    """Read a mapping file.

    Raises
    ------
    InputError
        No such file, no TOML, or a key that is unknown, missing or out of range; one line with file, key and value.
    """
    return checked_toml(Path(path), FrfMapping, "mapping")


@dataclass(frozen=True)
class SingleFrf:
    """One FRF that a mapping names: one response, one excitation and one place for each part."""

    response: str
    excitation: str
    places: Mapping[str, int | str] = field(default_factory=dict)  # of the parts that the entry names
    file: str | None = None
    record: int | None = None
    averages: int | None = None


def single_frfs(mapping: FrfMapping) -> tuple[SingleFrf, ...]:
    """Return all FRFs that a mapping names; empty where it names none.

    Lists of places under ``[frf]`` run along its responses for each entry that has only an excitation, and along its
    excitations for each entry that has only a response; without entries, along whichever axis has several.
    """
    entries = mapping.entries or ((_entry_of_lists(mapping.frf),) if mapping.frf.place_lists else ())
    return tuple(frf for number, entry in enumerate(entries, 1) for frf in _frfs_of(mapping.frf, entry, number))


def _entry_of_lists(table: FrfTable) -> EntryMapping:
    """Return the entry with the response or excitation that all FRFs of the lists share."""
    if len(table.excitations) == 1:
        return EntryMapping(excitation=table.excitations[0])
    if len(table.responses) == 1:
        return EntryMapping(response=table.responses[0])
    raise InputError(
        "parts under [frf] are lists, but there are several responses and several excitations, or none; name one of "
        "either there, or give entries"
    )


def _frfs_of(table: FrfTable, entry: EntryMapping, number: int) -> list[SingleFrf]:
    if entry.response is not None and entry.excitation is not None:
        return [SingleFrf(entry.response, entry.excitation, entry.places, entry.file, entry.record, entry.averages)]
    if entry.response is None and entry.excitation is None:
        raise InputError(f"entries[{number}] names neither response nor excitation; give both, or one and a list")
    along = "responses" if entry.response is None else "excitations"
    labels: tuple[str, ...] = getattr(table, along)
    lists = {**table.place_lists, **entry.place_lists}
    lengths = {along: len(labels), **{name: len(places) for name, places in lists.items()}}
    if not lists or len(set(lengths.values())) > 1:
        counts = ", ".join(f"{length} {name}" for name, length in lengths.items())
        raise InputError(
            f"entries[{number}] has no {along.removesuffix('s')}: give it, or under [frf] {along} and lists of as many "
            f"values, real, imaginary ... (there are {counts})"
        )
    return [
        SingleFrf(
            entry.response or label,
            entry.excitation or label,
            {name: places[k] for name, places in lists.items()} | entry.places,
            entry.file,
            entry.record,
            entry.averages,
        )
        for k, label in enumerate(labels)
    ]
