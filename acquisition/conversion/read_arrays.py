"""Readers of text, NumPy, MAT, HDF5, TDMS, MDF, WAV and UFF files: named arrays, with what the file says of them."""

import datetime
import logging
import textwrap
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import (
    SECONDS,
    FileFormatError,
    InputError,
    counted,
    optional_library,
    require_memory,
    time_unit,
)
from millfrf.core.runtime import notice

from ..recordings.guarded_reading import read_guarded
from ..settings import SETTINGS
from .announced_sizes import require_npy, require_wav
from .array_file import ArrayFile, Facts
from .mat_file import read_mat
from .sample_axis import SampleAxis, is_time_name, measured_axis, stated_rate
from .text_lines import TextOptions
from .text_table import TEXT_SUFFIXES, TextTable, read_text_table, table_of_lines
from .uff_sets import UFF_AXES, read_uff_sets

MESSAGE_WIDTH = 160  # most characters of a library's message, which may hold parts of a damaged file


def open_arrays(path: Path, options: TextOptions | None = None) -> ArrayFile:
    """Read the arrays of a file; nothing in it is ever unpickled.

    Parameters
    ----------
    path
        Path of the file; its suffix names the format.
    options
        Layout of a text file, if it is not recognised.

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
    if suffix in TEXT_SUFFIXES:
        return _of_table(read_text_table(path, options))
    if suffix in SHEET_SUFFIXES:
        return _of_table(table_of_lines(path, _lines_of_sheet(path), options or TextOptions()))
    if suffix not in _READERS:
        known = ", ".join((*TEXT_SUFFIXES, *SHEET_SUFFIXES, *_READERS))
        raise InputError(f"cannot read {path.name}: suffix {path.suffix!r}; use one of {known}")
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


def _lines_of_sheet(path: Path) -> list[str]:
    """Return the rows of the only sheet of a workbook as lines of a text with tabulators."""
    calamine = optional_library("python_calamine", "Reading workbooks", "excel")
    try:
        book = calamine.CalamineWorkbook.from_path(str(path))
        sheets = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
    except Exception as error:  # damaged files make the library raise nearly anything
        raise FileFormatError(f"{path} cannot be read as {path.suffix}: {' '.join(str(error).split())}") from error
    filled = {name: rows for name, rows in sheets.items() if rows}
    if len(filled) != 1:
        names = ", ".join(filled) or "none with a cell"
        raise FileFormatError(f"{path} has the sheets {names}: save the one with the samples as a file of its own")
    lines = ["\t".join(map(_cell_text, row)).rstrip() for row in next(iter(filled.values()))]
    while lines and not lines[-1]:
        lines.pop()
    return lines


def _cell_text(cell: Any) -> str:
    """Write a cell of a workbook as text: numbers with all digits, times as ISO 8601."""
    if isinstance(cell, datetime.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    return " ".join(str(cell).split())


def _of_table(table: TextTable) -> ArrayFile:
    """Make a file of a text, with what LabVIEW and oscilloscopes state above the rows: units, rate and start."""
    stated = {row[0]: row[1:] for row in table.header if len(row) > 1}
    facts = {}
    labels = stated.get("Y_Unit_Label", ())
    n_times = len(table.units) - len(labels)
    if labels and 0 <= n_times <= 1:
        table = replace(table, units=(*table.units[:n_times], *labels))
    has_times = any(is_time_name(heading) for heading in table.headings)
    is_over_time = stated.get("X_Dimension", ("",))[0] == "Time"
    if not has_times and is_over_time and "Delta_X" in stated:
        step, start = (float(stated.get(key, ("0",))[0].replace(",", ".")) for key in ("Delta_X", "X0"))
        if step > 0:
            facts["table"] = Facts(axis=SampleAxis(stated_rate(step), start, "Delta_X and X0 of the header"))
    for names, values in pairwise(table.header):  # Rigol: two more cells beside headings and units
        if [name.lower() for name in names[-2:]] == ["start", "increment"] and len(values) == len(names):
            start, step = map(float, values[-2:])
            facts["table"] = Facts(axis=SampleAxis(stated_rate(step), start, "Start and Increment of the header"))
    return ArrayFile(table.path, {"table": table.values}, facts, table)


def _read_npy(path: Path) -> ArrayFile:
    with path.open("rb") as stream:
        require_npy(stream, path.stat().st_size, path, path.stem)
    return ArrayFile(path, {path.stem: np.load(path, mmap_mode="r", allow_pickle=False)})


def _read_npz(path: Path) -> ArrayFile:
    with np.load(path, allow_pickle=False) as archive:
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise FileFormatError(f"{path} is not an NPZ archive; rename it to .npy")
        assert archive.zip is not None
        announced = sum(entry.file_size for entry in archive.zip.infolist())
        require_memory(
            SETTINGS.copies_in_memory * announced,
            f"{path} ({path.stat().st_size} bytes) unpacks to {announced} bytes",
            "split it",
        )
        for entry in archive.zip.infolist():
            with archive.zip.open(entry) as stream:
                require_npy(stream, entry.file_size, path, entry.filename.removesuffix(".npy"))
        return ArrayFile(path, {name: archive[name] for name in archive.files})


def _read_tdms(path: Path) -> ArrayFile:
    """Read the channels of a TDMS file of National Instruments as ``group/channel``, with rate, start and units."""
    from nptdms import TdmsFile  # here, because it takes long to load

    with _quiet("nptdms") as messages, TdmsFile.open(path) as file:
        channels = {f"{group.name}/{channel.name}": channel for group in file.groups() for channel in group.channels()}
        fields = {name: _without_dates(channel[:]) for name, channel in channels.items()}
        said = {name: dict(channel.properties) for name, channel in channels.items()}
    if messages:
        said_first = textwrap.shorten(messages[0], MESSAGE_WIDTH)
        notice(f"{path.name} may be damaged or cut short ({said_first}); compare its samples with those of its program")
    moments = {name: moment for name in said if (moment := _moment(said[name].get("wf_start_time"))) is not None}
    earliest = min(moments.values(), default=None)
    facts = {}
    for name, properties in said.items():
        step = float(properties.get("wf_increment", 0.0))
        start = float(properties.get("wf_start_offset", 0.0))
        if earliest is not None and name in moments:
            start += float((moments[name] - earliest) / np.timedelta64(1, "ns")) * 1e-9
        axis = SampleAxis(stated_rate(step), start, f"wf_increment and start of {name}") if step > 0 else None
        announced = int(properties.get("wf_samples", 0))
        length = announced if announced > len(fields[name]) else None
        unit = "s" if channels[name].dtype == np.dtype("datetime64[us]") else str(properties.get("unit_string") or "")
        facts[name] = Facts(unit, axis=axis, length=length)
    recorded_at = "" if earliest is None else f"{np.datetime_as_string(earliest, 's')}Z"
    return ArrayFile(path, fields, facts, recorded_at=recorded_at)


@contextmanager
def _quiet(name: str) -> Iterator[list[str]]:
    """Collect what the modules of a library log, which may be large parts of a damaged file, instead of printing it."""
    loggers = [logging.getLogger(module) for module in logging.root.manager.loggerDict if module.startswith(name)]
    messages: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.WARNING:
            messages.append(record.getMessage())
        return False

    for logger in loggers:
        logger.addFilter(collect)
    try:
        yield messages
    finally:
        for logger in loggers:
            logger.removeFilter(collect)


def _without_dates(values: NDArray[Any]) -> NDArray[Any]:
    """Return time stamps as seconds since the first; other values as they are."""
    return (values - values[0]) / np.timedelta64(1, "s") if values.dtype.kind == "M" and len(values) else values


def _moment(value: Any) -> np.datetime64 | None:
    """Return a start time of TDMS; the zero of its clock, 1904, means that none was set."""
    moment = None if value is None else np.datetime64(value, "ns")
    return None if moment is None or np.isnat(moment) or moment < np.datetime64("1905-01-01") else moment


def _read_mdf(path: Path) -> ArrayFile:
    """Read the channels of an MDF file (ASAM, versions 2 to 4) as ``group/channel``, with units and measured times.

    A group whose times are not evenly spaced keeps them as its array ``group/time``.
    """
    asammdf = optional_library("asammdf", "Reading MDF files", "mdf")
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    fields: dict[str, Any] = {}
    facts: dict[str, Facts] = {}
    unread: list[str] = []
    with asammdf.MDF(path) as file:
        for number, group in enumerate(file.groups):
            place = str(getattr(group.channel_group, "acq_name", "") or number + 1)
            place = f"{place} {number + 1}" if any(name.startswith(f"{place}/") for name in fields) else place
            times = np.asarray(file.get_master(number), dtype=float)
            axis = _even_times(times, f"time of {place}")
            if axis is None and len(times):
                fields[f"{place}/time"], facts[f"{place}/time"] = times, Facts("s")
            for index, channel in enumerate(group.channels):
                signal = file.get(group=number, index=index) if index != file.masters_db.get(number) else None
                if signal is None or not len(signal.samples):
                    continue
                name = f"{place}/{channel.name}"
                if signal.samples.dtype.kind not in "iufb" or signal.samples.ndim > 1:
                    unread.append(f"{name} (no series of numbers)")
                    continue
                fields[name], facts[name] = _valid_samples(signal), Facts(str(signal.unit or ""), axis=axis)
        recorded_at = file.start_time.isoformat(timespec="seconds") if file.start_time.tzinfo else ""
    return ArrayFile(path, fields, facts, recorded_at=recorded_at, unread=tuple(unread))


def _even_times(times: NDArray[np.floating], source: str) -> SampleAxis | None:
    """Return the axis of times that are evenly spaced; None for others."""
    try:
        return measured_axis(times, source)
    except FileFormatError:
        return None


def _valid_samples(signal: Any) -> NDArray[Any]:
    """Return the samples of a channel of MDF, with NaN where it marks them as invalid."""
    if signal.invalidation_bits is None:
        return np.asarray(signal.samples)
    return np.where(np.asarray(signal.invalidation_bits, dtype=bool), np.nan, signal.samples)


def _read_hdf5(path: Path) -> ArrayFile:
    return ArrayFile(path, read_guarded(path, "arrays"))


def _read_mat(path: Path) -> ArrayFile:
    content = read_mat(path)
    facts = {name: Facts(axis=axis) for name, axis in content.axes.items()}
    unread = tuple(f"{name} (a {kind} of MATLAB)" for name, kind in content.unread.items())
    return ArrayFile(path, content.fields, facts, unread=unread)


def _read_wav(path: Path) -> ArrayFile:
    """Read the samples as the array ``wav`` (n_samples, n_channels).

    Integers are divided by the largest of their type.
    """
    require_wav(path)
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
    facts = {"wav": Facts(axis=SampleAxis(float(rate), 0.0, "the header"))}
    return ArrayFile(path, {"wav": values.reshape(len(values), -1)}, facts)


def _read_uff_times(path: Path) -> ArrayFile:
    """Read the time records by ``node:direction``; the n-th record of the same name gets ``#n``."""
    time_response = 1  # function type in data set 58
    functions = read_uff_sets(path, (58,))
    records = [record for record in functions if record.get("func_type") == time_response]
    if not records:
        raise FileFormatError(
            f"{path} holds no time record (data set 58, function 1); FRFs (into .h5), geometry (into .toml) and modes "
            "(into .json) are converted without a mapping file"
        )
    fields: dict[str, Any] = {}
    facts: dict[str, Facts] = {}
    for record in records:
        node, number = int(record["rsp_node"]), int(record["rsp_dir"])
        axis = UFF_AXES[abs(number)] if 0 < abs(number) < len(UFF_AXES) else ""
        direction = f"{'-' if number < 0 else '+'}{axis or 'S'}"
        name = f"{node}:{direction}"
        n_same = sum(key.split("#")[0] == name for key in fields)
        name = f"{name}#{n_same + 1}" if n_same else name
        fields[name] = np.real(np.asarray(record["data"])).astype(float)
        place = (str(node), direction) if axis else ("", "")
        facts[name] = Facts(*_uff_unit(record), *place, _uff_axis(path, record, name))
    others = Counter(int(each["func_type"]) for each in functions if each.get("func_type") != time_response)
    unread = tuple(f"{counted(n, 'function')} of type {kind} (no time record)" for kind, n in others.items())
    return ArrayFile(path, fields, facts, unread=unread)


SHEET_SUFFIXES = (".xlsx", ".xlsm", ".xls", ".ods")
# quantities by the specific data type of an axis of UFF data set 58
_UFF_QUANTITIES = {5: "temperature", 8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}


def _uff_unit(record: Mapping[str, Any]) -> tuple[str, str]:
    """Return unit and quantity of a time record, each empty where the file does not state it."""
    unit = str(record.get("ordinate_axis_units_lab") or "").strip()
    quantity = _UFF_QUANTITIES.get(int(record.get("ordinate_spec_data_type") or 0), "")
    return "" if unit.upper() in ("NONE", "UNKNOWN") else unit, quantity


def _uff_axis(path: Path, record: Mapping[str, Any], name: str) -> SampleAxis:
    """Return rate and start of a time record, in the unit that it states for its times."""
    label = str(record.get("abscissa_axis_units_lab") or "").strip()
    unit = "s" if label.upper() in ("", "NONE", "UNKNOWN") else time_unit(label)
    source = f"{path.name}, times of {name}"
    if unit is None:
        raise FileFormatError(f"{source} are in {label!r}, which is no unit of time; export them over time")
    if not int(record.get("abscissa_spacing", 1)):
        return measured_axis(record["x"], source, unit)
    step = float(record["abscissa_inc"]) * SECONDS[unit]
    if not step > 0:
        raise FileFormatError(f"{source} have steps of {step:g} s; export it again")
    return SampleAxis(stated_rate(step), float(record["abscissa_min"]) * SECONDS[unit], source)


_READERS: dict[str, Callable[[Path], ArrayFile]] = {
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".mat": _read_mat,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".tdms": _read_tdms,
    ".mf4": _read_mdf,
    ".mdf": _read_mdf,
    ".wav": _read_wav,
    ".uff": _read_uff_times,
    ".unv": _read_uff_times,
}
