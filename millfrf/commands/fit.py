"""`millfrf fit`: modal model of an FRF or of recordings."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core import InputError
from millfrf.core.terminal import say, tell

from ..options import Output, Stream, check_band, check_output, echo_warnings, names


def fit(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FRF.h5|REC...", help="An FRF made by estimate, or recordings of one set-up."),
    ],
    out: Output,
    band: Annotated[tuple[float, float], typer.Option("--band", metavar="LO HI", help="Frequency band, Hz.")],
    method: Annotated[
        str | None, typer.Option("--method", help="polyreference (of an FRF) or subspace (of recordings).")
    ] = None,
    max_order: Annotated[int | None, typer.Option("--max-order", help="Highest model order.")] = None,
    modes: Annotated[int | None, typer.Option("--modes", help="Modes to keep; default: as many as are found.")] = None,
    excitation: Annotated[list[str] | None, typer.Option("--excitation", help="Channel of recordings.")] = None,
    response: Annotated[list[str] | None, typer.Option("--response", help="Channel of recordings.")] = None,
    stream: Stream = None,
    poles: Annotated[
        Path | None,
        typer.Option("--poles", metavar="FILE", help="Poles picked by hand: these, no other."),
    ] = None,
    refine: Annotated[bool, typer.Option("--refine", help="Refine picked poles; else they are kept.")] = False,
    candidates: Annotated[
        Path | None, typer.Option("--candidates", metavar="FILE.json", help="Write candidate poles for a picker.")
    ] = None,
    pick: Annotated[
        Path | None,
        typer.Option(
            "--pick", metavar="FILE.toml", help="Pick poles in the browser; the file is a choice for --poles."
        ),
    ] = None,
) -> None:
    """Fit poles, vectors and residuals in a band, with error bars and a stabilisation chart that reports show.

    Recordings are fitted as they are, tests stacked, without windows or leakage; that is the more accurate way for
    heavily damped modes. --poles fits exactly the poles that a file names; --candidates writes the poles to pick from;
    --pick shows them in the browser, and writes such a file.
    """
    from millfrf.core.progress import bar
    from millfrf.core.terminal import show
    from millfrf.live.picking_server import check_pick, pick_in_browser
    from millfrf.report.tables import error_table, mode_table
    from millfrf.steps.answers import model_answer
    from millfrf.steps.face_fit import fit as fit_model
    from millfrf.steps.fit import (
        POLYREFERENCE,
        SUBSPACE,
        FitOptions,
        check_candidates,
        picked_in_words,
        write_candidates,
        write_fit,
    )
    from modal_fit import ModalFit

    check_output(out, (".json",), [*files, *([poles] if poles else [])])
    if candidates is not None:
        check_candidates(candidates, out, poles, files)
    check_band(band)
    if modes is not None and modes < 1:
        raise InputError(f"--modes {modes}: give 1 or more, or leave it out to keep all that are found")
    if pick is not None:
        check_pick(pick, out, poles, candidates, files)
        poles = pick_in_browser(pick, files[0], FitOptions(band, max_order=max_order, n_modes=modes), bar)
    channels = (names(excitation), names(response))
    result = fit_model(
        *files,
        band=band,
        method=method,
        max_order=max_order,
        modes=modes,
        excitations=channels[0],
        responses=channels[1],
        stream=stream,
        poles=poles,
        refine=refine,
        progress=bar,
    )
    used_method = POLYREFERENCE if isinstance(result, ModalFit) else SUBSPACE
    used = FitOptions(band, used_method, max_order, modes, *channels, stream, poles, refine)
    write_fit(out, result, files, used)
    echo_warnings(result.warnings)
    tell(lambda: {"method": used_method, **model_answer(result.model)})
    show(mode_table(result.model))
    by_source = error_table(result.model)
    if by_source is not None:
        show(by_source)
    if isinstance(result, ModalFit) and poles is not None:
        say(picked_in_words(result, used))
    say(f"wrote {out}")
    if isinstance(result, ModalFit) and candidates is not None:
        say(f"wrote {candidates}: {write_candidates(candidates, result, files[0])} groups of poles to pick from")
