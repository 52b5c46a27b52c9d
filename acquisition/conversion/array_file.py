"""Named arrays in a file of another program: NPY, NPZ, MAT (any version), HDF5, TDMS, CSV, WAV, UFF."""

import logging
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from foundation import FileFormatError, InputError, require_memory

from ..file_safety import read_guarded
from .csv_file import read_csv
from .flat_fields import numbers
from .mat_check import is_plain_mat
from .sampled_files import read_uff_times, read_wav

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
    return {name: value for name, value in loadmat(path).items() if not name.startswith("__")}


def _hdf5(path: Path) -> dict[str, Any]:
    return read_guarded(path, "arrays")


def _reversed_axes(value: Any) -> Any:
    return value.T if isinstance(value, np.ndarray) else value
