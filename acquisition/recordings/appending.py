"""Rows appended to growing tables: all of them or none, also when the disk is full."""

import contextlib
from collections.abc import Sequence

import h5py
import numpy as np
from numpy.typing import NDArray

from foundation import DiskFull, is_disk_full

from ..file_safety import SpareSpace

Rows = Sequence[tuple[h5py.Dataset, NDArray[np.generic]]]


def append_rows(rows: Rows, spare: SpareSpace | None, path: object) -> None:
    """Append to several tables and hand everything to the system.

    Rows that were announced but not written must not be read as zeros: whatever interrupts, Ctrl-C included, the tables
    get back the length they had. When the disk is full the spare space is released first, so that this succeeds.

    Raises
    ------
    DiskFull
        The rows may not have been kept; the tables are whole, and nothing more can be appended.
    """
    lengths = [table.shape[0] for table, _ in rows]
    try:
        for table, new in rows:
            _extend(table, new)
    except BaseException as error:
        full = is_disk_full(error)
        if full and spare is not None:
            spare.release()
        with contextlib.suppress(OSError, RuntimeError):
            for (table, _), length in zip(rows, lengths, strict=True):
                table.resize(length, axis=0)
                table.flush()
        if not full:
            raise
        raise DiskFull(f"the disk of {path} is full; the recording ends here, make room for the next one") from error


def _extend(table: h5py.Dataset, new: NDArray[np.generic]) -> None:
    start = table.shape[0]
    table.resize(start + len(new), axis=0)
    table[start:] = new
    table.flush()
