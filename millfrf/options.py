"""Options that several commands share, and small readers of what a user typed."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from millfrf.core import InputError
from millfrf.core.terminal import say

if TYPE_CHECKING:  # the commands start without loading the room of FRFs
    from estimation import Frf

Band = Annotated[tuple[float, float] | None, typer.Option("--band", metavar="LO HI", help="Frequency band, Hz.")]
Output = Annotated[Path, typer.Option("--out", metavar="FILE", help="File to write.")]
Figures = Annotated[
    Path | None, typer.Option("--figures", metavar="DIR", help="Folder for each figure as a file of its own.")
]
FigureFormat = Annotated[str, typer.Option("--figure-format", help="Format of --figures: svg, png or pdf.")]
Responding = Annotated[
    list[str] | None, typer.Option("--response", help="Channel that responds; repeat, or separate by commas.")
]
Stream = Annotated[str | None, typer.Option("--stream", help="Sample clock; needed where a recording has several.")]


def names(given: Sequence[str] | None) -> tuple[str, ...]:
    """Names given one by one or with commas.

    Examples
    --------
    >>> names(["fx,fy", "fz"])
    ('fx', 'fy', 'fz')
    """
    return tuple(name.strip() for text in given or () for name in text.split(",") if name.strip())


def check_band(band: tuple[float, float] | None) -> tuple[float, float] | None:
    """Refuse a band that is empty or negative.

    Raises
    ------
    InputError
        With the band and the remedy.
    """
    if band is not None and not 0 <= band[0] < band[1]:
        raise InputError(f"band {band[0]:g} to {band[1]:g} Hz is empty; give --band LO HI with 0 <= LO < HI")
    return band


def check_shares(option: str, given: tuple[float, ...], example: tuple[float, ...]) -> None:
    """Refuse errors that are no shares, such as percent.

    Raises
    ------
    InputError
        With the values and an example.
    """
    if not all(0 < share < 1 for share in given):
        typed, right = (" ".join(f"{share:g}" for share in shares) for shares in (given, example))
        raise InputError(
            f"{option} {typed}: give {len(given)} positive shares below 1 (0.12 is 12 %), for example {right}"
        )


def check_output(path: Path, suffixes: Sequence[str], inputs: Sequence[Path] = ()) -> None:
    """Refuse a name that cannot be written, before anything is computed.

    Parameters
    ----------
    path
        Name of the output as it was typed.
    suffixes
        Suffixes that the command writes.
    inputs
        Files that the command reads, none of which it may overwrite.

    Raises
    ------
    InputError
        A folder that is not there, a suffix that says another format, or one of the inputs.
    """
    if path.suffix.lower() not in suffixes:
        raise InputError(
            f"cannot write {path}: this command writes {' or '.join(suffixes)}; change the suffix of --out"
        )
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: folder {path.parent} does not exist; create it first")
    if path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder; give a file name")
    if any(one.exists() and path.exists() and path.samefile(one) for one in inputs):
        raise InputError(f"{path} is the input itself; choose another --out")


def echo_warnings(warnings: Iterable[str]) -> None:
    """Print each warning as one line on standard error."""
    for warning in warnings:
        say(f"warning: {warning}")


def size_of(frf: "Frf") -> str:
    """Say in words what an FRF matrix holds: quantity, responses, excitations, valid lines."""
    return (
        f"{frf.quantity}, {len(frf.responses)} responses x {len(frf.excitations)} excitations, "
        f"{int(frf.valid.sum())} of {len(frf.frequencies)} lines valid"
    )
