"""`EventSeries`: slow or asynchronous values of an open recording."""

from collections.abc import Callable

import h5py
import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError

from ..sources import EventAxis
from .recording_format import text_attribute
from .tables import event_columns, summed_rows

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
    sound_only
        Leave out values that do not match their checksums instead of refusing the series.
    """

    def __init__(
        self, group: h5py.Group, aligned: Callable[[], Pair] | None = None, *, sound_only: bool = False
    ) -> None:
        self._group = group
        self._aligned = aligned
        self._sound_only = sound_only

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
        times, values, *others = (np.asarray(one, dtype=float) for one in self._sound()[: 3 if self._arrives else 2])
        return times, values, others[0] if others else None

    @property
    def damaged(self) -> int:
        """Number of values that do not match their checksums."""
        return summed_rows(self._group, event_columns(self.axis), "sum")[1]

    @property
    def _arrives(self) -> bool:
        return self.axis.kind == "device"

    def _sound(self) -> list[NDArray[np.generic]]:
        """Columns of the rows that match their checksums."""
        columns, damaged = summed_rows(self._group, event_columns(self.axis), "sum")
        if damaged and not self._sound_only:
            raise FileFormatError(
                f"{self._group.file.filename}: {damaged} values of {self._group.name} are damaged; save the sound ones "
                "with millfrf recover"
            )
        return columns

    def read_texts(self) -> tuple[str, ...]:
        """The text of each value; empty texts where the series has none.

        Raises
        ------
        FileFormatError
            The series is damaged.
        """
        columns = self._sound()
        if not self.axis.texts:
            return ("",) * len(columns[0])
        try:
            return tuple(bytes(text).decode("utf-8", "replace") for text in columns[-1])
        except (TypeError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} have no readable 'text'; record anew") from error

    def read(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times on the samples' axis (s) and values, each (n_events,).

        Raises
        ------
        FileFormatError
            The series is damaged, or its clock cannot be aligned.
        """
        return self.read_raw()[:2] if self._aligned is None else self._aligned()
