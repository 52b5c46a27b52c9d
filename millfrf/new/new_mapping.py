"""`millfrf new mapping`: the mapping that `millfrf convert` needs, filled in from a file."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say


def new_mapping(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Recording of another program: .mat .csv .npz ...")],
    out: Annotated[Path, typer.Option("--out", metavar="MAP.toml", help="Mapping to write.")],
) -> None:
    """Write a commented mapping with the columns, units and sample rate that a file tells."""
    from .mapping_file import mapping_for
    from .templates import write_new

    made = mapping_for(file)
    write_new(out, made.text)
    say(f"wrote {out}: {made.n_channels} channels; quantities and places are guessed from names, check them")
    if made.n_open:
        say(f"{made.n_open} places are open, each marked FILL IN; millfrf convert names what is missing")
    say(f"then: millfrf convert {file} recording.h5 --map {out}")
