"""`millfrf convert`: files of other programs into recordings, and recordings into other files."""

from pathlib import Path
from typing import Annotated

import typer

from .options import check_output


def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="File to read.")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="File to write; its suffix says the format.")],
    mapping: Annotated[
        Path | None, typer.Option("--map", metavar="MAP.toml", help="Which array or column is which channel.")
    ] = None,
) -> None:
    """Convert by suffix: recordings .h5 .npz .npy .mat .tdms .csv .wav .uff into .h5 .npz .mat .csv; FRFs .h5 into
    .uff and back; modal models .json into .uff and back; CAN logs .blf .asc into the events of a recording.
    """
    from acquisition import convert as convert_file
    from acquisition.conversion.can_log import SUFFIXES as CAN_LOGS
    from acquisition.conversion.can_log import add_can_log
    from foundation import InputError

    from ..chain.convert_uff import convert_uff, is_uff_conversion
    from ..gate import doubts_of_rate
    from ..progress import bar

    if source.suffix.lower() in CAN_LOGS:
        if mapping is None:
            raise InputError(f"{source} needs --map MAP.toml with recording, dbc and signals")
        with bar(f"adding {source.name}") as update:
            typer.echo(f"wrote {add_can_log(source, target, mapping, update)}")
        return
    if mapping is None and is_uff_conversion(source, target):
        check_output(target, (".h5", ".hdf5", ".json", ".uff", ".unv"))
        convert_uff(source, target)
        typer.echo(f"wrote {target}")
        return

    with bar(f"converting {source.name}") as update:
        written = convert_file(source, target, mapping, progress=update)
    for path in written:
        for doubt in doubts_of_rate(path):
            typer.echo(f"warning: {doubt}", err=True)
        typer.echo(f"wrote {path}")
