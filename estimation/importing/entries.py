"""Entries of an imported FRF matrix, with one response and one excitation each, and the matrix of all of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, DegreeOfFreedom, FileFormatError, Real, listed

from ..frf.frf_matrix import Frf
from ..frf.measured_blocks import missing_entries
from ..settings import FRFS
from .units import SI


@dataclass(frozen=True)
class FrfEntry:
    """One FRF as it was read, in SI units."""

    response: str
    excitation: str
    frequencies: Real  # (n_frequencies,), Hz
    values: Complex  # (n_frequencies,)
    source: str  # name of the file and place in it, for messages
    coherence: Real | None = None  # (n_frequencies,), ordinary coherence, 0 to 1
    averages: int = 0  # 0 where their number is not known

    @property
    def name(self) -> str:
        """Return the name of the entry, ``response / excitation``."""
        return f"{self.response} / {self.excitation}"


@dataclass(frozen=True)
class ImportedFrf:
    """An FRF from files of another program, with remarks on how they were read.

    Parameters
    ----------
    frf
        The FRF, in SI units.
    inferred
        Facts that were inferred from the files with certainty; one sentence each.
    doubts
        Facts that the files do not state, or that were assumed; one sentence each.
    """

    frf: Frf
    inferred: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def assembled(entries: Sequence[FrfEntry], quantity: str, unit: str) -> tuple[Frf, tuple[str, ...]]:
    """Assemble the FRF matrix of all entries, and return it with its doubts.

    Responses and excitations keep the order in which they first appear.
    A line where every entry is 0, or 0 Hz with values that are not finite, is not valid. ``unit`` is used only for a
    ``transfer``. An entry that is 0, or not finite, on every line was not measured, like an entry left out: no
    measurement is exactly 0. An entry that is given twice, axes that differ, entries without which the matrix has no
    whole blocks (:func:`missing_entries`), and values that are not finite raise a FileFormatError. Lines with a
    coherence outside 0 to 1 are left out with a doubt if they are few, as where hardly anything moves.
    """
    first = entries[0]
    table: dict[tuple[str, str], FrfEntry] = {}
    for entry in entries:
        for label in (entry.response, entry.excitation):
            DegreeOfFreedom.parse(label)
        twin = table.setdefault((entry.response, entry.excitation), entry)
        if twin is not entry:
            raise FileFormatError(f"{entry.source} gives {entry.name} twice, as {twin.source} does; give each FRF once")
        _require_same_axis(first, entry)
    responses = tuple(dict.fromkeys(entry.response for entry in entries))
    excitations = tuple(dict.fromkeys(entry.excitation for entry in entries))
    measured = _measured(table, responses, excitations, first.source)
    empty = FrfEntry("", "", first.frequencies, np.zeros(len(first.frequencies), complex), "")
    rows = [
        [table[name] if known else empty for name, known in zip(product([p], excitations), row, strict=True)]
        for p, row in zip(responses, measured, strict=True)
    ]
    values = np.asarray(_stack([[entry.values for entry in row] for row in rows]), dtype=complex)
    # analysers divide 0 by 0 at 0 Hz: a value there that is not finite is no damage
    undefined = (first.frequencies == 0) & ~np.isfinite(values).all(axis=(1, 2))
    valid = values.any(axis=(1, 2)) & ~undefined
    given = [entry for row in rows for entry in row if entry is not empty]
    _require_sound(given, valid)
    doubts = _leave_out_impossible(given, valid)
    averages = np.array([[entry.averages for entry in row] for row in rows], dtype=np.int64)
    frf = Frf(
        first.frequencies,
        np.where(valid[:, None, None], values, 0),
        responses,
        excitations,
        quantity,
        SI.get(quantity, unit),
        valid,
        coherence=_coherence(rows, len(first.frequencies)),
        averages=averages if averages.any() else None,
        measured=measured,
    )
    return frf, doubts


def _require_same_axis(first: FrfEntry, entry: FrfEntry) -> None:
    expected, own = first.frequencies, entry.frequencies
    if len(expected) == len(own) and np.allclose(expected, own, rtol=FRFS.same_axis, atol=1e-9):
        return
    raise FileFormatError(
        f"{entry.source}: {entry.name} has {_axis(own)}, {first.name} in {first.source} has {_axis(expected)}; export "
        "all FRFs on one frequency axis"
    )


def _axis(f: Real) -> str:
    return f"{len(f)} lines from {f[0]:g} to {f[-1]:g} Hz" if len(f) else "no line"


def _measured(
    table: dict[tuple[str, str], FrfEntry], responses: Sequence[str], excitations: Sequence[str], source: str
) -> NDArray[np.bool_]:
    """Return which entries the files give; refuse a matrix that lacks entries without being made of whole blocks."""
    measured = np.array([[_is_given(table.get((p, q))) for q in excitations] for p in responses])
    # a dead channel is no missing entry: where zeros do not leave whole blocks, they stay, and later checks report them
    if missing_entries(measured, responses, excitations):
        measured = np.array([[(p, q) in table for q in excitations] for p in responses])
    missing = [f"{p} / {q}" for p, q in missing_entries(measured, responses, excitations)]
    if missing:
        raise FileFormatError(
            f"{source}: the matrix of {len(responses)} responses and {len(excitations)} excitations lacks "
            f"{listed(missing, 3)}; export all of it, or choose responses and excitations in a mapping"
        )
    return measured


def _is_given(entry: FrfEntry | None) -> bool:
    return entry is not None and bool(np.any(np.isfinite(entry.values) & (entry.values != 0)))


def _require_sound(entries: Sequence[FrfEntry], valid: NDArray[np.bool_]) -> None:
    for entry in entries:
        wrong = np.flatnonzero(valid & ~(np.abs(entry.values) < FRFS.largest))
        if len(wrong):
            raise FileFormatError(
                f"{entry.source}: {entry.name} holds {entry.values[wrong[0]].real:g} at "
                f"{entry.frequencies[wrong[0]]:g} Hz; correct or remove that line before converting"
            )


def _leave_out_impossible(entries: Sequence[FrfEntry], valid: NDArray[np.bool_]) -> tuple[str, ...]:
    """Mark the lines with a coherence outside 0 to 1 as not valid, and return a doubt about them.

    Raises
    ------
    FileFormatError
        They are more than a few: a scale in percent, or no coherence.
    """
    wrong = {
        entry.name: valid & (np.abs(entry.coherence - 0.5) > 0.5 + FRFS.coherence_rounding)
        for entry in entries
        if entry.coherence is not None
    }
    for entry in entries:
        lines = np.flatnonzero(wrong.get(entry.name, False))
        if len(lines) <= FRFS.impossible_lines * np.count_nonzero(valid):
            continue
        assert entry.coherence is not None
        value, f, line = entry.coherence[lines[0]], entry.frequencies[lines[0]], lines[0] + 1
        hint = "if it is in percent, write (%) behind its heading; else " if 2 < value <= 100 else ""
        raise FileFormatError(
            f"{entry.source}: {entry.name} has a coherence of {value:g} at {f:g} Hz (line {line} of {len(valid)}), and "
            f"{len(lines)} lines like it; a coherence lies between 0 and 1: {hint}export the FRF again, or without its "
            "coherence"
        )
    impossible = np.any([*wrong.values(), np.zeros(len(valid), dtype=bool)], axis=0)
    if not impossible.any():
        return ()
    valid &= ~impossible
    names = listed([name for name, lines in wrong.items() if lines.any()], 3)
    return (
        f"{np.count_nonzero(impossible)} of {len(valid)} lines, the first at "
        f"{entries[0].frequencies[impossible.argmax()]:.6g} Hz, have a coherence outside 0 to 1 ({names}) and are left "
        "out: hardly anything moves there, or they were averaged differently",
    )


def _coherence(rows: Sequence[Sequence[FrfEntry]], n_lines: int) -> Real | None:
    """Return the coherence of all entries, NaN for entries without one; None where no entry has one."""
    if all(entry.coherence is None for row in rows for entry in row):
        return None
    unknown = np.full(n_lines, np.nan)
    filled = [[unknown if entry.coherence is None else entry.coherence for entry in row] for row in rows]
    return np.asarray(_stack(filled), dtype=float)


def _stack(rows: Sequence[Sequence[NDArray[np.inexact]]]) -> NDArray[np.inexact]:
    """Stack rows of arrays (n_frequencies,) to (n_frequencies, n_responses, n_excitations)."""
    return np.ascontiguousarray(np.array(rows).transpose(2, 0, 1))
