"""Tables of the taps: used and left out in each file, averages and band of each point hit."""

from collections.abc import Sequence

import numpy as np

from estimation import FoundTaps

from ..tables import Table
from .run import TapResult

MOST_LISTED = 40
"""Rows that a terminal is given; the file's provenance has all."""


def tap_tables(result: TapResult) -> tuple[Table, ...]:
    """Taps of each file; those left out, each with time and reason; averages and band of each point hit."""
    tables = [_files(result.found)]
    left_out = [(each, one) for each in result.found for one in each.taps if one.reason]
    if left_out:
        rows = [
            (each.test.path.name, f"{each.time(one):.3f}", f"{abs(one.tap.peak):.4g}", one.reason)
            for each, one in left_out[:MOST_LISTED]
        ]
        more = len(left_out) - MOST_LISTED
        note = f" (the first {MOST_LISTED} of {len(left_out)})" if more > 0 else ""
        tables.append(Table(f"Taps left out{note}", ("file", "time (s)", "peak (N)", "why"), tuple(rows)))
    return (*tables, _points(result))


def _files(found: Sequence[FoundTaps]) -> Table:
    rows = []
    for each in found[:MOST_LISTED]:
        hit = dict.fromkeys(each.test.excitations[one.tap.channel].degree_of_freedom for one in each.used)
        peaks = [abs(one.tap.peak) for one in each.used]
        contacts = [1e3 * one.tap.contact for one in each.used]
        rows.append(
            (
                each.test.path.name,
                ", ".join(hit),
                str(len(each.taps)),
                str(len(each.used)),
                f"{min(peaks):.4g} to {max(peaks):.4g}",
                f"{np.median(contacts):.3g}",
            )
        )
    note = f" (the first {MOST_LISTED} of {len(found)} tests)" if len(found) > MOST_LISTED else ""
    columns = ("file", "hit at", "taps found", "used", "peaks (N)", "contact (ms)")
    return Table(f"Taps{note}", columns, tuple(rows))


def _points(result: TapResult) -> Table:
    frf, rows = result.merged.frf, []
    assert frf.averages is not None
    for q, label in enumerate(frf.excitations[:MOST_LISTED]):
        averages = frf.averages[:, q]
        few, many = int(averages.min()), int(averages.max())
        band = result.merged.bands[label]
        inside = frf.valid & (frf.frequencies > 0)
        if band is not None:
            inside &= (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
        known = frf.coherence is not None and np.isfinite(frf.coherence[inside][:, :, q]).any()
        rows.append(
            (
                label,
                str(few) if few == many else f"{few} to {many}",
                "none" if band is None else f"{band[0]:.4g} to {band[1]:.4g}",
                f"{np.nanmedian(frf.coherence[inside][:, :, q]):.4f}" if known and frf.coherence is not None else "",
            )
        )
    note = f" (the first {MOST_LISTED} of {len(frf.excitations)})" if len(frf.excitations) > MOST_LISTED else ""
    columns = ("hit at", "averages", "force within 20 dB (Hz)", "median coherence there")
    return Table(f"Points hit{note}", columns, tuple(rows))
