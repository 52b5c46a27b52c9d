"""`FrfMapping`: which array or column of a file is which part of an FRF; a TOML file checked where it enters."""

import os
import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from millfrf.core import DegreeOfFreedom, InputError, checked_toml

_STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
_RANGE = re.compile(r"(?P<prefix>.*?)(?P<first>\d+)\.\.(?P<last>\d+)(?P<rest>:.+)")
_MOST = 100_000

Place = Annotated[int, Field(ge=1)] | Annotated[str, Field(min_length=1)]
"""An array's name, a column's heading, or a column's number counted from 1."""

PlaceList = Annotated[tuple[Place, ...], Field(min_length=1)]
"""One place for each response or each excitation."""

Axis = Literal["frequency", "response", "excitation"]


def expanded(labels: tuple[str, ...]) -> tuple[str, ...]:
    """Degrees of freedom with ranges of numbers written out.

    Raises
    ------
    ValueError
        No degree of freedom, or a range that runs backwards.

    Examples
    --------
    >>> expanded(("1..3:+Z", "TIP:-X"))
    ('1:+Z', '2:+Z', '3:+Z', 'TIP:-X')
    """
    found: list[str] = []
    for label in labels:
        match = _RANGE.fullmatch(label)
        if match is None:
            found.append(label)
            continue
        first, last = int(match["first"]), int(match["last"])
        if not first <= last < first + _MOST:
            raise ValueError(f"{label!r} runs from {first} to {last}; give the lower number first")
        found += [f"{match['prefix']}{number}{match['rest']}" for number in range(first, last + 1)]
    try:
        for label in found:
            DegreeOfFreedom.parse(label)
    except InputError as error:
        raise ValueError(str(error)) from error
    return tuple(found)


Labels = Annotated[tuple[str, ...], AfterValidator(expanded)]
Label = Annotated[str, AfterValidator(lambda label: expanded((label,))[0])]


class FrfParts(BaseModel):
    """Places of the numbers: complex ``values``, or ``real`` and ``imaginary``, or ``magnitude`` and ``phase``.

    Parameters
    ----------
    values
        Complex numbers of the FRF.
    real, imaginary
        Its real and imaginary part, instead.
    magnitude, phase
        Its magnitude and phase, instead.
    coherence
        Coherence, where there is one.
    """

    model_config = _STRICT
    values: Place | PlaceList | None = None
    real: Place | PlaceList | None = None
    imaginary: Place | PlaceList | None = None
    magnitude: Place | PlaceList | None = None
    phase: Place | PlaceList | None = None
    coherence: Place | PlaceList | None = None

    @model_validator(mode="after")
    def _one_way(self) -> "FrfParts":
        pairs = {"imaginary": ("real", "imaginary"), "phase": ("magnitude", "phase")}
        for one, other in pairs.values():
            given = [name for name in (one, other) if getattr(self, name) is not None]
            if len(given) == 1:
                raise ValueError(f"{given[0]} is given alone; give {one} and {other}")
        ways = [name for name in ("values", "real", "magnitude") if getattr(self, name) is not None]
        if len(ways) > 1:
            raise ValueError(f"{' and '.join(ways)} are both given; give the FRF in one way")
        return self

    @property
    def given(self) -> dict[str, int | str]:
        """Places by part, of those that are given and no lists."""
        return {name: place for name in PARTS if isinstance(place := getattr(self, name), int | str)}

    @property
    def listed(self) -> dict[str, tuple[int | str, ...]]:
        """Lists of places by part."""
        return {name: places for name in PARTS if isinstance(places := getattr(self, name), tuple)}


PARTS = ("values", "real", "imaginary", "magnitude", "phase", "coherence")


class EntryMapping(FrfParts):
    """Mapping of one FRF of several.

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
        Arrays or columns that hold its numbers; if none is given, those under ``[frf]`` hold.
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
        Quantity of the FRFs; a ``transfer`` needs it, otherwise the unit tells it.
    unit
        Unit of the numbers in the file: ``m/s^2/N``, ``g/N``, ``um/N``; of a ``transfer`` the unit to keep.
    frequency
        Array or column of frequencies, in ``frequency_unit``; or instead ``frequency_step_hz`` of evenly spaced lines
        from ``frequency_start_hz`` on.
    values, real, imaginary, magnitude, phase, coherence
        Arrays or columns; ``H[2]`` is the second column of array H. Where file or headings leave no doubt they may be
        left out. Lists run along ``responses`` or ``excitations``.
    phase_unit
        Unit of the phases, ``deg`` or ``rad``; left out: as the heading says, and needed where it does not.
    decibels
        Whether the magnitude is 20 times the decimal logarithm of the ratio to 1 ``unit``; left out: as the heading
        says, else false.
    axes
        Order of the axes of arrays that have several; left out: by their lengths, where these leave one order.
    responses
        Degrees of freedom along the axis of responses, in which ``1..68:+Z`` stands for 68 of them; for a UFF file,
        those to take.
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
    frequency_unit: Literal["Hz", "kHz", "rad/s"] | None = None
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


class TextOptions(BaseModel):
    """How a text file is written, where it cannot be seen.

    Parameters
    ----------
    delimiter
        Character between columns; left out: seen from the file.
    decimal
        Character of decimals; left out: seen from the file.
    skip_lines
        Number of lines before the headings.
    encoding
        Encoding of the text; left out: seen from the file.
    """

    model_config = _STRICT
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    skip_lines: Annotated[int, Field(ge=0)] = 0
    encoding: str | None = None


class FrfMapping(BaseModel):
    """The whole mapping file: ``[frf]``, ``[[entries]]`` where FRFs lie apart, ``[csv]`` for texts.

    Parameters
    ----------
    frf
        What holds for all FRFs, the table ``[frf]``.
    entries
        FRFs that lie apart, ``[[entries]]``.
    csv
        How a text file is written, the table ``[csv]``.
    """

    model_config = _STRICT
    frf: FrfTable = FrfTable()
    entries: tuple[EntryMapping, ...] = ()
    csv: TextOptions = TextOptions()

    @model_validator(mode="after")
    def _one_kind(self) -> "FrfMapping":
        if self.entries and self.frf.axes is not None:
            raise ValueError("axes are those of one array; leave them out where entries are given")
        return self


def is_frf_mapping(content: Mapping[str, Any]) -> bool:
    """Whether the content of a mapping file is about FRFs, not recordings."""
    return "frf" in content or "entries" in content


def load_frf_mapping(path: str | os.PathLike[str]) -> FrfMapping:
    """Read a mapping file.

    Raises
    ------
    InputError
        No such file, no TOML, or a key that is unknown, missing or out of range; one line with file, key and value.
    """
    return checked_toml(Path(path), FrfMapping, "mapping")
