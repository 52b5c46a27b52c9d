"""`millfrf diagnose`: what a model leaves out of recordings."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core import InputError
from millfrf.core.terminal import say, tell

from ..options import FigureFormat, Figures, check_band, check_shares


def diagnose(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="MODEL.json REC...", help="Nominal model, then recordings, best at several levels."),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for diagnosis.json, model and report.")],
    simulated: Annotated[
        Path | None,
        typer.Option(
            "--simulated", metavar="SIM.h5", help="Simulated recording to fit the nominal model from, in --band."
        ),
    ] = None,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option("--band", metavar="LO HI", help="Band that is compared, Hz; without it that of the model."),
    ] = None,
    lab_error: Annotated[
        tuple[float, float, float],
        typer.Option(
            "--lab-error",
            metavar="F D S",
            help="What a lab's own fit is off, as shares: frequency, damping, shapes; one number stands for all.",
        ),
    ] = (0.01, 0.12, 0.03),
    cutting: Annotated[
        Path | None, typer.Option("--cutting", metavar="CUT.toml", help="Cut whose stability lobes the report shows.")
    ] = None,
    search_time: Annotated[
        float,
        typer.Option("--search-time", metavar="SECONDS", help="Time after which no further cause is looked for, s."),
    ] = 120.0,
    stream: Annotated[str | None, typer.Option("--stream", help="Sample clock.")] = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
) -> None:
    """Locate where a model and recordings disagree, name the physics left out, model it, show that the fit improves."""
    from millfrf.core.progress import bar
    from millfrf.gate import read_checked_cutting
    from millfrf.mismatch import LabError, SearchSettings, Settings
    from millfrf.report.results_page import asked_figures
    from millfrf.steps.answers import stored_answer
    from millfrf.steps.diagnose import diagnose_files, nominal_from_simulation

    check_shares("--lab-error", lab_error, (0.01, 0.12, 0.03))
    check_band(band)
    if not search_time > 0:
        raise InputError(f"--search-time {search_time:g}: give a positive number of seconds, for example 300")
    drawn = asked_figures(figures, figure_format)
    model, recordings = (files[0], files[1:]) if simulated is None else (simulated, files)
    if not recordings:
        raise InputError("no recording given; name the nominal model and then one or more recordings")
    if simulated is not None:
        if band is None:
            raise InputError(
                "--simulated needs --band LO HI, the band in which the nominal model is fitted and compared"
            )
        model = nominal_from_simulation(simulated, band, out, stream=stream, progress=bar)
    process, doubts = read_checked_cutting(cutting) if cutting is not None else (None, [])
    for doubt in doubts:
        say(f"warning: {doubt}")
    settings = Settings(LabError(*lab_error), search=SearchSettings(longest=search_time))
    result = diagnose_files(
        model,
        recordings,
        out,
        settings,
        stream=stream,
        band=band,
        process=process,
        figures=drawn,
        progress=bar,
    )
    tell(lambda: {"diagnosis": stored_answer(result.written[0])})
    for line in result.summary:
        say(line)
    say(f"wrote {', '.join(str(path) for path in result.written)}")
