"""`millfrf cut`: measured cutting forces against those of a cutting file."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import FigureFormat, Figures
from ..usage import framed

cut_app = typer.Typer(
    name="cut",
    help="The cutting process: measured forces against those that a cutting file computes.",
    add_completion=False,
    rich_markup_mode=None,
)


@cut_app.callback()
def _group() -> None:
    """Keeps `diagnose` a verb of the group while it is the only one."""


def diagnose(
    cutting: Annotated[Path, typer.Argument(metavar="CUT.toml", help="Cutter, engagement, coefficients.")],
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings of that cut.")],
    depth: Annotated[float, typer.Option("--depth", metavar="M", help="Axial depth of the cut, m.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for diagnosis.json, the cut and a report.")],
    speed: Annotated[
        float | None,
        typer.Option("--speed", metavar="RPM", help="Spindle speed within 2 %; default: as the recording states it."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="MODEL.json", help="Receptance of the tip, where no motion was measured there."
        ),
    ] = None,
    coefficient_error: Annotated[
        float, typer.Option("--coefficient-error", help="What a lab's force coefficients are off, a share.")
    ] = 0.15,
    force_error: Annotated[
        float, typer.Option("--force-error", help="What each line of a right computed force is off, a share.")
    ] = 0.01,
    stream: Annotated[str | None, typer.Option("--stream", help="Sample clock.")] = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
) -> None:
    """Which physics does the computed cutting force leave out: runout, regenerative feedback, process damping?"""
    from millfrf.report.results_page import asked_figures
    from millfrf.steps.answers import stored_answer
    from millfrf.steps.cut_diagnose import Asking, diagnose_cut_files

    asking = Asking(depth, speed, model, coefficient_error, force_error, stream)
    drawn = asked_figures(figures, figure_format)
    for line in diagnose_cut_files(cutting, recordings, out, asking, drawn):
        say(line)
    tell(lambda: {"diagnosis": stored_answer(out / "diagnosis.json")})


cut_app.command("diagnose")(framed("cut diagnose", diagnose))
