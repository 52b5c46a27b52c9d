"""A file of FRFs as columns or arrays to choose from: what its parts are, where it says so, and their numbers."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition import open_arrays
from foundation import FileFormatError, InputError

from .column_roles import column, column_roles, described
from .frf_mapping import TextOptions
from .text_table import SUFFIXES as TEXT_SUFFIXES
from .text_table import TextTable, read_text_table

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
