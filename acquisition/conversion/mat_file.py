"""MAT files of any version: arrays and texts by name, axes that Simcenter Testlab states, and objects of MATLAB."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy

from millfrf.core import FileFormatError, Real

from ..recordings.guarded_reading import UnreadObject, is_plain_mat, read_guarded
from .sample_axis import SampleAxis, stated_rate


@dataclass(frozen=True)
class MatContent:
    """Content of a MAT file: arrays and texts, axes of samples, and classes of the objects that only MATLAB reads.

    All are by name.
    """

    fields: Mapping[str, Any]
    axes: Mapping[str, SampleAxis] = field(default_factory=dict)
    unread: Mapping[str, str] = field(default_factory=dict)


def read_mat(path: Path) -> MatContent:
    """Read a MAT file of any version; raise a FileFormatError for one that is damaged or holds objects only."""
    if h5py.is_hdf5(path):  # version 7.3 stores arrays with reversed axes
        arrays = read_guarded(path, "arrays")
        fields = {name: value.T if isinstance(value, np.ndarray) else value for name, value in arrays.items()}
        return _without_objects(path, fields, {})
    if not is_plain_mat(path):
        fields = read_guarded(path, "mat")
        return _without_objects(path, fields | _frequencies_of_testlab(fields), _axes_of_testlab(fields))
    return MatContent({name: value for name, value in scipy.io.loadmat(path).items() if not name.startswith("__")})


# what to type in MATLAB so that another program can read an object, by its class; NAME is its name
_IN_MATLAB = {
    "table": "writetable(NAME, 'NAME.csv')",
    "timetable": "T = timetable2table(NAME); T.(1) = seconds(T.(1) - T.(1)(1)); writetable(T, 'NAME.csv')",
    "timeseries": "time = NAME.Time; data = NAME.Data; save('NAME.mat', 'time', 'data')",
}


def _without_objects(path: Path, stored: Mapping[str, Any], axes: Mapping[str, SampleAxis]) -> MatContent:
    """Set the objects of MATLAB apart; refuse a file that holds nothing else."""
    unread = {name: value.kind for name, value in stored.items() if isinstance(value, UnreadObject)}
    fields = {name: value for name, value in stored.items() if name not in unread}
    if unread and not any(isinstance(value, np.ndarray) and value.size > 1 for value in fields.values()):
        name, kind = next((item for item in unread.items() if item[1] in _IN_MATLAB), next(iter(unread.items())))
        remedy = _IN_MATLAB.get(kind, "save its numbers as arrays, not as objects").replace("NAME", name)
        raise FileFormatError(
            f"{path}: {name} is a {kind} of MATLAB, an object that only MATLAB reads; in MATLAB: {remedy}"
        )
    return MatContent(fields, axes, unread)


def _axes_of_testlab(fields: Mapping[str, Any]) -> dict[str, SampleAxis]:
    """Return rate and start of signals in structures of Simcenter Testlab.

    Their unit is not read: ``y_values.quantity.label`` is that of the display, and the values are in SI.
    """
    axes = {}
    for name in fields:
        of_signal = name.removesuffix("y_values.values")
        stated = [np.ravel(fields.get(f"{of_signal}x_values.{key}", ())) for key in ("increment", "start_value")]
        is_over_time = str(np.ravel(fields.get(f"{of_signal}x_values.quantity.label", "s"))[0]) == "s"
        if of_signal != name and is_over_time and all(value.size == 1 for value in stated):
            step, start = (float(value[0]) for value in stated)
            axes[name] = SampleAxis(stated_rate(step), start, f"{of_signal}x_values")
    return axes


def _frequencies_of_testlab(fields: Mapping[str, Any]) -> dict[str, Real]:
    """Return the frequencies (Hz) of spectra in structures of Simcenter Testlab, which state them as start and step."""
    axes = {}
    for label, value in fields.items():
        axis = label.removesuffix(".quantity.label")
        stated = [np.ravel(fields.get(f"{axis}.{key}", ())) for key in ("start_value", "increment", "number_of_values")]
        if axis.endswith("x_values") and str(np.ravel(value)[0]) == "Hz" and all(each.size == 1 for each in stated):
            start, step, number = (float(each[0]) for each in stated)
            axes[f"{axis}.Hz"] = start + step * np.arange(number)
    return axes
