"""`millfrf estimate`: FRF matrix from one or many recordings."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import Band, Output, Responding, Stream, check_band, check_output, echo_warnings, names, size_of


def estimate(
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings of one set-up.")],
    out: Output,
    segment: Annotated[float, typer.Option("--segment", help="Duration of a segment, s.")] = 8.0,
    overlap: Annotated[float, typer.Option("--overlap", help="Share of a segment shared with the next.")] = 0.5,
    window: Annotated[str, typer.Option("--window", help="hann, hamming or boxcar.")] = "hann",
    stack: Annotated[str, typer.Option("--stack", help="How tests are stacked: sum or side-by-side.")] = "sum",
    excitation: Annotated[
        list[str] | None, typer.Option("--excitation", help="Channel that excites; repeat, or separate by commas.")
    ] = None,
    response: Responding = None,
    band: Band = None,
    stream: Stream = None,
    estimator: Annotated[
        str, typer.Option("--estimator", help="h1, h2, hv, instrumental-variable or local-polynomial.")
    ] = "h1",
    exclude: Annotated[
        bool, typer.Option("--exclude", help="Leave out segments with overload, clipping or dropped samples.")
    ] = False,
    instrument: Annotated[
        list[str] | None,
        typer.Option("--instrument", help="Channel that drives the forces; of that estimator."),
    ] = None,
) -> None:
    """FRF matrix over one or many tests, with coherence and covariance.

    Without names, forces and voltages excite; accelerations, velocities and displacements respond. --band keeps only
    those lines.

    h1: noise on responses. h2: on excitations. hv: on both. instrumental-variable: a disturbance moves the structure
    and, by feedback, the force; --instrument names what it does not reach. local-polynomial: whole records instead of
    segments, without leakage, for short records and forces that are rough in frequency.
    """
    from millfrf.core.progress import bar
    from millfrf.steps.answers import frf_answer
    from millfrf.steps.estimate import write_estimate
    from millfrf.steps.face_estimate import estimate as estimate_frf

    check_output(out, (".h5", ".hdf5"), recordings)
    result = estimate_frf(
        *recordings,
        segment=segment,
        overlap=overlap,
        window=window,
        stack=stack,
        excitations=names(excitation),
        responses=names(response),
        band=check_band(band),
        stream=stream,
        estimator=estimator.replace("_", "-"),
        exclude=exclude,
        instruments=names(instrument),
        progress=bar,
    )
    write_estimate(out, result, recordings)
    echo_warnings(result.warnings)
    frf = result.frf
    tell(lambda: frf_answer(frf))
    say(f"wrote {out}: {size_of(frf)}, {frf.frequencies[0]:g} to {frf.frequencies[-1]:g} Hz")
