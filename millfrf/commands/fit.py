"""`millfrf fit`: modal model of an FRF."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Output, check_output


def fit(
    frf: Annotated[Path, typer.Argument(metavar="FRF.h5", help="FRF made by estimate.")],
    out: Output,
    band: Annotated[tuple[float, float], typer.Option("--band", metavar="LO HI", help="Frequency band, Hz.")],
    method: Annotated[str, typer.Option("--method", help="polyreference.")] = "polyreference",
    max_order: Annotated[int, typer.Option("--max-order", help="Highest model order.")] = 40,
    modes: Annotated[int | None, typer.Option("--modes", help="Modes to keep; default: as many as are found.")] = None,
) -> None:
    """Fit poles, vectors and residuals in a band, with a stabilisation chart that reports show."""
    from estimation import read_frf

    from ..chain.fit import FitOptions, fit_model, write_fit
    from ..progress import bar
    from ..tables import mode_table, show

    check_output(out, (".json",))
    options = FitOptions(band, method, max_order, modes)
    result = fit_model(read_frf(frf), options, bar)
    write_fit(out, result, [frf], options)
    for warning in result.warnings:
        typer.echo(f"warning: {warning}", err=True)
    show(mode_table(result.model))
    typer.echo(f"wrote {out}")
