"""Named arrays in files of other programs: NPY, NPZ, MAT, HDF5, TDMS, CSV, WAV, UFF."""

import logging
import math
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, require_memory

from ..recordings.guarded_reading import read_guarded
from ..settings import SETTINGS
from .csv_file import read_csv
from .uff_sets import read_uff_sets
from .writers import float_array

SUFFIXES = (".npy", ".npz", ".mat", ".h5", ".hdf5", ".tdms", ".csv", ".txt", ".wav", ".uff", ".unv")


@dataclass(frozen=True)
class ArrayFile:
    """Arrays of a file by name, with the column headings if the file is a table.

    Parameters
    ----------
    path
        Path of the file.
    fields
        Contents of the file, by name.
    headings
        Headings of the columns if the file is a table; else empty.
    sample_rate : Hz
        Sample rate; None if the file does not state it.
    units
        Units of these columns, if a row below the headings states them.
    array_units
        Units of arrays by their name, if the file states them (TDMS).
    """

    path: Path
    fields: Mapping[str, Any]
    headings: tuple[str, ...] = ()
    sample_rate: float | None = None
    units: tuple[str, ...] = ()
    array_units: Mapping[str, str] = field(default_factory=dict)

    def array(self, name: str | None) -> NDArray[np.floating]:
        """Return the array of that name; None returns the only array.

        Raises
        ------
        FileFormatError
            No such array, several arrays and no name, or an array that does not hold real numbers.
        """
        names = list(self.fields)
        if name is None and len(names) == 1:
            name = names[0]
        if name is None or name not in self.fields:
            mistake = "several arrays and none named" if name is None else f"no array {name!r}"
            raise FileFormatError(f"{self.path}: {mistake}; it has {', '.join(names) or 'none'}")
        return float_array(self.fields[name], name, self.path)


def open_arrays(path: Path, **csv_options: Any) -> ArrayFile:
    """Read the arrays of a file; nothing in it is ever unpickled.

    Parameters
    ----------
    path
        Path of the file; its suffix names the format.
    csv_options
        Options of `CsvOptions`, for a CSV file.

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
    if suffix not in _READERS:
        raise InputError(f"cannot read {path.name}: suffix {path.suffix!r}; use one of {', '.join(SUFFIXES)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the message of an error is one line, without warnings of the libraries
            return _READERS[suffix](path)
    except InputError:
        raise
    except Exception as error:  # damaged files make numpy, scipy and zipfile raise nearly anything
        reason = " ".join(str(error).split())
        if "pickle" in reason:
            reason = "it holds pickled Python objects, which can run programs; save plain arrays of numbers"
        raise FileFormatError(f"{path} cannot be read as {suffix}: {reason or type(error).__name__}") from error


def _read_npy(path: Path) -> ArrayFile:
    return ArrayFile(path, {path.stem: np.load(path, mmap_mode="r", allow_pickle=False)})


def _read_npz(path: Path) -> ArrayFile:
    with np.load(path, allow_pickle=False) as archive:
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise FileFormatError(f"{path} is not an NPZ archive; rename it to .npy")
        announced = sum(entry.file_size for entry in archive.zip.infolist()) if archive.zip is not None else 0
        require_memory(
            SETTINGS.copies_in_memory * announced,
            f"{path} ({path.stat().st_size} bytes) unpacks to {announced} bytes",
            "split it",
        )
        return ArrayFile(path, {name: archive[name] for name in archive.files})


def _read_tdms(path: Path) -> ArrayFile:
    """Read the channels of a TDMS file of National Instruments as ``group/channel``, with rate and units."""
    from nptdms import TdmsFile  # here, because it takes long to load

    logging.getLogger("nptdms").setLevel(logging.CRITICAL)  # it prints large parts of a damaged file
    with TdmsFile.open(path) as file:
        channels = {f"{group.name}/{channel.name}": channel for group in file.groups() for channel in group.channels()}
        fields = {name: channel[:] for name, channel in channels.items()}
        steps = {float(channel.properties.get("wf_increment", 0.0)) for channel in channels.values()}
        units = {name: channel.properties.get("unit_string") for name, channel in channels.items()}
    rate = 1 / steps.pop() if len(steps) == 1 and min(steps) > 0 else None
    if rate is not None and abs(rate - round(rate)) < 1e-9 * rate:  # the reciprocal of a rounded step
        rate = float(round(rate))
    return ArrayFile(
        path, fields, sample_rate=rate, array_units={name: str(unit) for name, unit in units.items() if unit}
    )


def _read_hdf5(path: Path) -> ArrayFile:
    return ArrayFile(path, read_guarded(path, "arrays"))


def _read_mat(path: Path) -> ArrayFile:
    if h5py.is_hdf5(path):  # version 7.3 stores arrays with reversed axes
        arrays = read_guarded(path, "arrays")
        return ArrayFile(
            path, {name: value.T if isinstance(value, np.ndarray) else value for name, value in arrays.items()}
        )
    if not _is_plain_mat(path):
        return ArrayFile(path, read_guarded(path, "mat"))
    return ArrayFile(path, {name: value for name, value in scipy.io.loadmat(path).items() if not name.startswith("__")})


def _read_wav(path: Path) -> ArrayFile:
    """Read the samples as the array ``wav`` (n_samples, n_channels).

    Integers are divided by the largest of their type.
    """
    try:
        rate, stored = scipy.io.wavfile.read(path)
    except UnboundLocalError as error:  # scipy's error for a file without samples
        raise FileFormatError(f"{path} holds no samples; it is cut short, record or export it again") from error
    if not rate > 0:
        raise FileFormatError(f"{path} states a sample rate of {rate}; convert it again")
    if stored.dtype == np.uint8:
        values = (stored.astype(np.float64) - 128.0) / 128.0
    elif stored.dtype.kind == "i":
        values = stored / float(-np.iinfo(stored.dtype).min)
    else:
        values = stored.astype(np.float64)
    return ArrayFile(path, {"wav": values.reshape(len(values), -1)}, sample_rate=float(rate))


def _read_uff_times(path: Path) -> ArrayFile:
    """Read the time records by ``node:direction``; the n-th record of the same name gets ``#n``."""
    time_response = 1  # function type in data set 58
    records = [record for record in read_uff_sets(path, (58,)) if record.get("func_type") == time_response]
    if not records:
        raise FileFormatError(
            f"{path} holds no time record (data set 58, function 1); FRFs are converted without a mapping file"
        )
    steps = {round(float(record["abscissa_inc"]), 15) for record in records}
    if len(steps) != 1 or not min(steps) > 0:
        raise FileFormatError(f"{path} holds time records of the steps {sorted(steps)} s; export one rate per file")
    axes = {1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
    fields: dict[str, Any] = {}
    for record in records:
        node, direction = int(record["rsp_node"]), int(record["rsp_dir"])
        axis = axes.get(abs(direction), "+S")
        name = f"{node}:{axis if direction >= 0 else axis.replace('+', '-')}"
        n_same = sum(key.split("#")[0] == name for key in fields)
        fields[f"{name}#{n_same + 1}" if n_same else name] = np.real(np.asarray(record["data"])).astype(float)
    return ArrayFile(path, fields, sample_rate=1.0 / min(steps))


_READERS: dict[str, Callable[[Path], ArrayFile]] = {
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".mat": _read_mat,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".tdms": _read_tdms,
    ".wav": _read_wav,
    ".uff": _read_uff_times,
    ".unv": _read_uff_times,
}


# MAT-File Format (MathWorks), level 5: types of data elements, the bytes of one number of each numeric type, and the
# types in which texts are stored; classes of arrays and the flag of complex numbers.
_MATRIX, _COMPRESSED = 14, 15
_NUMBER_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_TEXT_TYPES = (2, 4, 16)
_CHAR_CLASS, _NUMERIC_CLASSES = 4, range(6, 16)
_COMPLEX_FLAG = 0x800
_HEADER_BYTES = 128
_DEEPEST_NESTING = 64


def _is_plain_mat(path: Path) -> bool:
    """Return whether a MAT file holds only numbers and texts of consistent sizes, so that scipy cannot crash.

    The result is also False for other versions of MAT files, which are built differently. A FileFormatError reports an
    element of unknown type, or an element that announces more bytes than there are.
    """
    data = memoryview(path.read_bytes())
    if len(data) < _HEADER_BYTES and bytes(data[:6]) == b"MATLAB":
        raise FileFormatError(f"{path} is damaged: it ends within its header; save it again")
    mark = bytes(data[126:128])
    if mark not in (b"IM", b"MI"):
        return False
    order = "<" if mark == b"IM" else ">"
    try:
        elements = _mat_elements(data[_HEADER_BYTES:], order)
        return all(_is_plain_element(kind, content, order, len(data)) for kind, content in elements)
    except (ValueError, struct.error, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged: {error}; save it again") from error


def _mat_elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of consecutive elements; ``order`` is the byte order for `struct`."""
    at = 0
    while len(data) - at >= 8:
        kind, size = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # a small element: up to four bytes within the tag itself
            kind, size, begin, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
        else:
            begin = at + 8
            end = begin + size + (0 if kind == _COMPRESSED else -size % 8)
        if kind not in _NUMBER_BYTES and kind not in (_MATRIX, _COMPRESSED):
            raise ValueError(f"an element of unknown type {kind}")
        if begin + size > len(data):
            raise ValueError(f"an element of {size} bytes where {len(data) - begin} are left")
        yield kind, data[begin : begin + size]
        at = end


def _is_plain_element(kind: int, data: memoryview, order: str, file_size: int) -> bool:
    if kind == _COMPRESSED:
        inflater = zlib.decompressobj()
        # the limit keeps a damaged or malicious element from filling the memory
        inflated = inflater.decompress(data, 16 * file_size + 64_000_000)
        if inflater.unconsumed_tail or not inflater.eof:
            raise ValueError("a compressed element that is cut short or expands too far")
        elements = list(_mat_elements(memoryview(inflated), order))
        return len(elements) == 1 and elements[0][0] == _MATRIX and _is_plain_matrix(elements[0][1], order)
    return kind == _MATRIX and _is_plain_matrix(data, order)


def _is_plain_matrix(data: memoryview, order: str, depth: int = 0) -> bool:
    """Return whether an array holds numbers or a text of the size that its dimensions state.

    Nested arrays are only checked for damage.
    """
    if depth > _DEEPEST_NESTING:
        raise ValueError("arrays are nested too deep")
    elements = list(_mat_elements(data, order))
    for kind, content in elements:
        if kind == _MATRIX:
            _is_plain_matrix(content, order, depth + 1)
    # flags (unsigned 32-bit), dimensions (signed 32-bit), name (8-bit), values
    if len(elements) < 4 or [kind for kind, _ in elements[:3]] != [6, 5, 1] or len(elements[0][1]) != 8:
        return False
    flags = struct.unpack(order + "II", elements[0][1])[0]
    n_dimensions = len(elements[1][1]) // 4
    dimensions = struct.unpack(f"{order}{n_dimensions}i", elements[1][1][: 4 * n_dimensions])
    if not 2 <= n_dimensions <= 32 or min(dimensions) < 0:
        return False
    count = math.prod(dimensions)
    values = elements[3:]
    if flags & 0xFF == _CHAR_CLASS:
        return len(values) == 1 and values[0][0] in _TEXT_TYPES and len(values[0][1]) <= 4 * count + 8
    return (
        flags & 0xFF in _NUMERIC_CLASSES
        and len(values) == (2 if flags & _COMPLEX_FLAG else 1)
        and all(kind in _NUMBER_BYTES and len(content) == count * _NUMBER_BYTES[kind] for kind, content in values)
    )
