"""What the page says in words: state, time, samples, marks, what was not drawn, and how far the session is."""

from typing import Any

from millfrf.core import counted

from ..control import LiveControl
from ..monitor import Snapshot
from ..session import COLUMNS


def status_of(now: Snapshot, control: LiveControl) -> dict[str, Any]:
    """State of the recording as plain text, for the page to set as text; never as HTML."""
    return {
        "state": control.state,
        "line": status_line(now, control),
        "start": control.state == "waiting",
        "mark": control.state == "recording",
        "stop": control.state in ("waiting", "recording"),
    }


def tests_of(now: Snapshot) -> dict[str, Any] | None:
    """How far the session is, as plain text; None without a session."""
    standing = now.standing
    if standing is None or not (standing.rows or standing.advice or now.notes):
        return None
    rows = [{"state": row.state, "cells": row.cells} for row in standing.rows]
    return {"advice": standing.advice, "columns": COLUMNS, "rows": rows, "notes": now.notes}


def status_line(now: Snapshot, control: LiveControl) -> str:
    """Time, samples, averages, marks, what was left out of the drawing, and how it ended."""
    n = len(control.marks)
    parts = [f"{now.seconds:.1f} s", f"{now.n_samples} samples a channel"]
    if now.spectra is not None:
        parts.append(counted(round(now.spectra.averages), "average"))
    if n:
        parts.append(f"{counted(n, 'mark')} (last: {control.marks[-1].label})")
    if now.n_skipped:
        parts.append(f"{now.n_skipped} blocks recorded but not drawn")
    return f"{', '.join(parts)}. {control.message}".strip()
