"""FRF files: HDF5 of format ``millfrf.frf``, and data set 58 of the Universal File Format."""

import io
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquisition import UFF_AXES
from millfrf.core import FileFormatError, InputError, Real, conversion_advice, writing_whole_file
from millfrf.core.content_hashes import HASH, require_unedited
from millfrf.core.hdf5_files import hdf5_digest, hdf5_state, require_backed

from .frf_matrix import Frf, FrfCovariance

FORMAT, FORMAT_VERSION = "millfrf.frf", 1
# entries that were not measured: a program of version 1 would take their zeros for measurements
_VERSION_OF_BLOCKS = 2
# errors that all lines share: a program of an earlier version would give error bars without them
_VERSION_OF_COMMON_ERRORS = 3
# attributes and data sets that are left out where an FRF does not have them
_ATTRIBUTES = {
    "band_hz": "band",
    "exponential_time_constant_s": "exponential_time_constant",
    "spectral_width_hz": "spectral_width",
}
_ARRAYS: dict[str, type] = {
    "multiple_coherence": float,
    "coherence": float,
    "averages": np.int64,
    "measured": np.bool_,
    "common_errors": complex,
}


def write_frf(path: str | os.PathLike[str], frf: Frf, *, title: str = "", provenance: str = "") -> None:
    """Write an FRF to an HDF5 file, whole or not at all.

    Root attributes ``format, format_version, title, provenance, quantity, unit, responses, excitations`` (JSON
    lists), and where known ``band_hz`` (two numbers), ``exponential_time_constant_s`` and ``spectral_width_hz``;
    datasets ``frequencies`` (Hz), ``values`` (complex), ``valid``, and where known ``multiple_coherence``,
    ``covariance/response``, ``covariance/excitation``, ``coherence`` (of each entry) and ``averages`` (of each entry).
    ``measured`` (of each entry) is there where entries were not measured; the ``format_version`` is then 2.
    ``common_errors`` holds errors that all lines share; the ``format_version`` is then 3.
    ``content_sha256`` is the hash of all of these.

    Parameters
    ----------
    path
        File to write.
    frf
        FRF to write.
    title, provenance
        Title of the FRF, and how it was made, as text.

    Raises
    ------
    InputError
        The folder cannot be written to.
    DiskFull
        The disk has no space left.
    """
    # The file is made in memory. On a full disk the HDF5 library loses a table when it is closed, reports nothing, and
    # crashes the program at its end; writing plain bytes raises an error.
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        version = FORMAT_VERSION if frf.measured is None else _VERSION_OF_BLOCKS
        version = version if frf.common_errors is None else _VERSION_OF_COMMON_ERRORS
        file.attrs.update({"format": FORMAT, "format_version": version, "title": title})
        file.attrs.update({"provenance": provenance, "quantity": frf.quantity, "unit": frf.unit})
        file.attrs["responses"] = json.dumps(list(frf.responses))
        file.attrs["excitations"] = json.dumps(list(frf.excitations))
        for name in ("frequencies", "values", "valid"):
            file[name] = getattr(frf, name)
        for name, attribute in _ATTRIBUTES.items():
            if getattr(frf, attribute) is not None:
                file.attrs[name] = getattr(frf, attribute)
        for name in _ARRAYS:
            if getattr(frf, name) is not None:
                file[name] = getattr(frf, name)
        if frf.covariance is not None:
            file["covariance/response"] = frf.covariance.response
            file["covariance/excitation"] = frf.covariance.excitation
        file.attrs[HASH] = hdf5_digest(file)
    with writing_whole_file(path) as temporary:
        temporary.write_bytes(memory.getvalue())


def read_frf(path: str | os.PathLike[str]) -> Frf:
    """Read an FRF that :func:`write_frf` wrote.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        Not HDF5, edited after it was written, another format or version, a missing field, or shapes that disagree.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        if advice := conversion_advice(path):
            raise FileFormatError(f"{path} is a file of another program; {advice}") from error
        raise FileFormatError(f"{path} is not an HDF5 file or is damaged; give an FRF file made here") from error
    with file:
        try:
            _check_format(file.attrs, path)
            require_backed(file, path)
            require_unedited(path, hdf5_state(file))
            return _frf_in(file)
        except FileFormatError:
            raise
        except (KeyError, TypeError, ValueError, AttributeError, OSError, RuntimeError) as error:
            raise FileFormatError(f"{path}: a field is missing or damaged ({error}); estimate anew") from error
        except InputError as error:
            raise FileFormatError(f"{path}: {error}") from error


def _check_format(attributes: Any, path: object) -> None:
    name = attributes.get("format", "not given")
    if name != FORMAT:
        raise FileFormatError(f"{path} is no FRF: its format is {name!r}, expected {FORMAT!r}; run estimate first")
    version = attributes.get("format_version")
    if version is None or not FORMAT_VERSION <= int(version) <= _VERSION_OF_COMMON_ERRORS:
        raise FileFormatError(
            f"{path} has format_version {version}, this program reads {FORMAT_VERSION} to {_VERSION_OF_COMMON_ERRORS}; "
            "use the program that wrote it"
        )


def _frf_in(file: h5py.File) -> Frf:
    time_constant, width = (file.attrs.get(name) for name in ("exponential_time_constant_s", "spectral_width_hz"))
    arrays: list[Any] = [
        np.asarray(file[name][:], dtype=kind) if name in file else None for name, kind in _ARRAYS.items()
    ]
    multiple_coherence, coherence, averages, measured, common_errors = arrays
    return Frf(
        np.asarray(file["frequencies"][:], dtype=float),
        np.asarray(file["values"][:], dtype=complex),
        tuple(json.loads(file.attrs["responses"])),
        tuple(json.loads(file.attrs["excitations"])),
        str(file.attrs["quantity"]),
        str(file.attrs["unit"]),
        np.asarray(file["valid"][:], dtype=bool),
        multiple_coherence,
        FrfCovariance(*(file[f"covariance/{f}"][:] for f in ("response", "excitation")))
        if "covariance" in file
        else None,
        tuple(file.attrs["band_hz"]) if "band_hz" in file.attrs else None,
        coherence,
        averages,
        None if time_constant is None else float(time_constant),
        None if width is None else float(width),
        measured,
        common_errors,
    )


# numbers of the Universal File Format
_FRF, _COHERENCE, _MULTIPLE_COHERENCE = 4, 6, 26  # function types
_HERTZ, _FORCE = 18, 13
_DATA_TYPES = {"receptance": 8, "mobility": 11, "accelerance": 12}
_REAL, _COMPLEX = 4, 6  # ordinate data types, both of double precision
_DIRECTIONS = {sign + axis: value * n for sign, value in (("+", 1), ("-", -1)) for n, axis in enumerate(UFF_AXES)}
_NO_REFERENCE = "NONE:+S"


@dataclass(frozen=True)
class _Function:
    """One data set 58: function type, labels, degrees of freedom, and samples (n_frequencies,)."""

    kind: int
    label: str
    unit: str
    response: str
    excitation: str
    samples: NDArray[np.inexact]


def write_frf_uff(path: str | os.PathLike[str], frf: Frf, *, binary: bool = True) -> None:
    """Write an FRF with a UFF data set 58 (58b where ``binary``) for each entry, in double precision and SI units.

    Nodes whose names are whole numbers keep them; others get free numbers (:func:`uff_node_numbers`), and their names
    are written to the entity fields. Coherences follow as functions of type 6, multiple ones as type 26. Lines without
    an FRF are written as 0, entries that were not measured not at all. The format cannot hold covariance and averages.

    Parameters
    ----------
    path
        File to write, ``.uff`` or ``.unv``.
    frf
        Any quantity; a ``transfer`` keeps its unit as a label.
    binary
        Binary data records instead of text.

    Raises
    ------
    InputError
        Another suffix, a node's name longer than the 10 characters of the format, or values taken with an exponential
        window, which the format cannot describe.
    """
    if Path(path).suffix.lower() not in (".uff", ".unv"):
        raise InputError(f"cannot write {path}: UFF files end in .uff or .unv; change the suffix")
    nodes = uff_node_numbers([dof.partition(":")[0] for dof in (*frf.responses, *frf.excitations)])
    long = [name for name in nodes if len(name) > 10]
    if long:
        raise InputError(f"node name {long[0]!r} is longer than the 10 characters of a UFF file; shorten it")
    if frf.exponential_time_constant is not None:
        raise InputError(
            f"the FRF holds the damping of an exponential window ({frf.exponential_time_constant:g} s), which UFF "
            "cannot state; keep the .h5 file, or fit it and write the modes"
        )
    with writing_whole_file(path) as temporary, temporary.open("wb") as file:
        for function in _functions(frf):
            file.write(_data_set(frf.frequencies, function, nodes, binary))


def uff_node_numbers(names: Sequence[str]) -> dict[str, int]:
    """Number each node for a UFF file: by its name where that is a whole number above 0, else by the next free number.

    Examples
    --------
    >>> uff_node_numbers(["12", "TCP", "1", "TCP", "HOUSING"])
    {'12': 12, 'TCP': 2, '1': 1, 'HOUSING': 3}
    """
    distinct = list(dict.fromkeys(names))
    numbers = {name: int(name) for name in distinct if is_uff_number(name)}
    free = (number for number in range(1, 2 * len(distinct) + 1) if number not in numbers.values())
    return {name: numbers[name] if name in numbers else next(free) for name in distinct}


def is_uff_number(name: str) -> bool:
    """Return whether a node's name is a whole number that a UFF file can hold, written without leading zeros."""
    return name.isascii() and name.isdigit() and str(int(name)) == name and 0 < int(name) < 10**10


def _functions(frf: Frf) -> Iterator[_Function]:
    for p, response in enumerate(frf.responses):
        for q, excitation in enumerate(frf.excitations):
            if frf.measured is not None and not frf.measured[p, q]:
                continue
            values = np.where(frf.valid, frf.values[:, p, q], 0)
            yield _Function(_FRF, frf.quantity, frf.unit, response, excitation, values)
            # the format has no mark for values that are not known
            if frf.coherence is not None and np.isfinite(frf.coherence[frf.valid, p, q]).all():
                coherence = np.nan_to_num(frf.coherence[:, p, q])
                yield _Function(_COHERENCE, "coherence", "NONE", response, excitation, coherence)
    if frf.multiple_coherence is not None:
        for response, coherence in zip(frf.responses, np.nan_to_num(frf.multiple_coherence).T, strict=True):
            yield _Function(_MULTIPLE_COHERENCE, "multiple_coherence", "NONE", response, _NO_REFERENCE, coherence)


def _data_set(f: Real, function: _Function, nodes: Mapping[str, int], binary: bool) -> bytes:
    """Return one data set 58 as bytes: eleven lines of header, then the samples."""
    step = f[1] - f[0] if len(f) > 1 else 0.0
    # the header has six digits: frequencies that it cannot repeat exactly are written with the values
    even = np.allclose(float(f"{f[0]:.5e}") + float(f"{step:.5e}") * np.arange(len(f)), f, rtol=1e-12, atol=0)
    values = function.samples
    columns = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    samples = np.column_stack(columns if even else [f, *columns]).astype("<f8")
    kind = (
        f"    58b     1     2          11{samples.nbytes:12d}     0     0           0           0"
        if binary
        else "    58"
    )
    lines = ["    -1", kind, *_header(f, step if even else None, function, nodes)]
    header = "".join(f"{line:<80s}\n" for line in lines).encode("ascii", "replace")
    if binary:
        return header + samples.tobytes() + b"\n    -1\n"
    # the format has 13 characters for a frequency and 20 for a value
    formats = ["{:20.11e}"] * len(columns) if even else ["{:13.7e}", *["{:20.11e}"] * len(columns)]
    row = "".join(formats) + "\n"
    return header + "".join(row.format(*numbers) for numbers in samples).encode("ascii") + b"    -1\n"


def _header(f: Real, step: float | None, function: _Function, nodes: Mapping[str, int]) -> tuple[str, ...]:
    force = function.kind == _FRF and function.label in _DATA_TYPES
    kind = _COMPLEX if np.iscomplexobj(function.samples) else _REAL
    ends = f"{_end(function.response, nodes)} {_end(function.excitation, nodes)}"
    start, spacing = (f[0], step) if step is not None else (0.0, 0.0)
    return (
        f"{function.label} {function.response} / {function.excitation}",
        *["NONE"] * 4,
        f"{function.kind:5d}{0:10d}{0:5d}{0:10d} {ends}",
        f"{kind:10d}{len(f):10d}{int(step is not None):10d}{start:13.5e}{spacing:13.5e}{0:13.5e}",
        _axis(_HERTZ, "Frequency", "Hz"),
        _axis(_DATA_TYPES.get(function.label, 0), function.label, function.unit),
        _axis(_FORCE, "Force", "N") if force else _axis(0, "NONE", "NONE"),
        _axis(0, "NONE", "NONE"),
    )


def _end(dof: str, nodes: Mapping[str, int]) -> str:
    if dof == _NO_REFERENCE:
        return f"{'NONE':>10s}{0:10d}{0:4d}"
    node, direction = dof.split(":")
    return f"{'NONE' if is_uff_number(node) else node:>10s}{nodes[node]:10d}{_DIRECTIONS[direction]:4d}"


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit:<20s}"
