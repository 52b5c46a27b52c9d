"""FRFs in the Universal File Format, data set 58: what other modal-analysis programs read and write."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError, writing_whole_file

from .frf import Frf

_FRF = 4  # function type
_HERTZ = 18
_DATA_TYPES = {"receptance": 8, "mobility": 11, "accelerance": 12}
_UNITS = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}
_FORCE = 13
_DIRECTIONS = {sign + axis: value * (n + 1) for sign, value in (("+", 1), ("-", -1)) for n, axis in enumerate("XYZ")}
_NAMES = {number: name for name, number in _DIRECTIONS.items()}


def write_frf_uff(path: str | os.PathLike[str], frf: Frf, *, binary: bool = True) -> None:
    """Write an FRF as one data set 58 (58b where ``binary``) an entry, in double precision and SI units.

    Nodes are numbered in order of appearance and named in the entity fields. Lines without an FRF are written as 0;
    coherence and covariance have no place in the format.

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
        Another suffix, or a node's name longer than the 10 characters the format holds.
    """
    if Path(path).suffix.lower() not in (".uff", ".unv"):
        raise InputError(f"cannot write {path}: UFF files end in .uff or .unv; change the suffix")
    nodes = list(dict.fromkeys(dof.partition(":")[0] for dof in (*frf.responses, *frf.excitations)))
    long = [name for name in nodes if len(name) > 10]
    if long:
        raise InputError(f"node name {long[0]!r} is longer than the 10 characters of a UFF file; shorten it")
    with writing_whole_file(path) as temporary, temporary.open("wb") as file:
        for p, response in enumerate(frf.responses):
            for q, excitation in enumerate(frf.excitations):
                values = np.where(frf.valid, frf.values[:, p, q], 0)
                file.write(_data_set(frf, values, response, excitation, nodes, binary))


def read_frf_uff(path: str | os.PathLike[str]) -> Frf:
    """Read all FRFs of a UFF file as one matrix; lines that are 0 in every entry are not valid.

    Raises
    ------
    InputError
        No such file, or the package pyuff is missing.
    FileFormatError
        No FRF inside, entries that are missing or given twice, unlike axes, or rotations.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    pyuff = _pyuff()
    try:
        read = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # whatever a damaged file brings pyuff to
        raise FileFormatError(f"{path} is no readable UFF file ({type(error).__name__}: {error})") from error
    sets = [s for s in (read if isinstance(read, list) else [read]) if s.get("type") == 58 and s["func_type"] == _FRF]
    if not sets:
        raise FileFormatError(f"{path} holds no FRF (data set 58, function type 4); export FRFs, not time histories")
    return _matrix(path, sets)


def _matrix(path: str | os.PathLike[str], sets: Sequence[dict[str, Any]]) -> Frf:
    frequencies = np.asarray(sets[0]["x"], dtype=float)
    entries: dict[tuple[str, str], NDArray[np.complex128]] = {}
    for s in sets:
        key = (_label(path, s, "rsp"), _label(path, s, "ref"))
        if key in entries:
            raise FileFormatError(f"{path} holds {key[0]} / {key[1]} twice; export each FRF once")
        if len(s["x"]) != len(frequencies) or not np.allclose(s["x"], frequencies, rtol=1e-6):
            raise FileFormatError(f"{path}: {key[0]} / {key[1]} has another frequency axis; export one axis")
        entries[key] = np.asarray(s["data"], dtype=complex)
    responses = tuple(dict.fromkeys(response for response, _ in entries))
    excitations = tuple(dict.fromkeys(excitation for _, excitation in entries))
    missing = [(p, q) for p in responses for q in excitations if (p, q) not in entries]
    if missing:
        raise FileFormatError(f"{path} lacks {missing[0][0]} / {missing[0][1]}; export the whole matrix")
    values = np.array([[entries[p, q] for q in excitations] for p in responses])
    values = np.ascontiguousarray(values.transpose(2, 0, 1))
    valid = np.isfinite(values).all(axis=(1, 2)) & values.any(axis=(1, 2))
    quantity, unit = _quantity(sets[0])
    return Frf(frequencies, np.where(valid[:, None, None], values, 0), responses, excitations, quantity, unit, valid)


def _data_set(
    frf: Frf, values: NDArray[np.complex128], response: str, excitation: str, nodes: Sequence[str], binary: bool
) -> bytes:
    """One data set 58 with double-precision complex values: eleven lines of header, then the samples."""
    f = frf.frequencies
    step = f[1] - f[0] if len(f) > 1 else 0.0
    # the header holds six digits: an axis it cannot repeat exactly is written out beside the values
    even = np.allclose(float(f"{f[0]:.5e}") + float(f"{step:.5e}") * np.arange(len(f)), f, rtol=1e-12, atol=0)
    columns = [values.real, values.imag] if even else [f, values.real, values.imag]
    samples = np.column_stack(columns).astype("<f8")
    first = f"    58b     1     2          11{samples.nbytes:12d}" + "     0     0           0           0"
    force = frf.quantity in _DATA_TYPES
    axis = (f[0], step) if even else (0.0, 0.0)
    lines = [
        "    -1",
        first if binary else "    58",
        f"{frf.quantity} {response} / {excitation}",
        *["NONE"] * 4,
        f"{_FRF:5d}{0:10d}{0:5d}{0:10d} {_end(response, nodes)} {_end(excitation, nodes)}",
        f"{6:10d}{len(f):10d}{int(even):10d}{axis[0]:13.5e}{axis[1]:13.5e}{0:13.5e}",
        _axis(_HERTZ, "Frequency", "Hz"),
        _axis(_DATA_TYPES.get(frf.quantity, 0), frf.quantity, frf.unit),
        _axis(_FORCE if force else 0, "Force" if force else "NONE", "N" if force else "NONE"),
        _axis(0, "NONE", "NONE"),
    ]
    header = "".join(f"{line:<80s}\n" for line in lines).encode("ascii", "replace")
    if binary:
        return header + samples.tobytes() + b"\n    -1\n"
    text = "".join("".join(f"{number:20.11e}" for number in row) + "\n" for row in samples)
    return header + text.encode("ascii") + b"    -1\n"


def _end(dof: str, nodes: Sequence[str]) -> str:
    node, direction = dof.split(":")
    return f"{node:>10s}{nodes.index(node) + 1:10d}{_DIRECTIONS[direction]:4d}"


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit:<20s}"


def _label(path: str | os.PathLike[str], data_set: dict[str, Any], side: str) -> str:
    direction = int(data_set[f"{side}_dir"])
    if direction not in _NAMES:
        raise FileFormatError(f"{path}: direction {direction} is no axis; only translations along X, Y, Z are read")
    name = str(data_set.get(f"{side}_ent_name", "")).strip()
    node = name if name and name.upper() != "NONE" else str(int(data_set[f"{side}_node"]))
    return f"{node}:{_NAMES[direction]}"


def _quantity(data_set: dict[str, Any]) -> tuple[str, str]:
    kind, denominator = int(data_set["ordinate_spec_data_type"]), int(data_set["orddenom_spec_data_type"])
    for quantity, number in _DATA_TYPES.items():
        if kind == number and denominator == _FORCE:
            return quantity, _UNITS[quantity]
    unit = str(data_set.get("ordinate_axis_units_lab", "")).strip()
    return "transfer", unit if unit and unit.upper() != "NONE" else "1"


def _pyuff() -> Any:
    try:
        import pyuff
    except ModuleNotFoundError as error:
        raise InputError("UFF files need the package pyuff; install it with 'pip install millfrf[formats]'") from error
    return pyuff
