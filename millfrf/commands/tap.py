"""`millfrf tap`: FRF matrix from recordings of hammer tests."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import Band, Output, Responding, Stream, check_band, check_output, echo_warnings, names, size_of


def tap(
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings of hammer tests.")],
    out: Output,
    points: Annotated[
        Path | None,
        typer.Option(
            "--points",
            metavar="TABLE",
            help="CSV or TOML: point hit, and where sensors stood, in each file.",
        ),
    ] = None,
    point: Annotated[
        str, typer.Option("--point", metavar="NODE:DIRECTION", help="Point hit in all recordings, such as TCP:+X.")
    ] = "",
    segment: Annotated[
        float | None, typer.Option("--segment", help="Duration of a segment, s. Default: the time between taps.")
    ] = None,
    pre_trigger: Annotated[
        float | None, typer.Option("--pre-trigger", help="Time before a tap's peak, s. Default: two contacts.")
    ] = None,
    force_window: Annotated[
        str, typer.Option("--force-window", help="auto, none, or the time after the peak when the force is cut off, s.")
    ] = "auto",
    exponential: Annotated[
        str,
        typer.Option("--exponential", help="auto (where answers have not died out), none, or time constant, s."),
    ] = "auto",
    excitation: Annotated[
        list[str] | None, typer.Option("--excitation", help="Channel of the hammer; repeat, or separate by commas.")
    ] = None,
    response: Responding = None,
    band: Band = None,
    stream: Stream = None,
) -> None:
    """FRF matrix of hammer tests, roving hammer or roving sensor, with coherence of each entry.

    Taps are found; double hits, overloads and taps without room for a segment are left out and listed. Files that hit
    one point are averaged; files that hit or measure different points become columns and rows of one matrix. Which
    point was hit is taken from --points, --point, the recording's set-up, or the force channel.
    """
    from millfrf.core.progress import bar
    from millfrf.core.terminal import show
    from millfrf.steps.answers import frf_answer
    from millfrf.steps.face_estimate import tap as frf_of_taps
    from millfrf.steps.tap import tap_tables, write_taps

    check_output(out, (".h5", ".hdf5"), [*recordings, *([points] if points else [])])
    result = frf_of_taps(
        *recordings,
        point=point,
        points=points,
        segment=segment,
        pre_trigger=pre_trigger,
        force_window=force_window,
        exponential=exponential,
        excitations=names(excitation),
        responses=names(response),
        band=check_band(band),
        stream=stream,
        progress=bar,
    )
    write_taps(out, result, recordings)
    tell(lambda: {**frf_answer(result.frf), "segment_s": result.settings.duration})
    for table in tap_tables(result):
        show(table)
    echo_warnings(result.warnings)
    frf, tau = result.frf, result.settings.time_constant
    window = "" if tau is None else f"; exponential window of {tau:.4g} s, whose damping the fit takes off"
    known = "no common band" if frf.band is None else f"band {frf.band[0]:.4g} to {frf.band[1]:.4g} Hz"
    say(f"wrote {out}: {size_of(frf)}, {known}, segments of {result.settings.duration:.4g} s{window}")
