"""`CheckedSamples`: the samples of a stream, given back only where they match their checksums."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError

from ..file_safety import ENTRY, BlockTable, samples_sum, whole_rows

Rows = NDArray[np.floating]

BESIDE = 1 << 14
"""Rows that are salvaged at a time where the file has neither blocks nor chunks."""


@dataclass(frozen=True)
class DamagedRows:
    """Rows of a stream that are not what was recorded.

    Parameters
    ----------
    first, end
        Number of the first row, and the number behind the last.
    reason
        What is wrong with them, in a few words.
    """

    first: int
    end: int
    reason: str


class DamagedSamplesError(FileFormatError):
    """Samples that are not what was recorded.

    Parameters
    ----------
    message
        One line with the file and the rows.
    found
        The rows and the reason.
    """

    def __init__(self, message: str, found: DamagedRows) -> None:
        super().__init__(message)
        self.found = found


class CheckedSamples:
    """The table of samples of one stream, with the checksums of its blocks where the file has them.

    Parameters
    ----------
    samples
        The dataset ``(n_samples, n_channels)``.
    table
        The blocks' entries; None: a file of version 1, which cannot tell.
    name
        Name of the stream, for messages.
    path
        Path of the file, for messages.
    """

    def __init__(self, samples: h5py.Dataset, table: BlockTable | None, name: str, path: Path) -> None:
        self.dataset = samples
        self._name, self._path, self._table = name, path, table
        self._passed = np.zeros(0 if table is None else len(table.entries), dtype=bool)

    @property
    def n_rows(self) -> int:
        """Rows that were acknowledged: all up to the end of the last sound block."""
        stored = int(self.dataset.shape[0])
        return stored if self._table is None else min(stored, self._table.n_rows)

    @property
    def has_checksums(self) -> bool:
        """Whether damaged rows would be noticed."""
        return self._table is not None

    def require_whole_end(self) -> None:
        """Refuse a table whose last blocks are damaged, or that holds fewer rows than its blocks announce.

        Raises
        ------
        DamagedSamplesError
            What is lost.
        """
        lost = self._lost_at_end()
        if lost is not None:
            raise self._damage(lost)

    def read(self, start: int, stop: int) -> Rows:
        """Rows as they are stored.

        Raises
        ------
        DamagedSamplesError
            A block in which some of them lie cannot be read, or does not match its checksum.
        """
        if self._table is None or start >= stop:
            return self._stored(start, stop)
        for first, end in self._table.uncovered:
            if first < stop and end > start:
                raise self._damage(DamagedRows(first, end, "their checksum is damaged"))
        numbers = self._table.covering(start, stop)
        if self._passed[numbers.start : numbers.stop].all():
            return self._stored(start, stop)
        entries = self._table.entries[numbers.start : numbers.stop]
        first = int(entries[0]["first_row"])
        rows = self._stored(first, int(entries[-1]["first_row"]) + int(entries[-1]["rows"]))
        for number, entry in zip(numbers, entries, strict=True):
            if self._table.sound[number] and not self._passed[number]:
                self._check(rows, first, entry)
                self._passed[number] = True
        return rows[start - first : stop - first]

    def _check(self, rows: Rows, first: int, entry: np.void) -> None:
        """Refuse a block, among rows from ``first`` on, that does not match its checksum."""
        begin = int(entry["first_row"])
        end = begin + int(entry["rows"])
        if samples_sum(rows[begin - first : end - first], begin) != entry["samples_sum"]:
            raise self._damage(DamagedRows(begin, end, "they do not match their checksum"))

    def salvaged(self, file_size: int) -> Iterator[Rows | DamagedRows]:
        """All rows in order, part by part; what is damaged is named instead of given back.

        Parameters
        ----------
        file_size
            Bytes that the file holds: a file that was cut ends before its rows do.
        """
        # a block shows by its checksum whether it is there; without checksums the file's size must do
        held = self.n_rows if self._table is not None else whole_rows(self.dataset, file_size)
        for first, end in self._parts():
            if end > held:
                yield DamagedRows(first, end, "the file ends before them")
                continue
            try:
                yield self.read(first, end)
            except DamagedSamplesError as error:
                yield error.found
        lost = self._lost_at_end()
        if lost is not None:
            yield lost

    def _parts(self) -> list[tuple[int, int]]:
        """Parts in which rows are salvaged: blocks and what lies between them, or chunks where there are no blocks."""
        if self._table is None:
            step, n_rows = (self.dataset.chunks or (BESIDE,))[0], self.n_rows
            return [(at, min(at + step, n_rows)) for at in range(0, n_rows, step)]
        held = self.n_rows
        return [(a, min(b, held)) for a, b in sorted([*self._table.spans, *self._table.uncovered]) if a < held]

    def _lost_at_end(self) -> DamagedRows | None:
        """Rows at the end that the blocks announce and that are not there, or that no sound block tells of."""
        if self._table is None:
            return None
        stored, told = int(self.dataset.shape[0]), self._table.n_rows
        if told > stored:
            return DamagedRows(stored, told, "the file does not hold them")
        if self._table.damaged_at_end:
            return DamagedRows(told, max(stored, told + 1), "their checksum is damaged")
        return None

    def _stored(self, start: int, stop: int) -> Rows:
        try:
            return np.asarray(self.dataset[start:stop])
        except (OSError, RuntimeError) as error:
            raise self._damage(DamagedRows(start, stop, "they cannot be read")) from error

    def _damage(self, found: DamagedRows) -> DamagedSamplesError:
        return DamagedSamplesError(
            f"{self._path}: samples {found.first} to {found.end - 1} of {self._name} are damaged ({found.reason}); "
            "save the sound ones with millfrf recover",
            found,
        )


def block_table(blocks: object, name: str, path: Path) -> BlockTable:
    """The entries of a stream's blocks as a file has them.

    Parameters
    ----------
    blocks
        The dataset ``/signals/<name>/blocks``.
    name
        Name of the stream, for messages.
    path
        Path of the file, for messages.

    Raises
    ------
    FileFormatError
        It is no such table.
    """
    if not isinstance(blocks, h5py.Dataset) or blocks.ndim != 1 or blocks.dtype != ENTRY:
        raise FileFormatError(f"{path}: /signals/{name} has no table 'blocks' of checksums; convert anew")
    return BlockTable.read(np.asarray(blocks[:]))
