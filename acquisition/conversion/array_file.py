"""Files of other programs as named arrays, with what each file says of them: text, NumPy, MAT, HDF5, TDMS, WAV, UFF."""

import datetime
import logging
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import SECONDS, FileFormatError, InputError, optional_library, require_memory, time_unit

from ..recordings.guarded_reading import is_plain_mat, read_guarded
from ..settings import SETTINGS
from .sample_axis import SampleAxis, is_time_name, measured_axis, stated_rate
from .text_lines import TextOptions
from .text_table import TEXT_SUFFIXES, TextTable, read_text_table, table_of_lines
from .uff_sets import UFF_AXES, read_uff_sets


@dataclass(frozen=True)
class Facts:
    """What a file says of one of its arrays; empty, or None, where it says nothing.

    Parameters
    ----------
    unit, quantity
        Unit of the numbers, and quantity as in `SI_UNITS`.
    node, direction
        Degree of freedom.
    axis
        Rate and start of the samples.
    length
        Number of samples that the file announces, if it stores fewer.
    """

    unit: str = ""
    quantity: str = ""
    node: str = ""
    direction: str = ""
    axis: SampleAxis | None = None
    length: int | None = None


@dataclass(frozen=True)
class ArrayFile:
    """Arrays of a file by name, with what the file says of them.

    Parameters
    ----------
    path
        Path of the file.
    fields
        Contents of the file, by name; a text is one array ``table``.
    facts
        What the file says of its arrays, by name.
    table
        Headings, units and account of a text; else None.
    recorded_at
        Time of the recording that the file states, ISO 8601; empty: none.
    """

    path: Path
    fields: Mapping[str, Any]
    facts: Mapping[str, Facts] = field(default_factory=dict)
    table: TextTable | None = None
    recorded_at: str = ""

    @property
    def headings(self) -> tuple[str, ...]:
        """Return the headings of a table that has some; else none."""
        return self.table.headings if self.table is not None and any(self.table.headings) else ()

    @property
    def units(self) -> tuple[str, ...]:
        """Return the units of the columns of a table that states some; else none."""
        return self.table.units if self.table is not None and any(self.table.units) else ()

    def unit_of(self, name: str, column: int) -> str:
        """Return the unit that the file states for a column, counted from 0, of an array; empty: none."""
        if self.table is not None:
            return self.table.units[column]
        return self.facts[name].unit if name in self.facts else ""

    def axis_of(self, name: str) -> SampleAxis | None:
        """Return rate and start that the file states for an array."""
        return self.facts[name].axis if name in self.facts else None

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


def float_array(value: Any, name: str, path: object) -> NDArray[np.floating]:
    """Convert ``value`` to an array of floats; float32 stays float32."""
    array = np.asarray(value)
    if array.dtype.kind == "c":
        raise FileFormatError(f"{path}: array {name} is complex; samples are real numbers, convert time series only")
    if array.dtype.kind not in "fiub":
        raise FileFormatError(f"{path}: array {name} holds {array.dtype.name}, not numbers; name another array")
    return array if array.dtype in (np.float32, np.float64) else array.astype(float)


def usual_axes(values: NDArray[np.floating], label: str) -> tuple[str, ...]:
    """Return the usual axes: one column per channel, but a single row, as MATLAB stores a vector, is one channel."""
    if values.ndim == 1:
        return ("sample",)
    if values.ndim == 2:
        return ("channel", "sample") if values.shape[0] == 1 and values.shape[1] > 1 else ("sample", "channel")
    raise FileFormatError(f"{label} has {values.ndim} dimensions; name them in axes, such as ['sample', 'channel']")


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
    return ["\t".join(map(_cell_text, row)).rstrip() for row in next(iter(filled.values()))]


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
    """Read the channels of a TDMS file of National Instruments as ``group/channel``, with rate, start and units."""
    from nptdms import TdmsFile  # here, because it takes long to load

    logging.getLogger("nptdms").setLevel(logging.CRITICAL)  # it prints large parts of a damaged file
    with TdmsFile.open(path) as file:
        channels = {f"{group.name}/{channel.name}": channel for group in file.groups() for channel in group.channels()}
        fields = {name: _without_dates(channel[:]) for name, channel in channels.items()}
        said = {name: dict(channel.properties) for name, channel in channels.items()}
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


def _without_dates(values: NDArray[Any]) -> NDArray[Any]:
    """Return time stamps as seconds since the first; other values as they are."""
    return (values - values[0]) / np.timedelta64(1, "s") if values.dtype.kind == "M" and len(values) else values


def _moment(value: Any) -> np.datetime64 | None:
    """Return a start time of TDMS; the zero of its clock, 1904, means that none was set."""
    moment = None if value is None else np.datetime64(value, "ns")
    return None if moment is None or np.isnat(moment) or moment < np.datetime64("1905-01-01") else moment


def _read_hdf5(path: Path) -> ArrayFile:
    return ArrayFile(path, read_guarded(path, "arrays"))


def _read_mat(path: Path) -> ArrayFile:
    if h5py.is_hdf5(path):  # version 7.3 stores arrays with reversed axes
        arrays = read_guarded(path, "arrays")
        return ArrayFile(
            path, {name: value.T if isinstance(value, np.ndarray) else value for name, value in arrays.items()}
        )
    if not is_plain_mat(path):
        fields = read_guarded(path, "mat")
        return ArrayFile(path, fields, _facts_of_testlab(fields))
    return ArrayFile(path, {name: value for name, value in scipy.io.loadmat(path).items() if not name.startswith("__")})


def _facts_of_testlab(fields: Mapping[str, Any]) -> dict[str, Facts]:
    """Return rate and start of signals in structures of Simcenter Testlab.

    Their unit is not read: ``y_values.quantity.label`` is that of the display, and the values are in SI.
    """
    facts = {}
    for name in fields:
        of_signal = name.removesuffix("y_values.values")
        stated = [np.ravel(fields.get(f"{of_signal}x_values.{key}", ())) for key in ("increment", "start_value")]
        is_over_time = str(np.ravel(fields.get(f"{of_signal}x_values.quantity.label", "s"))[0]) == "s"
        if of_signal != name and is_over_time and all(value.size == 1 for value in stated):
            step, start = (float(value[0]) for value in stated)
            facts[name] = Facts(axis=SampleAxis(stated_rate(step), start, f"{of_signal}x_values"))
    return facts


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
    facts = {"wav": Facts(axis=SampleAxis(float(rate), 0.0, "the header"))}
    return ArrayFile(path, {"wav": values.reshape(len(values), -1)}, facts)


def _read_uff_times(path: Path) -> ArrayFile:
    """Read the time records by ``node:direction``; the n-th record of the same name gets ``#n``."""
    time_response = 1  # function type in data set 58
    records = [record for record in read_uff_sets(path, (58,)) if record.get("func_type") == time_response]
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
    return ArrayFile(path, fields, facts)


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
    ".wav": _read_wav,
    ".uff": _read_uff_times,
    ".unv": _read_uff_times,
}
