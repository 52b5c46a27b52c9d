"""Step ``recover``: what is sound of a recording that was left open or damaged."""

from pathlib import Path
from typing import Annotated

from acquisition import Recovered
from acquisition import recover as recover_file
from millfrf.core import free_name
from millfrf.core.progress import progress
from millfrf.core.provenance import made
from millfrf.core.steps import File, Reads, Writes, step
from millfrf.core.terminal import say, say_written, tell


@step
def recover(
    recording: Annotated[File, Reads("REC.h5")],
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".h5", ".hdf5"))] = None,
) -> Recovered:
    """Copy what is sound of a recording into a new one: after a kill, a power failure, or damage on the disk.

    Damaged samples are listed, and never copied; the old file is left as it is.

    Parameters
    ----------
    recording
        Recording that was left open or damaged.
    out
        File to write; without it REC.recovered.h5 in the same folder.

    Returns
    -------
    Recovered
        What was copied, and what is damaged.

    Raises
    ------
    InputError
        A file that is no recording, or of which nothing is sound.

    Examples
    --------
    ::

        $ millfrf recover rec1.h5
    """
    source = Path(recording)
    target = free_name(source.with_name(f"{source.stem}.recovered.h5")) if out is None else Path(out)
    with progress(f"recovering {source.name}") as update:
        back = recover_file(source, target, progress=update, provenance=made("recover", [source]), overwrite=True)
    tell(lambda: _recovered(back))
    for line in recovered_lines(back):
        say(line)
    say_written([back.path])
    return back


def _recovered(back: Recovered) -> dict[str, object]:
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


def recovered_lines(back: Recovered) -> list[str]:
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
