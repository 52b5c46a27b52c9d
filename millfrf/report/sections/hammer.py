"""The taps behind an FRF of hammer tests: how many were used, and why the others were not."""

from typing import Any

from ...tables import Table
from ..collection import Collected
from ..section import Section

MOST = 60
"""Taps left out that are listed."""


def hammer_section(collected: Collected) -> Section:
    """Taps used and left out, file by file, and why, of each FRF that ``millfrf tap`` made."""
    tables = []
    for file, _ in collected.frfs:
        if file.provenance.get("step") == "tap":
            taps = file.provenance["taps"]
            tables.append(_counts(file.path.name, taps))
            if any(tap["left_out"] for tap in taps):
                tables.append(_left_out(file.path.name, taps))
    return Section("Hammer tests", tables=tuple(tables))


def _counts(name: str, taps: list[dict[str, Any]]) -> Table:
    rows = []
    for recording, point in dict.fromkeys((tap["file"], tap["hit"]) for tap in taps):
        of_it = [tap for tap in taps if (tap["file"], tap["hit"]) == (recording, point)]
        used = [tap for tap in of_it if not tap["left_out"]]
        peaks = [abs(tap["peak_n"]) for tap in used]
        span = f"{min(peaks):.4g} to {max(peaks):.4g}" if peaks else ""
        rows.append((recording, point, str(len(of_it)), str(len(used)), span))
    return Table(f"{name}: taps", ("recording", "hit at", "found", "used", "peaks used (N)"), tuple(rows))


def _left_out(name: str, taps: list[dict[str, Any]]) -> Table:
    rows = [
        (tap["file"], f"{tap['time_s']:.3f}", f"{abs(tap['peak_n']):.4g}", tap["left_out"])
        for tap in taps
        if tap["left_out"]
    ]
    note = f" (the first {MOST} of {len(rows)})" if len(rows) > MOST else ""
    return Table(f"{name}: taps left out{note}", ("recording", "time (s)", "peak (N)", "why"), tuple(rows[:MOST]))
