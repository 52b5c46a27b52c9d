"""The FRF file of hammer tests, with its provenance: recordings, taps, windows, warnings, versions."""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict

from estimation import FoundTaps, write_frf

from ..provenance import sources, versions
from .run import TapResult


def write_taps(
    path: str | os.PathLike[str],
    result: TapResult,
    recordings: Sequence[str | os.PathLike[str]],
) -> None:
    """Write the FRF whole, with each tap that was found and why it was left out."""
    options = result.options
    used = sum(len(each.used) for each in result.found)
    tables = [] if options.points is None else [options.points]
    provenance = {
        "step": "tap",
        "sources": sources([*recordings, *tables]),
        "options": asdict(options) | {"points": None if options.points is None else options.points.name},
        "settings": asdict(result.settings) | {"segment_s": result.settings.duration},
        "left_at_segment_end": asdict(result.decay),
        "taps": [tap for each in result.found for tap in _taps(each)],
        "bands_hz": result.merged.bands,
        "warnings": list(result.warnings),
        "versions": versions(),
    }
    title = f"H1 of {used} taps in {len(recordings)} recording{'s' if len(recordings) != 1 else ''}"
    write_frf(path, result.merged.frf, title=title, provenance=json.dumps(provenance))


def _taps(found: FoundTaps) -> list[dict[str, object]]:
    return [
        {
            "file": found.test.path.name,
            "time_s": round(found.time(one), 6),
            "hit": found.test.excitations[one.tap.channel].degree_of_freedom,
            "peak_n": one.tap.peak,
            "contact_s": one.tap.contact,
            "left_out": one.reason,
        }
        for one in found.taps
    ]
