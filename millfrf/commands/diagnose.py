"""`millfrf diagnose`: what a model leaves out of recordings."""

from pathlib import Path
from typing import Annotated

import typer


def diagnose(
    model: Annotated[Path, typer.Argument(metavar="MODEL.json", help="Nominal model at the measured places.")],
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings, best at several levels.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for diagnosis.json, model and report.")],
    lab_error: Annotated[
        tuple[float, float, float],
        typer.Option("--lab-error", help="What a lab's own fit is off: frequency, damping, shapes, as shares."),
    ] = (0.01, 0.12, 0.03),
    stream: Annotated[str | None, typer.Option("--stream", help="Sample clock.")] = None,
) -> None:
    """Locate where a model and recordings disagree, name the physics left out, model it, show that the fit improves."""
    from mismatch import LabError, Settings

    from ..chain.diagnose import diagnose_files
    from ..progress import bar

    result = diagnose_files(model, recordings, out, Settings(LabError(*lab_error)), stream=stream, watch=bar)
    for line in result.summary:
        typer.echo(line)
    typer.echo(f"wrote {', '.join(str(path) for path in result.written)}")
