"""`millfrf convert`: files of other programs into recordings, and recordings into other files."""

from pathlib import Path
from typing import Annotated

import typer


def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="File to read.")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="File to write; its suffix says the format.")],
    mapping: Annotated[
        Path | None, typer.Option("--map", metavar="MAP.toml", help="Which array or column is which channel.")
    ] = None,
) -> None:
    """Convert by suffix: .h5 .npz .npy .mat .csv into .h5 .npz .mat .csv."""
    from acquisition import convert as convert_file

    from ..progress import bar

    with bar(f"converting {source.name}") as update:
        written = convert_file(source, target, mapping, progress=update)
    for path in written:
        typer.echo(f"wrote {path}")
