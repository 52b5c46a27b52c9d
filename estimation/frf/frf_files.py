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

from millfrf.core import FileFormatError, InputError, conversion_advice, writing_whole_file

from .frf_matrix import Frf, FrfCovariance

FORMAT = "millfrf.frf"
FORMAT_VERSION = 1


def write_frf(path: str | os.PathLike[str], frf: Frf, *, title: str = "", provenance: str = "") -> None:
    """Write an FRF whole.

    Root attributes ``format, format_version, title, provenance, quantity, unit, responses, excitations`` (JSON
    lists), and where known ``band_hz`` (two numbers), ``exponential_time_constant_s`` and ``spectral_width_hz``;
    datasets ``frequencies`` (Hz), ``values`` (complex), ``valid``, and where known ``multiple_coherence``,
    ``covariance/response``, ``covariance/excitation``, ``coherence`` (of each entry) and ``averages`` (of each entry).

    Raises
    ------
    InputError
        The folder cannot be written to.
    DiskFull
        No room was left.
    """
    described = {"title": title, "provenance": provenance}
    with writing_whole_file(path) as temporary:
        temporary.write_bytes(_image(frf, described))


def _image(frf: Frf, described: Mapping[str, str]) -> bytes:
    """The file's bytes, made in memory.

    On a full disk the HDF5 library loses a table that is flushed when it is let go, says nothing, and crashes the
    program when it ends; what writes plain bytes is told.
    """
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.attrs.update({"format": FORMAT, "format_version": FORMAT_VERSION, **described})
        file.attrs.update({"quantity": frf.quantity, "unit": frf.unit})
        file.attrs["responses"] = json.dumps(list(frf.responses))
        file.attrs["excitations"] = json.dumps(list(frf.excitations))
        for name in ("frequencies", "values", "valid"):
            file[name] = getattr(frf, name)
        if frf.band is not None:
            file.attrs["band_hz"] = list(frf.band)
        if frf.exponential_time_constant is not None:
            file.attrs["exponential_time_constant_s"] = frf.exponential_time_constant
        if frf.spectral_width is not None:
            file.attrs["spectral_width_hz"] = frf.spectral_width
        for name in ("multiple_coherence", "coherence", "averages"):
            if getattr(frf, name) is not None:
                file[name] = getattr(frf, name)
        if frf.covariance is not None:
            file["covariance/response"] = frf.covariance.response
            file["covariance/excitation"] = frf.covariance.excitation
    return memory.getvalue()


def read_frf(path: str | os.PathLike[str]) -> Frf:
    """Read what :func:`write_frf` wrote.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        Not HDF5, another format or version, a missing field, or shapes that disagree.
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
            _check(file.attrs, path)
            return _read(file)
        except FileFormatError:
            raise
        except (KeyError, TypeError, ValueError, AttributeError, OSError, RuntimeError) as error:
            raise FileFormatError(f"{path}: a field is missing or damaged ({error}); estimate anew") from error
        except InputError as error:
            raise FileFormatError(f"{path}: {error}") from error


def _check(attributes: Any, path: object) -> None:
    found = attributes.get("format", "not given")
    if found != FORMAT:
        raise FileFormatError(f"{path} is no FRF: its format is {found!r}, expected {FORMAT!r}; run estimate first")
    version = attributes.get("format_version")
    if version is None or int(version) != FORMAT_VERSION:
        raise FileFormatError(
            f"{path} has format_version {version}, this program reads {FORMAT_VERSION}; use the program that wrote it"
        )


def _read(file: h5py.File) -> Frf:
    covariance = None
    if "covariance" in file:
        covariance = FrfCovariance(file["covariance/response"][:], file["covariance/excitation"][:])
    time_constant, width = (file.attrs.get(name) for name in ("exponential_time_constant_s", "spectral_width_hz"))
    return Frf(
        np.asarray(file["frequencies"][:], dtype=float),
        np.asarray(file["values"][:], dtype=complex),
        tuple(json.loads(file.attrs["responses"])),
        tuple(json.loads(file.attrs["excitations"])),
        str(file.attrs["quantity"]),
        str(file.attrs["unit"]),
        np.asarray(file["valid"][:], dtype=bool),
        _optional(file, "multiple_coherence", float),
        covariance,
        tuple(file.attrs["band_hz"]) if "band_hz" in file.attrs else None,
        _optional(file, "coherence", float),
        _optional(file, "averages", np.int64),
        None if time_constant is None else float(time_constant),
        None if width is None else float(width),
    )


def _optional(file: h5py.File, name: str, kind: type) -> Any:
    return np.asarray(file[name][:], dtype=kind) if name in file else None


_FRF, _COHERENCE, _MULTIPLE_COHERENCE = 4, 6, 26  # function types
_HERTZ, _FORCE = 18, 13
_DATA_TYPES = {"receptance": 8, "mobility": 11, "accelerance": 12}
_REAL, _COMPLEX = 4, 6  # ordinate data types, both of double precision
_AXES = ("S", "X", "Y", "Z", "RX", "RY", "RZ")
_DIRECTIONS = {sign + axis: value * n for sign, value in (("+", 1), ("-", -1)) for n, axis in enumerate(_AXES)}
_NOWHERE = "NONE:+S"
_LONGEST_NAME, _LARGEST_NODE = 10, 10**10


@dataclass(frozen=True)
class _Function:
    """One data set 58: what it is, of what, and its samples (n_frequencies,)."""

    kind: int
    label: str
    unit: str
    response: str
    excitation: str
    samples: NDArray[np.inexact]


def write_frf_uff(path: str | os.PathLike[str], frf: Frf, *, binary: bool = True) -> None:
    """Write an FRF as one data set 58 (58b where ``binary``) an entry, in double precision and SI units.

    Nodes whose names are whole numbers keep them; others take free ones (:func:`uff_node_numbers`) and are named in
    the entity fields. Coherences follow as functions of type 6, multiple ones as type 26. Lines without an FRF are
    written as 0; covariance and averages have no place in the format.

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
        Another suffix, a node's name longer than the 10 characters the format holds, or values that were taken with an
        exponential window, which the format cannot say.
    """
    if Path(path).suffix.lower() not in (".uff", ".unv"):
        raise InputError(f"cannot write {path}: UFF files end in .uff or .unv; change the suffix")
    names = [dof.partition(":")[0] for dof in (*frf.responses, *frf.excitations)]
    nodes = uff_node_numbers(names)
    long = [name for name in nodes if len(name) > _LONGEST_NAME]
    if long:
        raise InputError(f"node name {long[0]!r} is longer than the 10 characters of a UFF file; shorten it")
    if frf.exponential_time_constant is not None:
        raise InputError(
            f"the FRF holds the damping of an exponential window ({frf.exponential_time_constant:g} s), which UFF "
            "cannot say; keep the .h5 file, or fit it and write the modes"
        )
    with writing_whole_file(path) as temporary, temporary.open("wb") as file:
        for function in _functions(frf):
            file.write(_data_set(frf.frequencies, function, nodes, binary))


def uff_node_numbers(names: Sequence[str]) -> dict[str, int]:
    """Number of each node in a UFF file: its name where that is a whole number above 0, else the next that is free.

    Examples
    --------
    >>> uff_node_numbers(["12", "TCP", "1", "TCP", "HOUSING"])
    {'12': 12, 'TCP': 2, '1': 1, 'HOUSING': 3}
    """
    distinct = list(dict.fromkeys(names))
    kept = {name: int(name) for name in distinct if is_uff_number(name)}
    free = (number for number in range(1, 2 * len(distinct) + 1) if number not in kept.values())
    return {name: kept[name] if name in kept else next(free) for name in distinct}


def is_uff_number(name: str) -> bool:
    """Whether a node's name is a number that a UFF file can hold, written without leading zeros."""
    return name.isascii() and name.isdigit() and str(int(name)) == name and 0 < int(name) < _LARGEST_NODE


def _functions(frf: Frf) -> Iterator[_Function]:
    for p, response in enumerate(frf.responses):
        for q, excitation in enumerate(frf.excitations):
            values = np.where(frf.valid, frf.values[:, p, q], 0)
            yield _Function(_FRF, frf.quantity, frf.unit, response, excitation, values)
            known = None if frf.coherence is None else frf.coherence[:, p, q]
            if known is not None and np.isfinite(known[frf.valid]).all():
                yield _Function(_COHERENCE, "coherence", "NONE", response, excitation, np.nan_to_num(known))
    if frf.multiple_coherence is not None:
        for response, known in zip(frf.responses, np.nan_to_num(frf.multiple_coherence).T, strict=True):
            yield _Function(_MULTIPLE_COHERENCE, "multiple_coherence", "NONE", response, _NOWHERE, known)


def _data_set(f: NDArray[np.float64], function: _Function, nodes: Mapping[str, int], binary: bool) -> bytes:
    """One data set 58: eleven lines of header, then the samples."""
    step = f[1] - f[0] if len(f) > 1 else 0.0
    # the header holds six digits: an axis it cannot repeat exactly is written out beside the values
    even = np.allclose(float(f"{f[0]:.5e}") + float(f"{step:.5e}") * np.arange(len(f)), f, rtol=1e-12, atol=0)
    values = function.samples
    columns = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    samples = np.column_stack(columns if even else [f, *columns]).astype("<f8")
    first = f"    58b     1     2          11{samples.nbytes:12d}" + "     0     0           0           0"
    header = "".join(f"{line:<80s}\n" for line in _header(f, step if even else None, function, nodes))
    begin = f"{'    -1':<80s}\n{first if binary else '    58':<80s}\n" + header
    if binary:
        return begin.encode("ascii", "replace") + samples.tobytes() + b"\n    -1\n"
    rows = ("".join(_number(value, not even and k == 0) for k, value in enumerate(row)) for row in samples)
    text = "".join(f"{row}\n" for row in rows)
    return (begin + text).encode("ascii", "replace") + b"    -1\n"


def _number(value: float, is_frequency: bool) -> str:
    """Write a number in the fields of the format: 13 characters for a frequency beside values, 20 for a value."""
    return f"{value:13.7e}" if is_frequency else f"{value:20.11e}"


def _header(
    f: NDArray[np.float64], step: float | None, function: _Function, nodes: Mapping[str, int]
) -> tuple[str, ...]:
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
        _axis(_FORCE if force else 0, "Force" if force else "NONE", "N" if force else "NONE"),
        _axis(0, "NONE", "NONE"),
    )


def _end(dof: str, nodes: Mapping[str, int]) -> str:
    if dof == _NOWHERE:
        return f"{'NONE':>10s}{0:10d}{0:4d}"
    node, direction = dof.split(":")
    return f"{'NONE' if is_uff_number(node) else node:>10s}{nodes[node]:10d}{_DIRECTIONS[direction]:4d}"


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit:<20s}"
