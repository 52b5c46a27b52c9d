"""`EventSeries`: slow or asynchronous values of an open recording."""

from collections.abc import Callable

import h5py
import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError

from ..sources import EventAxis
from .recording_format import text_attribute

Pair = tuple[NDArray[np.float64], NDArray[np.float64]]
Columns = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]


class EventSeries:
    """Slow or asynchronous values: times and values, read when asked for.

    Parameters
    ----------
    group
        The HDF5 group ``/events/<name>``.
    aligned
        Function that gives the times on the samples' axis and the values; None: the stored times are taken as they are.
    """

    def __init__(self, group: h5py.Group, aligned: Callable[[], Pair] | None = None) -> None:
        self._group = group
        self._aligned = aligned

    @property
    def axis(self) -> EventAxis:
        """Clock in which the stored times are told.

        Raises
        ------
        FileFormatError
            The file names none that is known.
        """
        try:
            defaults = (("time_axis", "samples"), ("clock", ""))
            kind, clock = (text_attribute(self._group.attrs, name, default) for name, default in defaults)
            texts = "text" in self._group
        except (OSError, RuntimeError, KeyError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} are damaged; take a copy of the file") from error
        try:
            return EventAxis(kind, clock, texts)  # type: ignore[arg-type]  # checked by EventAxis
        except InputError as error:
            raise FileFormatError(f"events {self._group.name}: {error}") from error

    def read_raw(self) -> Columns:
        """Times in the clock of `axis` (s), values, and the host's arrival times (s) or None, each (n_events,).

        Raises
        ------
        FileFormatError
            The series is damaged.
        """
        axis = self.axis
        names = ("time", "value", *(("arrival",) if axis.kind == "device" else ()))
        try:
            columns = [np.asarray(self._group[name][:], dtype=float) for name in names]
            n_texts = [self._group["text"].shape[0]] if axis.texts else []
        except (OSError, RuntimeError, KeyError, AttributeError, TypeError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} lack readable 'time' and 'value'; record anew") from error
        n_whole = min(*map(len, columns), *n_texts)  # a writer killed between two leaves some longer
        times, values, *arrivals = (column[:n_whole] for column in columns)
        return times, values, arrivals[0] if arrivals else None

    def read_texts(self) -> tuple[str, ...]:
        """The text of each value; empty texts where the series has none.

        Raises
        ------
        FileFormatError
            The series is damaged.
        """
        n_whole = len(self.read_raw()[0])
        if not self.axis.texts:
            return ("",) * n_whole
        try:
            stored = np.asarray(self._group["text"][:n_whole])
            return tuple(bytes(text).decode("utf-8", "replace") for text in stored)
        except (OSError, TypeError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} have no readable 'text'; record anew") from error

    def read(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times on the samples' axis (s) and values, each (n_events,).

        Raises
        ------
        FileFormatError
            The series is damaged, or its clock cannot be aligned.
        """
        return self.read_raw()[:2] if self._aligned is None else self._aligned()
