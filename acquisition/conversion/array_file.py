"""Files of other programs as named arrays, with what each file says of them."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import (
    FileFormatError,
    InputError,
    counted,
    listed,
)

from .mapping import ChannelMapping
from .sample_axis import SampleAxis
from .text_table import TextTable


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
    unread
        What the file holds besides the fields, each with its kind: ``T (a table of MATLAB)``.
    """

    path: Path
    fields: Mapping[str, Any]
    facts: Mapping[str, Facts] = field(default_factory=dict)
    table: TextTable | None = None
    recorded_at: str = ""
    unread: tuple[str, ...] = ()

    def account(self, used: Mapping[str, Collection[int]], n_samples: int) -> str:
        """Say what was read and what was not, and why, in one line.

        Parameters
        ----------
        used
            Columns, counted from 0, that are channels or times, by the name of their array.
        n_samples
            Number of samples that were read of each.
        """
        text = f"{counted(n_samples, 'sample')} read" if self.table is None else self.table.account
        unused: list[str] = []
        for name, value in self.fields.items():
            if not isinstance(value, np.ndarray) or (value.size < 2 and not value.dtype.hasobject):
                continue
            if name not in used and value.dtype.kind != "U":
                unused.append(f"{name} {'x'.join(map(str, value.shape))}" if value.size else f"{name} (no numbers)")
            elif self.table is not None:
                headings = enumerate(self.table.headings)
                unused += [f"column {k + 1} {heading}".strip() for k, heading in headings if k not in used[name]]
        left_out = listed([*unused, *self.unread], 8)
        return f"{self.path.name}: {text}" + (f"; not used: {left_out}" if left_out else "")

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


@dataclass(frozen=True)
class OrderedArray:
    """An array with its axes in the order (split, join..., sample, channel); ``label`` names it in messages."""

    label: str
    values: NDArray[np.floating]
    file: ArrayFile
    name: str

    @property
    def headings(self) -> tuple[str, ...]:
        return self.file.headings

    @property
    def is_short(self) -> bool:
        """Return whether the file announces more samples than it stores."""
        return self.name in self.file.facts and self.file.facts[self.name].length is not None

    @property
    def n_split(self) -> int:
        return int(self.values.shape[0])

    @property
    def n_samples(self) -> int:
        return int(np.prod(self.values.shape[1:-1]))

    def column_number(self, channel: ChannelMapping) -> int:
        """Return the index of a channel's column, from 0."""
        n_columns, column = int(self.values.shape[-1]), channel.column
        if isinstance(column, int) and column <= n_columns:
            return column - 1
        if isinstance(column, str) and column in self.headings:
            return self.headings.index(column)
        if column is None and n_columns == 1:
            return 0
        known = f"headings {', '.join(self.headings)}" if self.headings else "no headings"
        raise InputError(
            f"channel {channel.name}: column = {column!r} does not pick one of the {n_columns} columns of {self.label} "
            f"({known}); give a number from 1 to {n_columns} or a heading"
        )
