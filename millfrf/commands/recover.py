"""`millfrf recover`: rescue a recording whose writer was killed."""

from pathlib import Path
from typing import Annotated

import typer


def recover(
    recording: Annotated[Path, typer.Argument(metavar="REC.h5", help="Recording whose writer was killed.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="File to write; else REC.recovered.h5 beside it.")
    ] = None,
) -> None:
    """Copy everything a killed writer had written into a new recording; the old file is left as it is."""
    from acquisition import recover as recover_file

    from ..options import check_output
    from ..progress import bar

    if out is not None:
        check_output(out, (".h5", ".hdf5"), [recording])
    with bar(f"recovering {recording.name}") as update:
        back = recover_file(recording, out, progress=update)
    for name, n_samples in back.samples.items():
        lost = f", {back.lost[name]} cut off" if back.lost[name] else ""
        typer.echo(f"stream {name}: {n_samples} samples{lost}")
    for name, n_events in back.events.items():
        typer.echo(f"events {name}: {n_events}")
    typer.echo(f"wrote {back.path}")
