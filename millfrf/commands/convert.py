"""`millfrf convert`: files of other programs into recordings, FRFs, models and geometries, and back."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import check_output


def convert(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="IN... OUT", help="Files to read, and the file to write; suffixes say the format."),
    ],
    mapping: Annotated[
        Path | None, typer.Option("--map", metavar="MAP.toml", help="Which array or column is which channel or FRF.")
    ] = None,
    span: Annotated[
        tuple[float, float] | None, typer.Option("--span", metavar="LO HI", help="Part of a recording to keep, s.")
    ] = None,
) -> None:
    """Convert by suffix: recordings .h5 .npz .npy .mat .tdms .csv .wav .uff into .h5 .npz .mat .csv; FRFs .uff .unv
    .mat .npz .csv .txt .gz (several files make one matrix) into .h5 .uff; modal models .json into .uff and back;
    geometries .uff .unv .csv into .toml; CAN logs .blf .asc into the events of a recording.
    """
    from acquisition import SUFFIXES as CAN_LOGS
    from acquisition import add_can_log
    from millfrf.core import InputError, refuse_replacing
    from millfrf.core.progress import bar
    from millfrf.core.provenance import made
    from millfrf.steps.convert import FRF_SUFFIXES, convert_files, is_frf_conversion, is_uff_conversion

    if len(files) < 2:
        raise InputError(f"{files[0]} alone: give files to read and a file to write: millfrf convert IN... OUT")
    *sources, target = files
    if not any(one.exists() and target.exists() and target.samefile(one) for one in sources):
        refuse_replacing(target)
    if sources[0].suffix.lower() in CAN_LOGS and not is_frf_conversion(sources, mapping):
        if mapping is None:
            raise InputError(f"{sources[0]} needs --map MAP.toml with recording, dbc and signals")
        with bar(f"adding {sources[0].name}") as update:
            origin = made("convert", [sources[0], mapping])
            say(f"wrote {add_can_log(sources[0], target, mapping, update, origin)}")
        return
    if is_frf_conversion(sources, mapping):
        check_output(target, FRF_SUFFIXES, sources)
    elif mapping is None and is_uff_conversion(sources[0], target):
        check_output(target, (*FRF_SUFFIXES, ".json", ".toml"), sources)
    with bar(f"converting {sources[0].name}") as update:
        written, told = convert_files(sources, target, mapping, update, span)
    tell(lambda: {"inferred": told.inferred})
    for text in told.inferred:
        say(f"note: {text}")
    for text in told.doubts:
        say(f"warning: {text}")
    for path in written:
        say(f"wrote {path}")
