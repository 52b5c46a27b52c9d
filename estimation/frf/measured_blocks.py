"""Blocks of an FRF matrix that were measured, where the entries between them were not."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from millfrf.core import DegreeOfFreedom, Index, InputError, listed

Block = tuple[Index, Index]  # rows and columns of a full block


def measured_blocks(measured: NDArray[np.bool_]) -> tuple[Block, ...]:
    """Return rows and columns of the blocks of measured entries, in the order of their first row.

    Entries belong to one block if a chain of shared rows and columns joins them.

    Examples
    --------
    >>> [(rows.tolist(), columns.tolist()) for rows, columns in measured_blocks(np.eye(2, dtype=bool))]
    [([0], [0]), ([1], [1])]
    """
    blocks: list[Block] = []
    for row in range(len(measured)):
        if any(row in rows for rows, _ in blocks):
            continue
        rows = np.arange(len(measured)) == row
        while True:
            columns = measured[rows].any(axis=0)
            reached = rows | measured[:, columns].any(axis=1)
            if (reached == rows).all():
                break
            rows = reached
        blocks.append((np.flatnonzero(rows), np.flatnonzero(columns)))
    return tuple(blocks)


def missing_entries(
    measured: NDArray[np.bool_], responses: Sequence[str], excitations: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    """Return response and excitation of each entry without which the matrix cannot be used; usually none.

    A matrix of full blocks, each with a drive point, as of a tap test in X and then in Y with one accelerometer, can
    be used: its blocks are FRFs of their own. In other matrices all entries that were not measured are missing.

    Examples
    --------
    >>> missing_entries(np.eye(2, dtype=bool), ["TCP:+X", "TCP:+Y"], ["TCP:+X", "TCP:+Y"])
    ()
    >>> missing_entries(np.array([[True, False], [True, True]]), ["TCP:+X", "TCP:+Y"], ["TCP:+X", "TCP:+Y"])
    (('TCP:+X', 'TCP:+Y'),)
    """
    whole = all(
        measured[np.ix_(rows, columns)].all() and _has_drive_point(rows, columns, responses, excitations)
        for rows, columns in measured_blocks(measured)
    )
    if whole and measured.any(axis=0).all():
        return ()
    return tuple((responses[p], excitations[q]) for q, p in np.argwhere(~measured.T))


def entries_in_words(measured: NDArray[np.bool_], responses: Sequence[str], excitations: Sequence[str]) -> str:
    """List the entries that were not measured, ``response / excitation``.

    >>> entries_in_words(np.eye(2, dtype=bool), ["TCP:+X", "TCP:+Y"], ["TCP:+X", "TCP:+Y"])
    'TCP:+X / TCP:+Y, TCP:+Y / TCP:+X'
    """
    return listed([f"{responses[p]} / {excitations[q]}" for p, q in np.argwhere(~measured)])


def checked_measured(
    measured: NDArray[np.bool_] | None, responses: Sequence[str], excitations: Sequence[str], holder: str
) -> NDArray[np.bool_] | None:
    """Return the mask of measured entries, or None where all are measured.

    Raises
    ------
    InputError
        Another shape than the matrix, or entries that are missing (``missing_entries``).
    """
    if measured is None or measured.all():
        return None
    if measured.shape != (len(responses), len(excitations)):
        raise InputError(
            f"{holder}: 'measured' has shape {measured.shape}, the matrix has {len(responses)} responses and "
            f"{len(excitations)} excitations; give true or false for each entry"
        )
    if missing_entries(measured, responses, excitations):
        raise InputError(
            f"{holder}: {entries_in_words(measured, responses, excitations)} (response / excitation) was not measured, "
            "and what was measured is not made of whole blocks, each with a drive point; give the whole matrix"
        )
    return measured


def _has_drive_point(rows: Index, columns: Index, responses: Sequence[str], excitations: Sequence[str]) -> bool:
    """Return whether a block excites and measures one node along one axis; a whole matrix may do without."""
    if len(rows) == len(responses) and len(columns) == len(excitations):
        return True
    driven = {_place(excitations[q]) for q in columns}
    return any(_place(responses[p]) in driven for p in rows)


def _place(label: str) -> str:
    """Return ``node:axis`` without the sign; a label without a direction is returned as it is."""
    if ":" not in label:
        return label
    dof = DegreeOfFreedom.parse(label)
    return f"{dof.node}:{dof.axis}"
