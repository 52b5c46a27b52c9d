"""`millfrf campaign`: hundreds of recordings through all jobs."""

from pathlib import Path
from typing import Annotated

import typer

FAILED = 1
"""Exit code where tasks are left that the next run tries again."""


def campaign(
    campaign: Annotated[Path, typer.Argument(metavar="CAMPAIGN.toml", help="Recordings, and the jobs to do.")],
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler; without it this machine does the work."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="Worker processes of this machine; 0: none, without Dask."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show the graph and its time; compute nothing.")] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of results; default: CAMPAIGN_results beside the file."),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Try again what was refused.")] = False,
) -> None:
    """Estimate, fit, calibrate, lobes, diagnose, learn and report over hundreds of recordings, on any number of cores.

    Results are kept by the content of their inputs: a second run computes only what is new or was left. What fails is
    listed with its reason and hides nothing else; exit code 1 says that tasks are left which the next run tries again.
    """
    from millfrf.campaign.campaign_run import RunOptions, dry_run_lines, run_campaign
    from millfrf.core.progress import bar
    from millfrf.core.terminal import say, show, tell
    from millfrf.steps.answers import tables_answer

    options = RunOptions(out or campaign.with_name(f"{campaign.stem}_results"), scheduler, workers, retry)
    if dry_run:
        table, lines = dry_run_lines(campaign, options, bar)
        tell(lambda: {"tasks": tables_answer([table]), "lines": lines})
        show(table)
        for line in lines:
            say(line)
        return
    found = run_campaign(campaign, options, bar)
    tell(lambda: {"tasks_run": found.ran, "tasks_settled": found.state.settled, "failures": found.failures})
    for line in found.failures:
        say(f"failed: {line}")
    for line in found.doubts:
        say(f"warning: {line}")
    for line in found.lines():
        say(line)
    if found.state.failed or found.state.full:
        raise typer.Exit(FAILED)
