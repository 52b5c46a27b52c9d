"""Columns and arrays of a file with FRFs, their roles, and their numbers as complex values over Hz."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition import open_arrays
from millfrf.core import Complex, FileFormatError, InputError, Real

from .frf_mapping import FrfTable, TextOptions
from .text_table import SUFFIXES as TEXT_SUFFIXES
from .text_table import TextTable, read_text_table

_TO_HZ = {"Hz": 1.0, "kHz": 1e3, "rad/s": 1 / (2 * np.pi)}
_SPOKEN_PHASES = {"deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "rad": "rad", "radian": "rad"}
_DECIBEL = 20.0


def complex_values(parts: Mapping[str, NDArray[np.generic]], table: FrfTable, where: str) -> Complex:
    """The FRF's numbers, in the file's unit, for ``exp(+i w t)``.

    Parameters
    ----------
    parts
        Arrays of one shape: ``values``, or ``real`` and ``imaginary``, or ``magnitude`` and ``phase``.
    table
        Unit of the phase, decibels, sign convention.
    where
        File, for messages.

    Raises
    ------
    InputError
        No part, shapes that differ, or a phase whose unit is not said.
    """
    shapes = {name: array.shape for name, array in parts.items()}
    if len(set(shapes.values())) > 1:
        said = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise InputError(f"{where}: parts of the FRF have different shapes ({said}); name parts that belong together")
    if "values" in parts:
        values = np.asarray(parts["values"], dtype=np.complex128)
    elif "real" in parts:
        values = np.asarray(parts["real"], dtype=float) + 1j * np.asarray(parts["imaginary"], dtype=float)
    else:
        values = _polar(np.asarray(parts["magnitude"], float), np.asarray(parts["phase"], float), table, where)
    return np.asarray(values.conj() if table.conjugate else values)


def _polar(magnitude: Real, phase: Real, table: FrfTable, where: str) -> Complex:
    if table.phase_unit is None:
        raise InputError(f'{where}: the unit of the phase is not said; write phase_unit = "deg" or "rad" under [frf]')
    size = 10 ** (magnitude / _DECIBEL) if table.decibels else magnitude
    if not table.decibels and (size < 0).any():
        raise InputError(f"{where}: a magnitude is {size.min():g}; if it is in dB, write decibels = true under [frf]")
    angle = np.radians(phase) if table.phase_unit == "deg" else phase
    return np.asarray(size * np.exp(1j * angle))


def hertz(frequencies: NDArray[np.generic], unit: str | None, where: str) -> Real:
    """Frequencies (n_frequencies,) in Hz.

    Raises
    ------
    InputError
        Complex numbers, or values that are not finite or do not increase.
    """
    if np.iscomplexobj(frequencies) and not np.imag(frequencies).any():
        frequencies = np.real(frequencies)  # MATLAB keeps a list of frequencies beside complex values as complex
    if np.iscomplexobj(frequencies):
        raise InputError(f"{where}: the frequencies are complex numbers; name the array or column of frequencies")
    f = np.asarray(frequencies, dtype=float).reshape(-1) * _TO_HZ[unit or "Hz"]
    if not len(f) or not np.isfinite(f).all():
        raise InputError(f"{where}: frequencies are missing or not finite; mend the file")
    if (np.diff(f) <= 0).any():
        line = int(np.argmax(np.diff(f) <= 0))
        raise InputError(
            f"{where}: frequencies do not increase ({f[line]:g} Hz is followed by {f[line + 1]:g} Hz); name the right "
            "column or array, or sort the lines"
        )
    return f


def stated_frequency_unit(text: str) -> str | None:
    """``Hz``, ``kHz`` or ``rad/s`` from a column's unit; None where it says none of them."""
    return next((unit for unit in _TO_HZ if text.strip().lower() == unit.lower()), None)


def stated_phase_unit(text: str) -> str | None:
    """``deg`` or ``rad`` from a column's unit; None where it says neither."""
    return _SPOKEN_PHASES.get(text.strip().lower()) or None


_ROLES = {
    "frequency": r"freq\w*",
    "real": r"re|real\w*",
    "imaginary": r"im|imag\w*",
    "magnitude": r"mag\w*|amp\w*|abs|absolute|modulus|betrag",
    "phase": r"phase|phas|phs|arg|angle",
    "coherence": r"coh\w*|gamma2?",
}
_WAYS = (("real", "imaginary"), ("magnitude", "phase"))
_WORD = r"(?:^|[\s_.:,;|(\[-])(?:{})(?:$|[\s_.:,;|(\[)\]-])"


def column_roles(table: TextTable) -> dict[str, int]:
    """Find the column, counted from 1, of each part that is certain.

    Certain is a frequency that one heading names, and with it either a real and an imaginary part or a magnitude and a
    phase, each named once, with the coherence.

    Parameters
    ----------
    table
        Table of numbers with headings.
    """
    found: dict[str, list[int]] = {role: [] for role in _ROLES}
    for number, heading in enumerate(table.headings, 1):
        for role, words in _ROLES.items():
            if re.search(_WORD.format(words), heading, re.IGNORECASE):
                found[role].append(number)
    if not found["frequency"]:
        found["frequency"] = [k for k, unit in enumerate(table.units, 1) if stated_frequency_unit(unit) is not None]
    once = {role: places[0] for role, places in found.items() if len(places) == 1}
    for way in _WAYS:
        if all(len(found[role]) == 1 for role in ("frequency", *way)):
            kept = ("frequency", *way, "coherence")
            return {role: place for role, place in once.items() if role in kept}
    return {role: place for role, place in once.items() if role == "frequency"}


def column(table: TextTable, place: int | str, part: str) -> int:
    """A column's number, counted from 0, by its number from 1 or its heading.

    Raises
    ------
    InputError
        No such column, or a heading that several have.
    """
    if isinstance(place, int) and place <= len(table.headings):
        return place - 1
    same = [k for k, heading in enumerate(table.headings) if heading == place]
    if len(same) == 1:
        return same[0]
    raise InputError(f"{table.path}: {part} = {place!r} is no column of it; it has {described(table)}")


def described(table: TextTable) -> str:
    """Columns by number, heading and unit: ``1 Frequency (Hz), 2 Real``."""
    shown = []
    for number, (heading, unit) in enumerate(zip(table.headings, table.units, strict=True), 1):
        told = f"({unit})" if unit and unit not in heading else ""
        shown.append(" ".join(filter(None, (str(number), heading, told))))
    return ", ".join(shown)


def unit_of(table: TextTable, roles: Mapping[str, int | str]) -> str:
    """Unit of the FRF's column: of its complex values, its real part or its magnitude; empty where none is stated."""
    place = next((roles[part] for part in ("values", "real", "magnitude") if part in roles), None)
    return "" if place is None else table.units[column(table, place, "unit")]


ARRAY_SUFFIXES = (".npz", ".npy", ".mat", ".h5", ".hdf5")

_SHOWN = 12
_COLUMN = re.compile(r"(?P<name>.+)\[(?P<column>\d+)\]")


class FrfSource(Protocol):
    """A file from which entries and matrices are read."""

    @property
    def path(self) -> Path:
        """Path of the file."""

    def array(self, place: int | str, part: str) -> NDArray[Any]:
        """The numbers at a place that is named for a part; real or complex."""

    def roles(self) -> dict[str, int | str]:
        """Places by part, where the file leaves no doubt; empty elsewhere."""

    def unit(self, place: int | str) -> str:
        """Unit of what lies at a place; empty where it is not stated."""

    def contents(self) -> str:
        """What there is to choose from, for messages."""


@dataclass(frozen=True)
class TextSource:
    """Columns of a text file."""

    path: Path
    table: TextTable

    def array(self, place: int | str, part: str) -> NDArray[Any]:
        """A column (n_rows,)."""
        return np.asarray(self.table.values[:, column(self.table, place, part)])

    def roles(self) -> dict[str, int | str]:
        """Roles of the columns, by their headings."""
        return dict(column_roles(self.table))

    def unit(self, place: int | str) -> str:
        """From the heading, or the line below it."""
        return self.table.units[column(self.table, place, "unit")]

    def contents(self) -> str:
        """Names of the columns, for messages."""
        return f"columns {described(self.table)}"


@dataclass(frozen=True)
class ArraySource:
    """Named arrays of a MAT, NPZ, NPY or HDF5 file.

    Parameters
    ----------
    path
        Path of the file.
    arrays
        Arrays of numbers, by name.
    """

    path: Path
    arrays: dict[str, NDArray[Any]] = field(repr=False)

    def array(self, place: int | str, part: str) -> NDArray[Any]:
        """An array of any shape; ``H[2]`` is the second column of H."""
        if str(place) in self.arrays:
            return self.arrays[str(place)]
        found = _COLUMN.fullmatch(str(place))
        array = None if found is None else self.arrays.get(found["name"])
        if found is None or array is None:
            raise InputError(f"{self.path}: {part} = {place!r} is no array of it; it has {self.contents()}")
        number = int(found["column"])
        if array.ndim != 2 or not 1 <= number <= array.shape[1]:
            shape = " x ".join(map(str, array.shape))
            raise InputError(f"{self.path}: {part} = {place!r}: {found['name']} is {shape} and has no column {number}")
        return np.asarray(array[:, number - 1])

    def roles(self) -> dict[str, int | str]:
        """By shape: the only increasing list that is as long as an axis of other arrays, and the only complex array."""
        others = {
            name: {n for key, array in self.arrays.items() if key != name for n in array.shape} for name in self.arrays
        }
        axes = [name for name, array in self.arrays.items() if _is_axis(array) and array.size in others[name]]
        values = [name for name, array in self.arrays.items() if np.iscomplexobj(array) and array.size > 1]
        found: dict[str, int | str] = {}
        for part, names in (("frequency", axes), ("values", values)):
            if len(names) == 1:
                found[part] = names[0]
        return found

    def unit(self, place: int | str) -> str:
        """None is stated in such files."""
        return ""

    def contents(self) -> str:
        """Arrays with their shapes."""
        shown = [
            f"{name} {' x '.join(map(str, array.shape))}{' complex' if np.iscomplexobj(array) else ''}"
            for name, array in self.arrays.items()
        ]
        more = f" and {len(shown) - _SHOWN} more" if len(shown) > _SHOWN else ""
        return f"arrays {', '.join(shown[:_SHOWN]) or 'none'}{more}"


def _is_axis(array: NDArray[Any]) -> bool:
    """A list of two or more increasing real numbers, none below 0."""
    row = array.reshape(-1)
    if np.iscomplexobj(array) or row.size < 2 or max(array.shape) != row.size or not np.isfinite(row).all():
        return False
    return bool((np.diff(row.astype(float)) > 0).all() and row[0] >= 0)


def open_source(path: Path, options: TextOptions | None = None) -> FrfSource:
    """Open a file by its suffix.

    Parameters
    ----------
    path
        Text (also packed with gzip), MAT of any version, NPZ, NPY or HDF5.
    options
        How a text is written.

    Raises
    ------
    InputError
        No such file, or another suffix.
    FileFormatError
        A damaged file, or one without numbers.
    """
    suffix = path.suffix.lower()
    if suffix in TEXT_SUFFIXES:
        return TextSource(path, read_text_table(path, options))
    if suffix not in ARRAY_SUFFIXES:
        known = ", ".join((*TEXT_SUFFIXES, *ARRAY_SUFFIXES, ".uff", ".unv"))
        raise InputError(f"cannot read FRFs from {path.name}: suffix {path.suffix!r}; use one of {known}")
    fields = open_arrays(path).fields
    arrays = {name: np.asarray(value) for name, value in fields.items() if _is_numeric(value)}
    if not arrays:
        raise FileFormatError(f"{path} holds no array of numbers; save frequencies and FRFs as arrays")
    return ArraySource(path, arrays)


def _is_numeric(value: Any) -> bool:
    return not isinstance(value, str) and np.asarray(value).dtype.kind in "fiuc" and np.asarray(value).size > 0
