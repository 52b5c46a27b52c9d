"""`millfrf recover`: rescue a recording that was left open or damaged."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from millfrf.core.terminal import answer, say, tell

if TYPE_CHECKING:
    from acquisition import Recovered


def recover(
    recording: Annotated[Path, typer.Argument(metavar="REC.h5", help="Recording that was left open or damaged.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="File to write; default: REC.recovered.h5 beside it.")
    ] = None,
    force: bool = False,
) -> None:
    """Copy what is sound of a recording into a new one: after a kill, a power failure, or damage on the disk.

    Damaged samples are listed, and never copied; the old file is left as it is.
    """
    from acquisition import recover as recover_file
    from millfrf.core import free_name
    from millfrf.core.progress import bar
    from millfrf.core.provenance import made

    from ..options import check_output

    if out is not None:
        check_output(out, (".h5", ".hdf5"), [recording])
    target = out or free_name(recording.with_name(f"{recording.stem}.recovered.h5"))
    with bar(f"recovering {recording.name}") as update:
        origin = made("recover", [recording])
        back = recover_file(recording, target, progress=update, provenance=origin, overwrite=force)
    tell(lambda: _recovered(back))
    for line in recovered_lines(back):
        answer(line)
    say(f"wrote {back.path}")


def _recovered(back: "Recovered") -> dict[str, object]:
    """What came back, for a script."""
    damaged = {
        name: [{"first_sample": one.first, "end_sample": one.end, "reason": one.reason} for one in rows]
        for name, rows in back.damaged.items()
    }
    return {
        "samples": back.samples,
        "damaged_samples": damaged,
        "events": back.events,
        "damaged_values": back.damaged_values,
        "has_checksums": back.has_checksums,
    }


def recovered_lines(back: "Recovered") -> list[str]:
    """What came back and what did not, line by line.

    Parameters
    ----------
    back
        Result of the recovery.
    """
    lines = []
    for name, n_samples in back.samples.items():
        lines.append(f"stream {name}: {n_samples} samples")
        for one in back.damaged[name]:
            where = "left out at the end" if one.first >= n_samples else "missing (NaN) in the new file"
            lines.append(f"  samples {one.first} to {one.end - 1}: {one.reason}; {where}")
    lines += [f"events {name}: {count}" for name, count in back.events.items()]
    lines += [f"{name}: {count} damaged values left out" for name, count in back.damaged_values.items()]
    if not back.has_checksums:
        lines.append("the file has no checksums (format version 1): damaged samples cannot be told from sound ones")
    return lines
