"""`millfrf demo`: the whole chain on the simulated cell."""

from pathlib import Path
from typing import Annotated

import typer


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for all results.")] = Path("millfrf-demo"),
    noise: Annotated[float, typer.Option("--noise", help="Noise of every sensor, as a share of its signal.")] = 0.01,
    seed: Annotated[int, typer.Option("--seed", help="Of noise and taps.")] = 0,
) -> None:
    """Mill, record, estimate, fit, calibrate, draw the lobes and report, without hardware, in under a minute."""
    from ..demonstration import DemoOptions, comparison_tables, run_demo
    from ..progress import bar
    from ..tables import show

    result = run_demo(DemoOptions(out, noise, seed), bar, typer.echo)
    for table in comparison_tables(result):
        show(table)
    typer.echo(f"report: {result.report.resolve()}")
