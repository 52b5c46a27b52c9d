"""Step ``tap``: FRF matrix from hammer tests."""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
from annotated_types import Ge, Gt

from acquisition import path_of
from estimation import (
    Decay,
    FoundTaps,
    Frf,
    MergedTaps,
    TapSettings,
    choose_segments,
    found_taps,
    merge_taps,
    require_room_for_taps,
    response_decay,
    screened,
    tap_sums,
    window_for,
    without_hum,
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
    subtracted_hum,
    tap_test_warnings,
)

from .answers import frf_answer, size_of
from .given import RecordingGiven
from .settings import STEPS
from .tap_points import AUTO, TapOptions, WindowTime, tests_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Item = TypeVar("Item")
Outcome = TypeVar("Outcome")


@step
def tap(
    *recordings: RecordingGiven,
    out: Annotated[File | None, Writes(suffixes=(".h5", ".hdf5"), needed=True)] = None,
    points: Annotated[File | None, Reads("TABLE")] = None,
    point: Annotated[str, Typed("NODE:DIRECTION")] = "",
    segment: Annotated[float, Gt(0)] | None = None,
    pre_trigger: Annotated[float, Ge(0)] | None = None,
    force_window: WindowTime = AUTO,
    exponential: WindowTime = AUTO,
    excitations: Names = (),
    responses: Names = (),
    band: Band | None = None,
    stream: str | None = None,
) -> "TapResult":
    """FRF matrix of hammer tests, roving hammer or roving sensor, with the coherence of each entry.

    Taps are detected and mains hum is subtracted; double hits, overloads and taps too near to others for a segment
    are left out and listed. Files with the same excitation point are averaged; files with different points become
    columns and rows of one matrix. A file without a usable tap is left out if others measured the same points. One
    accelerometer, hit and moved in X, then in Y, gives the direct terms; the FRF states that the cross terms were
    not measured. The excitation point is taken from --points, --point, the recording's set-up, or the force
    channel.

    Parameters
    ----------
    recordings
        Recordings of hammer tests.
    out
        FRF file to write.
    points
        CSV or TOML table: excitation point and sensor positions of each file.
    point
        Excitation point of all recordings, such as `TCP:+X`; without it the point that each file states.
    segment : s
        Duration of a segment; without it the time between taps.
    pre_trigger : s
        Time before a tap's peak; without it twice the longest contact.
    force_window : s
        Time after the peak at which the force is cut off, or auto, or none.
    exponential : s
        Time constant of the exponential window, or auto (if responses have not decayed), or none.
    excitations
        Channels of the hammer; without it forces.
    responses
        Response channels; without it accelerations, velocities and displacements.
    band : Hz
        Lowest and highest frequency to keep; without it all lines with enough force.
    stream
        Sample clock; needed where a recording has several.

    Returns
    -------
    TapResult
        The FRF, the taps with the reason if one was left out, and the warnings.

    Raises
    ------
    InputError
        A recording or an option that cannot be used; recordings without a usable tap, or of different rates; entries
        without a tap that are no cross terms between directions.

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
    warnings = check_tap_recordings(paths, tests)
    detected = _each("finding taps", tests, found_taps)
    check_taps_found(detected)
    detected = _each("mains hum", detected, without_hum)
    segments = settings = choose_segments(
        detected, segment=segment, pre_trigger=pre_trigger, force_window=options.force_window_seconds
    )
    detected = _each("checking taps", detected, lambda test_taps: screened(test_taps, segments))
    warnings += check_taps_used(detected)
    usable = [each for each in detected if each.used]
    with progress("decay of the responses"):
        everything = _with_every_motion(detected, paths, options)
        decay = response_decay([each for each in everything if each.used], settings)
    constant = window_for(decay.left, settings) if options.time_constant is None else options.time_constant or None
    settings = replace(settings, time_constant=constant)
    places = {each.test.excitations[judged.tap.channel].degree_of_freedom for each in usable for judged in each.used}
    sums = _each("spectra of the taps", usable, lambda test_taps: tap_sums(test_taps, settings, band, places))
    merged = merge_taps(sums, settings.time_constant)
    warnings += [*subtracted_hum(detected), *tap_test_warnings(merged, usable, settings, decay)]
    result = TapResult(merged, tuple(detected), settings, decay, tuple(dict.fromkeys(warnings)), options)
    if out is not None:
        write_taps(out, result, paths)
    tell(lambda: {**frf_answer(result.frf), "segment_s": settings.duration})
    for summary in tap_tables(result):
        show(summary)
    warn(result.warnings)
    say_written([out], _in_words(result))
    return result


def _with_every_motion(detected: list[FoundTaps], paths: Sequence[Path], options: TapOptions) -> list[FoundTaps]:
    """Return the taps with all motions of their recordings, so that each choice of responses gets the same window.

    Otherwise FRFs of tip and sensor, made of the same taps, would have windows of different length, and could not be
    compared.
    """
    if not options.responses:
        return detected
    try:
        tests = tests_of(paths, replace(options, responses=()))
    except InputError:  # the responses that were named are no motions
        return detected
    return [without_hum(replace(taps, test=test, tones=())) for taps, test in zip(detected, tests, strict=True)]


def _in_words(result: "TapResult") -> str:
    """Describe FRF, band, segments and window in one line."""
    frf, tau = result.frf, result.settings.time_constant
    window = "" if tau is None else f"; exponential window of {tau:.4g} s, whose damping the fit subtracts"
    known = "no common band" if frf.band is None else f"band {frf.band[0]:.4g} to {frf.band[1]:.4g} Hz"
    unmeasured = f"; not measured and 0: {frf.unmeasured}" if frf.measured is not None else ""
    return f"{size_of(frf)}, {known}, segments of {result.settings.duration:.4g} s{window}{unmeasured}"


@dataclass(frozen=True, eq=False, repr=False)
class TapResult(Result):
    """An FRF of hammer tests with its taps and settings.

    Parameters
    ----------
    merged
        The FRF, in the recordings' own quantity, and the band of each excitation.
    found
        Taps of each test, with the reason if one was left out.
    settings
        Segments and windows.
    decay
        Share of the responses that remains at the end of the segments, before the exponential window.
    warnings
        Warnings, one sentence each.
    options
        Options of the step.
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
        """Draw entries of the FRF and return the axes; see ``draw_frf`` for the choices."""
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


def _each(title: str, items: Sequence[Item], work: Callable[[Item], Outcome]) -> list[Outcome]:
    """Apply a function to each item, and show the progress."""
    outcomes = []
    with progress(title, len(items)) as update:
        for number, item in enumerate(items):
            outcomes.append(work(item))
            update(number + 1)
    return outcomes


def write_taps(
    path: str | os.PathLike[str],
    result: TapResult,
    recordings: Sequence[str | os.PathLike[str]],
) -> None:
    """Write the FRF, with each tap that was found and the reason if it was left out."""
    options = result.options
    used = sum(len(each.used) for each in result.found)
    tables = [] if options.points is None else [options.points]
    gone = subtracted_hum(result.found)  # no doubt about the FRF
    provenance = {
        "step": "tap",
        "sources": sources([*recordings, *tables]),
        "options": asdict(options) | {"points": None if options.points is None else options.points.name},
        "settings": asdict(result.settings) | {"segment_s": result.settings.duration},
        "left_at_segment_end": asdict(result.decay),
        "taps": [tap for each in result.found for tap in _taps(each)],
        "bands_hz": result.merged.bands,
        "warnings": [text for text in result.warnings if text not in gone],
        "subtracted": gone,
        "versions": versions(),
    }
    hit = len({each.test.path for each in result.found if each.used})
    title = f"H1 of {used} taps in {counted(hit, 'recording')}"
    write_frf(path, result.merged.frf, title=title, provenance=json.dumps(provenance))


def _taps(test_taps: FoundTaps) -> list[dict[str, object]]:
    return [
        {
            "file": test_taps.test.path.name,
            "time_s": round(test_taps.time(judged), 6),
            "hit": test_taps.test.excitations[judged.tap.channel].degree_of_freedom,
            "peak_n": judged.tap.peak,
            "contact_s": judged.tap.contact,
            "left_out": judged.reason,
        }
        for judged in test_taps.taps
    ]


def tap_tables(result: TapResult) -> tuple[Table, ...]:
    """Tables of the taps of each file, of those left out, and of averages and band of each excitation point."""
    tables = [_file_table(result.found)]
    left_out = [(each, judged) for each in result.found for judged in each.taps if judged.reason]
    if left_out:
        rows = [
            (each.test.path.name, f"{each.time(judged):.3f}", f"{abs(judged.tap.peak):.4g}", judged.reason)
            for each, judged in left_out[: STEPS.rows_shown]
        ]
        more = len(left_out) - STEPS.rows_shown
        note = f" (the first {STEPS.rows_shown} of {len(left_out)})" if more > 0 else ""
        tables.append(Table(f"Taps left out{note}", ("file", "time (s)", "peak (N)", "why"), tuple(rows)))
    return (*tables, _point_table(result))


def _file_table(detected: Sequence[FoundTaps]) -> Table:
    rows = []
    for each in detected[: STEPS.rows_shown]:
        hit = dict.fromkeys(each.test.excitations[judged.tap.channel].degree_of_freedom for judged in each.used)
        peaks = [abs(judged.tap.peak) for judged in each.used]
        contacts = [1e3 * judged.tap.contact for judged in each.used]
        rows.append(
            (
                each.test.path.name,
                ", ".join(hit),
                str(len(each.taps)),
                str(len(each.used)),
                f"{min(peaks):.4g} to {max(peaks):.4g}" if peaks else "-",
                f"{np.median(contacts):.3g}" if peaks else "-",
            )
        )
    note = f" (the first {STEPS.rows_shown} of {len(detected)} tests)" if len(detected) > STEPS.rows_shown else ""
    columns = ("file", "hit at", "taps found", "used", "peaks (N)", "contact (ms)")
    return Table(f"Taps{note}", columns, tuple(rows))


def _point_table(result: TapResult) -> Table:
    frf, rows = result.merged.frf, []
    assert frf.averages is not None
    for q, label in enumerate(frf.excitations[: STEPS.rows_shown]):
        averages = frf.averages[:, q] if frf.measured is None else frf.averages[frf.measured[:, q], q]
        few, many = int(averages.min()), int(averages.max())
        band = result.merged.bands[label]
        in_band = frf.valid & (frf.frequencies > 0)
        if band is not None:
            in_band &= (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
        has_coherence = frf.coherence is not None and np.isfinite(frf.coherence[in_band][:, :, q]).any()
        rows.append(
            (
                label,
                str(few) if few == many else f"{few} to {many}",
                "none" if band is None else f"{band[0]:.4g} to {band[1]:.4g}",
                f"{np.nanmedian(frf.coherence[in_band][:, :, q]):.4f}"
                if has_coherence and frf.coherence is not None
                else "",
            )
        )
    note = (
        f" (the first {STEPS.rows_shown} of {len(frf.excitations)})" if len(frf.excitations) > STEPS.rows_shown else ""
    )
    columns = ("hit at", "averages", "force within 20 dB (Hz)", "median coherence there")
    return Table(f"Points hit{note}", columns, tuple(rows))
