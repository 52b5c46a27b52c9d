"""Files with FRFs as columns or arrays, and their numbers as complex values over Hz."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import SHEET_SUFFIXES, TEXT_SUFFIXES, TextOptions, TextTable, open_arrays
from millfrf.core import Complex, FileFormatError, InputError, Real, listed

from .frf_mapping import FrfTable

ARRAY_SUFFIXES = (".npz", ".npy", ".mat", ".h5", ".hdf5")
# names of numbers from which evenly spaced frequencies follow
_STEPS = re.compile(r"^df$|delta|step|incr|resol|start|end|min|max|^f", re.IGNORECASE)
_COLUMN = re.compile(r"(?P<name>.+)\[(?P<column>\d+)\]")


# words of headings, in English and German
_ROLES = {
    "frequency": r"freq\w*",
    "real": r"re|real\w*",
    "imaginary": r"im|imag\w*",
    "magnitude": r"mag\w*|amp\w*|abs|absolute|modulus|betrag",
    "phase": r"phase|phas|phs|arg|angle",
    "coherence": r"coh\w*|gamma2?",
}
_WORD = r"(?:^|[\s_.:,;|(\[-])(?:{})(?:$|[\s_.:,;|(\[)\]-])"


def column_roles(table: TextTable) -> dict[str, int | str]:
    """Find the column, counted from 1, of each part that the headings name with certainty.

    A frequency is certain where one heading names it. The other parts are certain where, in addition, real and
    imaginary part, or magnitude and phase, are named once each.
    """
    columns: dict[str, list[int]] = {role: [] for role in _ROLES}
    for number, heading in enumerate(table.headings, 1):
        for role, words in _ROLES.items():
            if re.search(_WORD.format(words), heading, re.IGNORECASE):
                columns[role].append(number)
    if not columns["frequency"]:
        columns["frequency"] = [k for k, unit in enumerate(table.units, 1) if stated_frequency_unit(unit) is not None]
    named_once: dict[str, int | str] = {role: numbers[0] for role, numbers in columns.items() if len(numbers) == 1}
    for form in (("real", "imaginary"), ("magnitude", "phase")):
        if all(role in named_once for role in ("frequency", *form)):
            return {role: place for role, place in named_once.items() if role in ("frequency", *form, "coherence")}
    return {role: place for role, place in named_once.items() if role == "frequency"}


HERTZ = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "rad/s": 1 / (2 * np.pi), "cpm": 1 / 60, "rpm": 1 / 60}
"""Units of frequencies, in Hz."""

_FREQUENCY_SPELLINGS = {
    **{unit.lower(): unit for unit in HERTZ},
    **dict.fromkeys(("hertz", "1/s", "s^-1", "s-1", "cps", "cycles/s"), "Hz"),
    **dict.fromkeys(("rad/sec", "radians/second", "rad s^-1", "rad*s^-1", "1/s*rad"), "rad/s"),
    **dict.fromkeys(("cycles/min", "1/min", "min^-1", "min-1", "c/min"), "cpm"),
    **dict.fromkeys(("rev/min", "r/min", "u/min"), "rpm"),
}
# endings of names of arrays of frequencies, as regular expressions
_UNITS_OF_NAMES = {
    r"khz$": "kHz",
    r"(^|[^k])hz$": "Hz",
    r"rad_?s$|rad_per_s$": "rad/s",
    r"rpm$": "rpm",
    r"cpm$": "cpm",
    r"^(w|om|omega)$": "w",
    r"^orders?$": "order",
}


def stated_frequency_unit(text: str) -> str | None:
    """Read the unit of a frequency in one of its spellings; None for any other text.

    Examples
    --------
    >>> stated_frequency_unit("HERTZ"), stated_frequency_unit("CPM"), stated_frequency_unit("V")
    ('Hz', 'cpm', None)
    """
    return _FREQUENCY_SPELLINGS.get(text.strip(" []()").lower())


def frequency_unit_of(text: str, source: str, stated: str | None = None) -> str:
    """Return the unit of a frequency axis, from a mapping or from what the file says; Hz where neither says any.

    Parameters
    ----------
    text
        Unit in the file; empty: none.
    source
        Name of the axis, for messages.
    stated
        Unit that a mapping states, which takes precedence.

    Raises
    ------
    InputError
        An axis in orders, in revolutions, or in an unknown unit, of which a mapping says nothing.
    """
    if stated is not None:
        return stated
    known = stated_frequency_unit(text)
    if known == "rpm":
        raise InputError(
            f'{source} is in {text!r}: if one rpm is 1/60 Hz there, write frequency_unit = "rpm" under [frf] of a '
            "mapping; of a run-up, export the FRF over frequency"
        )
    if known is not None or not text.strip():
        return known or "Hz"
    doubt = f"in {text!r}, which is no unit of frequency that is known here"
    likely, doubt = ("rad/s", "named like an angular frequency") if text == "w" else ("Hz", doubt)
    raise InputError(
        f'{source} is {doubt}; write frequency_unit = "{likely}" (or '
        f"{', '.join(unit for unit in HERTZ if unit != likely)}) under [frf] of a mapping, or export it over Hz"
    )


def stated_phase_unit(text: str) -> str | None:
    """Read ``deg`` or ``rad`` from a column's unit; None for any other text."""
    spellings = {"deg": ("deg", "degree", "degrees", "°"), "rad": ("rad", "radian")}
    return next((unit for unit, words in spellings.items() if text.strip().lower() in words), None)


def shape_text(shape: tuple[int, ...]) -> str:
    """Write the shape of an array for messages, ``400 x 6 x 2``."""
    return " x ".join(map(str, shape))


def complex_values(parts: Mapping[str, NDArray[np.generic]], table: FrfTable, path: Path) -> Complex:
    """Return the complex values of the FRF for ``exp(+i w t)``, in the unit of the file, from the arrays of its parts.

    The parts are ``values``, or ``real`` and ``imaginary``, or ``magnitude`` and ``phase``.
    """
    shapes = {name: array.shape for name, array in parts.items()}
    if len(set(shapes.values())) > 1:
        text = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise InputError(f"{path}: parts of the FRF have different shapes ({text}); name parts that belong together")
    if "values" in parts:
        values = np.asarray(parts["values"], dtype=np.complex128)
    elif "real" in parts:
        values = np.asarray(parts["real"], dtype=float) + 1j * np.asarray(parts["imaginary"], dtype=float)
    else:
        values = _polar(np.asarray(parts["magnitude"], float), np.asarray(parts["phase"], float), table, path)
    return np.asarray(values.conj() if table.conjugate else values)


def _polar(magnitude: Real, phase: Real, table: FrfTable, path: Path) -> Complex:
    if table.phase_unit is None:
        raise InputError(f'{path}: the unit of the phase is not stated; write phase_unit = "deg" or "rad" under [frf]')
    size = 10 ** (magnitude / 20) if table.decibels else magnitude
    if not table.decibels and (size < 0).any():
        raise InputError(f"{path}: a magnitude is {size.min():g}; if it is in dB, write decibels = true under [frf]")
    angle = np.radians(phase) if table.phase_unit == "deg" else phase
    return np.asarray(size * np.exp(1j * angle))


def hertz(frequencies: NDArray[np.generic], unit: str | None, path: Path) -> Real:
    """Convert frequencies (n_frequencies,) to Hz; refuse values that are not finite or do not increase."""
    if np.iscomplexobj(frequencies) and not np.imag(frequencies).any():
        frequencies = np.real(frequencies)  # MATLAB stores frequencies in one matrix with complex values as complex
    if np.iscomplexobj(frequencies):
        raise InputError(f"{path}: the frequencies are complex numbers; name the array or column of frequencies")
    f = np.asarray(frequencies, dtype=float).reshape(-1) * HERTZ[unit or "Hz"]
    if not len(f) or not np.isfinite(f).all():
        raise InputError(f"{path}: frequencies are missing or not finite; correct the file")
    if (np.diff(f) <= 0).any():
        line = int(np.argmax(np.diff(f) <= 0))
        raise InputError(
            f"{path}: frequencies do not increase ({f[line]:g} Hz is followed by {f[line + 1]:g} Hz); name the right "
            "column or array, or sort the lines"
        )
    return f


@dataclass(frozen=True)
class TextSource:
    """Columns of a text file."""

    path: Path
    table: TextTable

    def array(self, place: int | str, part: str) -> NDArray[Any]:
        """Return a column (n_rows,)."""
        return np.asarray(self.table.values[:, self.table.column(place, part)])

    def roles(self) -> dict[str, int | str]:
        """Return the columns of the parts that the headings name."""
        return column_roles(self.table)

    def unit(self, place: int | str) -> str:
        """Return the unit in the heading or in the line below it; empty where none is stated."""
        return self.table.units[self.table.column(place, "unit")]

    def contents(self) -> str:
        """List the columns of the file, for messages."""
        return f"columns {self.table.columns_text()}"


@dataclass(frozen=True)
class ArraySource:
    """Named arrays of numbers of a MAT, NPZ, NPY or HDF5 file."""

    path: Path
    arrays: dict[str, NDArray[Any]] = field(repr=False)

    def array(self, place: int | str, part: str) -> NDArray[Any]:
        """Return an array of any shape; ``H[2]`` is the second column of H."""
        if str(place) in self.arrays:
            return self.arrays[str(place)]
        match = _COLUMN.fullmatch(str(place))
        array = None if match is None else self.arrays.get(match["name"])
        if match is None or array is None:
            raise InputError(f"{self.path}: {part} = {place!r} is no array of it; it has {self.contents()}")
        number = int(match["column"])
        if array.ndim != 2 or not 1 <= number <= array.shape[1]:
            raise InputError(
                f"{self.path}: {part} = {place!r}: {match['name']} is {shape_text(array.shape)} and has no column "
                f"{number}"
            )
        return np.asarray(array[:, number - 1])

    def roles(self) -> dict[str, int | str]:
        """Find the only array that can be the frequencies, and the only complex array.

        Frequencies are an increasing list that is as long as an axis of another array.
        """
        axes = [
            name
            for name, array in self.arrays.items()
            if _is_axis(array) and any(array.size in other.shape for key, other in self.arrays.items() if key != name)
        ]
        values = [name for name, array in self.arrays.items() if np.iscomplexobj(array) and array.size > 1]
        return {part: names[0] for part, names in (("frequency", axes), ("values", values)) if len(names) == 1}

    def steps(self) -> str:
        """Return the numbers that may be the distance or start of evenly spaced lines, as a hint; empty where none is.

        A file needs such a hint if no array lists its frequencies.
        """
        if any(_is_axis(array) for array in self.arrays.values()):
            return ""
        numbers = {name: array.reshape(-1)[0] for name, array in self.arrays.items() if array.size == 1}
        likely = {name: number for name, number in numbers.items() if _STEPS.search(name.rpartition(".")[2])}
        return ", ".join(f"{name} = {number:.10g}" for name, number in (likely or numbers).items() if np.isreal(number))

    def unit(self, place: int | str) -> str:
        """Return the unit of a rate in the name of an array, as in ``f_kHz`` or ``w``; such files state no other."""
        name = str(place).rpartition(".")[2].lower()
        return next((unit for ending, unit in _UNITS_OF_NAMES.items() if re.search(ending, name)), "")

    def contents(self) -> str:
        """List the arrays of the file with their shapes, for messages."""
        listable = {name: array for name, array in self.arrays.items() if array.size > 1} or self.arrays
        arrays = [
            f"{name} {shape_text(array.shape)}{' complex' if np.iscomplexobj(array) else ''}"
            for name, array in listable.items()
        ]
        return f"arrays {listed(arrays, 12) or 'none'}"


FrfSource = TextSource | ArraySource


def _is_axis(array: NDArray[Any]) -> bool:
    """Return whether an array is a list of two or more increasing real numbers, none below 0."""
    row = array.reshape(-1)
    if np.iscomplexobj(array) or row.size < 2 or max(array.shape) != row.size or not np.isfinite(row).all():
        return False
    return bool((np.diff(row.astype(float)) > 0).all() and row[0] >= 0)


def open_source(path: Path, options: TextOptions | None = None) -> FrfSource:
    """Open a text, MAT (any version), NPZ, NPY or HDF5 file, chosen by its suffix."""
    suffix = path.suffix.lower()
    if suffix not in (*TEXT_SUFFIXES, *SHEET_SUFFIXES, *ARRAY_SUFFIXES):
        known = ", ".join((*TEXT_SUFFIXES, *SHEET_SUFFIXES, *ARRAY_SUFFIXES, ".uff", ".unv"))
        raise InputError(f"cannot read FRFs from {path.name}: suffix {path.suffix!r}; use one of {known}")
    file = open_arrays(path, options)
    if file.table is not None:
        return TextSource(path, file.table)
    arrays = {name: np.asarray(value) for name, value in file.fields.items() if _is_numeric(value)}
    if not arrays:
        raise FileFormatError(f"{path} holds no array of numbers; save frequencies and FRFs as arrays")
    return ArraySource(path, arrays)


def _is_numeric(value: Any) -> bool:
    return not isinstance(value, str) and np.asarray(value).dtype.kind in "fiuc" and np.asarray(value).size > 0
