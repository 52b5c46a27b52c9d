"""Step ``tap``: FRF matrix from hammer tests."""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Ge, Gt

from acquisition import path_of
from estimation import (
    Decay,
    FoundTaps,
    Frf,
    MergedTaps,
    TapSettings,
    TapSums,
    TapTest,
    answer_decay,
    choose_segments,
    found_taps,
    merge_taps,
    placed,
    require_room_for_taps,
    screened,
    tap_sums,
    window_for,
    write_frf,
)
from millfrf.core import InputError, Result, Summary, counted, doubts_line
from millfrf.core.progress import progress
from millfrf.core.provenance import sources, versions
from millfrf.core.steps import Band, File, Names, Reads, Typed, Writes, names_of, step
from millfrf.core.terminal import Table, say_written, show, tell, warn
from millfrf.gate import (
    check_tap_recordings,
    check_taps_found,
    check_taps_used,
    doubts_of_taps,
)

from .answers import frf_answer, size_of
from .given import RecordingGiven
from .tap_points import AUTO, TapOptions, tests_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@step
def tap(
    *recordings: RecordingGiven,
    out: Annotated[File | None, Writes(suffixes=(".h5", ".hdf5"), needed=True)] = None,
    points: Annotated[File | None, Reads("TABLE")] = None,
    point: Annotated[str, Typed("NODE:DIRECTION")] = "",
    segment: Annotated[float, Gt(0)] | None = None,
    pre_trigger: Annotated[float, Ge(0)] | None = None,
    force_window: str = AUTO,
    exponential: str = AUTO,
    excitations: Names = (),
    responses: Names = (),
    band: Band | None = None,
    stream: str | None = None,
) -> "TapResult":
    """FRF matrix of hammer tests, roving hammer or roving sensor, with the coherence of each entry.

    Taps are detected; double hits, overloads and taps without room for a segment are left out and listed. Files that
    hit one point are averaged; files that hit or measure different points become columns and rows of one matrix. The
    point that was hit is taken from --points, --point, the recording's set-up, or the force channel.

    Parameters
    ----------
    recordings
        Recordings of hammer tests.
    out
        FRF file to write.
    points
        CSV or TOML table: point hit, and where sensors stood, in each file.
    point
        Point hit in all recordings, such as TCP:+X; without it as the files say.
    segment : s
        Duration of a segment; without it the time between taps.
    pre_trigger : s
        Time before a tap's peak; without it twice the longest contact.
    force_window : s
        Time after the peak at which the force is cut off, or auto, or none.
    exponential : s
        Time constant of the exponential window, or auto (where responses have not died out), or none.
    excitations
        Channels of the hammer; without it forces.
    responses
        Channels that respond; without it accelerations, velocities and displacements.
    band : Hz
        Lowest and highest frequency to keep; without it all lines that are driven.
    stream
        Sample clock; needed where a recording has several.

    Returns
    -------
    TapResult
        The FRF, the taps with the reason why one was left out, and the warnings.

    Raises
    ------
    InputError
        A recording or an option that cannot be used; recordings without a usable tap, or of different rates; entries
        of the matrix that no tap gives.

    Examples
    --------
    ::

        $ millfrf tap hit1.h5 hit2.h5 --out taps.h5
    """
    table = None if points is None else Path(points)
    channels = names_of(excitations), names_of(responses)
    options = TapOptions(segment, pre_trigger, force_window, exponential, point, table, *channels, band, stream)
    if not recordings:
        raise InputError("no recording given; name at least one")
    paths = [path_of(recording) for recording in recordings]
    tests = tests_of(paths, options)
    for test in tests:
        require_room_for_taps(test)
    doubts = check_tap_recordings(paths, tests)
    found = _found(tests)
    settings = choose_segments(
        found, segment=segment, pre_trigger=pre_trigger, force_window=options.force_window_seconds
    )
    found = _screened(found, settings)
    with progress("how long the answers ring"):
        decay = answer_decay(found, settings)
    asked = options.time_constant
    settings = replace(settings, time_constant=window_for(decay.left, settings) if asked is None else asked or None)
    merged = merge_taps(_sums(found, settings, band), settings.time_constant)
    doubts += doubts_of_taps(merged, found, settings, decay)
    result = TapResult(merged, tuple(found), settings, decay, tuple(dict.fromkeys(doubts)), options)
    if out is not None:
        write_taps(out, result, paths)
    tell(lambda: {**frf_answer(result.frf), "segment_s": settings.duration})
    for summary in tap_tables(result):
        show(summary)
    warn(result.warnings)
    say_written([out], _in_words(result))
    return result


def _in_words(result: "TapResult") -> str:
    """FRF, band, segments and window of hammer tests in one line."""
    frf, tau = result.frf, result.settings.time_constant
    window = "" if tau is None else f"; exponential window of {tau:.4g} s, whose damping the fit takes off"
    known = "no common band" if frf.band is None else f"band {frf.band[0]:.4g} to {frf.band[1]:.4g} Hz"
    return f"{size_of(frf)}, {known}, segments of {result.settings.duration:.4g} s{window}"


@dataclass(frozen=True, eq=False, repr=False)
class TapResult(Result):
    """An FRF of hammer tests with what it was made from.

    Parameters
    ----------
    merged
        The FRF, in the recordings' own quantity, and the band of each excitation.
    found
        Taps of each test, each with the reason where it was left out.
    settings
        Segments and windows.
    decay
        What was left of the answers at the segments' ends, before the exponential window.
    warnings
        One sentence each.
    options
        How the recordings were turned into the FRF.
    """

    merged: MergedTaps
    found: tuple[FoundTaps, ...]
    settings: TapSettings
    decay: Decay
    warnings: tuple[str, ...]
    options: TapOptions

    @property
    def frf(self) -> Frf:
        """The FRF matrix, with coherence and averages of each entry."""
        return self.merged.frf

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw entries of the FRF and return the axes; see :func:`millfrf.figures.frf.draw_frf` for the choices."""
        return self.frf.plot(axes, **choices)

    def _summary(self) -> Summary:
        frf, used = self.frf, sum(len(each.used) for each in self.found)
        shape = f"{counted(len(frf.responses), 'response')} x {counted(len(frf.excitations), 'excitation')}"
        rows = tuple((each.test.path.name, str(len(each.taps)), str(len(each.used))) for each in self.found)
        return Summary(
            f"TapResult: {used} of {counted(sum(len(each.taps) for each in self.found), 'tap')} used, {shape}",
            (
                f"frf: {frf.quantity} in {frf.unit}, {counted(len(frf.frequencies), 'line')}",
                *doubts_line(self.warnings),
            ),
            ("recording", "taps", "used"),
            rows,
        )


def _found(tests: Sequence[TapTest]) -> list[FoundTaps]:
    found = []
    with progress("finding taps", len(tests)) as update:
        for number, test in enumerate(tests):
            found.append(found_taps(test))
            update(number + 1)
    check_taps_found(found)
    return found


def _screened(found: Sequence[FoundTaps], settings: TapSettings) -> list[FoundTaps]:
    judged = []
    with progress("judging taps", len(found)) as update:
        for number, each in enumerate(found):
            judged.append(screened(placed(each, settings), settings))
            update(number + 1)
    check_taps_used(judged)
    return judged


def _sums(found: Sequence[FoundTaps], settings: TapSettings, band: Band | None) -> list[TapSums]:
    places = {each.test.excitations[one.tap.channel].degree_of_freedom for each in found for one in each.used}
    sums = []
    with progress("spectra of the taps", len(found)) as update:
        for number, each in enumerate(found):
            sums.append(tap_sums(each, settings, band, places))
            update(number + 1)
    return sums


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
