"""Named arrays in files of other programs: NPY, NPZ, MAT, HDF5, TDMS, CSV, WAV, UFF."""

import logging
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, require_memory

from ..recordings.guarded_reading import read_guarded
from .csv_file import read_csv
from .uff_sets import read_uff_sets
from .writers import numbers

_TIME_RESPONSE = 1
_TRANSLATIONS = {1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}


def read_wav(path: Path) -> tuple[dict[str, Any], float]:
    """Samples as the array ``wav`` (n_samples, n_channels), 1 at full scale, and the rate, Hz.

    Integers are divided by the largest of their size; floats are taken as they are.

    Raises
    ------
    FileFormatError
        No whole WAV file, or one without a rate.
    """
    from scipy.io import wavfile

    try:
        rate, stored = wavfile.read(path)
    except UnboundLocalError as error:  # what scipy says of a file without samples
        raise FileFormatError(f"{path} holds no samples; it is cut short, record or export it anew") from error
    if not rate > 0:
        raise FileFormatError(f"{path} states a sample rate of {rate}; convert it anew")
    if stored.dtype == np.uint8:
        values = (stored.astype(np.float64) - 128.0) / 128.0
    elif stored.dtype.kind == "i":
        values = stored / float(-np.iinfo(stored.dtype).min)
    else:
        values = stored.astype(np.float64)
    return {"wav": values.reshape(len(values), -1)}, float(rate)


def read_uff_times(path: Path) -> tuple[dict[str, Any], float]:
    """Time records by ``node:direction`` (the n-th of one name gets ``#n``), and their common rate, Hz.

    Raises
    ------
    FileFormatError
        No time record, unequal rates, or a damaged file.
    """
    records = [entry for entry in read_uff_sets(path, (58,)) if entry.get("func_type") == _TIME_RESPONSE]
    if not records:
        raise FileFormatError(
            f"{path} holds no time record (data set 58, function 1); FRFs are converted without a mapping file"
        )
    steps = {round(float(entry["abscissa_inc"]), 15) for entry in records}
    if len(steps) != 1 or not min(steps) > 0:
        raise FileFormatError(f"{path} holds time records of the steps {sorted(steps)} s; export one rate a file")
    fields: dict[str, Any] = {}
    for entry in records:
        node, direction = int(entry["rsp_node"]), int(entry["rsp_dir"])
        axis = _TRANSLATIONS.get(abs(direction), "+S")
        name = f"{node}:{axis if direction >= 0 else axis.replace('+', '-')}"
        same = sum(key.split("#")[0] == name for key in fields)
        fields[f"{name}#{same + 1}" if same else name] = np.real(np.asarray(entry["data"])).astype(float)
    return fields, 1.0 / min(steps)


_MATRIX, _COMPRESSED = 14, 15
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes a number, by the type of an element."""
_TEXTS = (2, 4, 16)
_HEADER, _DEEPEST = 128, 64
_EXPANSION, _SPARE = 16, 64_000_000
_CHAR, _NUMERIC = 4, range(6, 16)
_COMPLEX = 0x800

Element = tuple[int, memoryview]


def is_plain_mat(path: Path) -> bool:
    """Whether a file holds nothing but arrays of numbers and texts whose sizes agree; scipy reads those safely.

    False also for other versions, which have no such tags.

    Raises
    ------
    FileFormatError
        A tag of unknown type, or one that says more bytes than there are.
    """
    data = memoryview(path.read_bytes())
    if len(data) < _HEADER and bytes(data[:6]) == b"MATLAB":
        raise FileFormatError(f"{path} is damaged: it ends within its header; save it anew")
    mark = bytes(data[126:128])
    if mark not in (b"IM", b"MI"):
        return False
    order = "<" if mark == b"IM" else ">"
    try:
        return all(_is_plain(*element, order, len(data)) for element in _elements(data[_HEADER:], order))
    except (ValueError, struct.error, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged: {error}; save it anew") from error


def _elements(data: memoryview, order: str) -> Iterator[Element]:
    """Type and data of all elements one after the other."""
    at = 0
    while len(data) - at >= 8:
        kind, size = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # a small element: up to four bytes beside their tag
            kind, size, begin, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
        else:
            begin = at + 8
            end = begin + size + (0 if kind == _COMPRESSED else -size % 8)
        if kind not in _SIZES and kind not in (_MATRIX, _COMPRESSED):
            raise ValueError(f"an element of unknown type {kind}")
        if begin + size > len(data):
            raise ValueError(f"an element of {size} bytes where {len(data) - begin} are left")
        yield kind, data[begin : begin + size]
        at = end


def _is_plain(kind: int, data: memoryview, order: str, file_size: int) -> bool:
    """Say whether one element at the top holds plain data."""
    if kind == _COMPRESSED:
        inflater = zlib.decompressobj()
        whole = inflater.decompress(data, _EXPANSION * file_size + _SPARE)
        if inflater.unconsumed_tail or not inflater.eof:
            raise ValueError("a compressed element that is cut short or grows beyond all measure")
        inner = list(_elements(memoryview(whole), order))
        return len(inner) == 1 and inner[0][0] == _MATRIX and _is_plain_matrix(inner[0][1], order)
    return kind == _MATRIX and _is_plain_matrix(data, order)


def _is_plain_matrix(data: memoryview, order: str, depth: int = 0) -> bool:
    """An array of numbers or a text, as large as its dimensions say; what is nested is at least walked through."""
    if depth > _DEEPEST:
        raise ValueError("arrays are nested too deep")
    parts = list(_elements(data, order))
    for kind, inner in parts:
        if kind == _MATRIX:
            _is_plain_matrix(inner, order, depth + 1)
    if len(parts) < 4 or [kind for kind, _ in parts[:3]] != [6, 5, 1] or len(parts[0][1]) != 8:
        return False
    flags = struct.unpack(order + "II", parts[0][1])[0]
    dimensions = struct.unpack(f"{order}{len(parts[1][1]) // 4}i", parts[1][1][: len(parts[1][1]) // 4 * 4])
    count = 1
    for length in dimensions:
        count *= length
    if not 2 <= len(dimensions) <= 32 or min(dimensions) < 0:
        return False
    values = parts[3:]
    if flags & 0xFF == _CHAR:
        return len(values) == 1 and values[0][0] in _TEXTS and len(values[0][1]) <= 4 * count + 8
    wanted = 2 if flags & _COMPLEX else 1
    return (
        flags & 0xFF in _NUMERIC
        and len(values) == wanted
        and all(kind in _SIZES and len(part) == count * _SIZES[kind] for kind, part in values)
    )


SUFFIXES = (".npy", ".npz", ".mat", ".h5", ".hdf5", ".tdms", ".csv", ".txt", ".wav", ".uff", ".unv")


_COPIES = 2.5
"""Times the arrays of a file that a conversion holds in memory."""


class ArrayFile:
    """Arrays by name, with the headings of a table's columns where it has some.

    Parameters
    ----------
    path
        Path of the file.
    fields
        Everything the file holds, by name.
    headings
        Headings of the columns of its only table.
    sample_rate : Hz
        Sample rate, where the file states it.
    units
        Units of those columns, where a row below the headings tells them.
    array_units
        Units of arrays by their name, where the file states them (TDMS).
    """

    def __init__(
        self,
        path: Path,
        fields: Mapping[str, Any],
        headings: tuple[str, ...] = (),
        sample_rate: float | None = None,
        units: tuple[str, ...] = (),
        array_units: Mapping[str, str] | None = None,
    ) -> None:
        self.path = path
        self.fields = fields
        self.headings = headings
        self.sample_rate = sample_rate
        self.units = units
        self.array_units = dict(array_units or {})

    def array(self, name: str | None) -> NDArray[np.floating]:
        """The array of that name; None asks for the only one.

        Raises
        ------
        FileFormatError
            No such array, several and none named, or one that does not hold real numbers.
        """
        names = list(self.fields)
        if name is None and len(names) == 1:
            name = names[0]
        if name is None or name not in self.fields:
            asked = "several arrays and none named" if name is None else f"no array {name!r}"
            raise FileFormatError(f"{self.path}: {asked}; it has {', '.join(names) or 'none'}")
        return numbers(self.fields[name], name, self.path)


def open_arrays(path: Path, **csv_options: Any) -> ArrayFile:
    """Read the arrays of a file; nothing in it is ever unpickled.

    Raises
    ------
    InputError
        No such file, or a suffix that cannot be read.
    FileFormatError
        The file is damaged or holds pickled objects.
    """
    if not path.is_file():
        raise InputError(f"no file {path}; check the name, or 'file' in the mapping")
    suffix = path.suffix.lower()
    if suffix in (".csv", ".txt"):
        table = read_csv(path, **csv_options)
        return ArrayFile(path, {"table": table.values}, table.headings, units=table.units)
    readers: dict[str, Callable[[Path], dict[str, Any]]] = {
        ".npy": _npy,
        ".npz": _npz,
        ".mat": _mat,
        ".h5": _hdf5,
        ".hdf5": _hdf5,
    }
    sampled: dict[str, Callable[[Path], tuple[dict[str, Any], float]]] = {
        ".wav": read_wav,
        ".uff": read_uff_times,
        ".unv": read_uff_times,
    }
    if suffix not in readers and suffix not in sampled and suffix != ".tdms":
        raise InputError(f"cannot read {path.name}: suffix {path.suffix!r}; use one of {', '.join(SUFFIXES)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what the readers' libraries say beside their errors is no line of ours
            if suffix == ".tdms":
                return _tdms(path)
            if suffix in sampled:
                fields, rate = sampled[suffix](path)
                return ArrayFile(path, fields, sample_rate=rate)
            return ArrayFile(path, readers[suffix](path))
    except InputError:
        raise
    except Exception as error:  # damaged files make numpy, scipy and zipfile raise nearly anything
        reason = " ".join(str(error).split())
        if "pickle" in reason:
            reason = "it holds pickled Python objects, which can run programs; save plain arrays of numbers"
        raise FileFormatError(f"{path} cannot be read as {suffix}: {reason or type(error).__name__}") from error


def _npy(path: Path) -> dict[str, Any]:
    return {path.stem: np.load(path, mmap_mode="r", allow_pickle=False)}


def _npz(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as archive:
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise FileFormatError(f"{path} is not an NPZ archive; rename it to .npy")
        announced = sum(entry.file_size for entry in archive.zip.infolist()) if archive.zip is not None else 0
        require_memory(
            _COPIES * announced, f"{path} ({path.stat().st_size} bytes) unpacks to {announced} bytes", "split it"
        )
        return {name: archive[name] for name in archive.files}


def _tdms(path: Path) -> ArrayFile:
    """National Instruments' format: channels by ``group/channel``, with rate and units as their properties say them."""
    from nptdms import TdmsFile

    logging.getLogger("nptdms").setLevel(logging.CRITICAL)  # it prints whole pieces of a damaged file
    with TdmsFile.open(path) as opened:
        channels = {f"{group.name}/{one.name}": one for group in opened.groups() for one in group.channels()}
        fields = {name: one[:] for name, one in channels.items()}
        steps = {float(one.properties.get("wf_increment", 0.0)) for one in channels.values()}
        told = {name: one.properties.get("unit_string") for name, one in channels.items()}
    rate = 1 / steps.pop() if len(steps) == 1 and min(steps) > 0 else None
    if rate is not None and abs(rate - round(rate)) < 1e-9 * rate:
        rate = float(round(rate))
    return ArrayFile(
        path, fields, sample_rate=rate, array_units={name: str(unit) for name, unit in told.items() if unit}
    )


def _mat(path: Path) -> dict[str, Any]:
    """Up to version 7 by scipy; version 7.3 is HDF5 with the axes reversed."""
    if h5py.is_hdf5(path):
        return {name: _reversed_axes(value) for name, value in _hdf5(path).items()}
    if not is_plain_mat(path):
        return read_guarded(path, "mat")
    return {name: value for name, value in scipy.io.loadmat(path).items() if not name.startswith("__")}


def _hdf5(path: Path) -> dict[str, Any]:
    return read_guarded(path, "arrays")


def _reversed_axes(value: Any) -> Any:
    return value.T if isinstance(value, np.ndarray) else value
