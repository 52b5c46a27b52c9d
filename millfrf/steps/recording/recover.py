"""Step ``recover``: the intact samples of a recording that was left open or damaged."""

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
    """Copy the intact samples of a recording into a new one: after a kill, a power failure, or damage on the disk.

    Damaged samples are listed and never copied; the old file is not changed.

    Parameters
    ----------
    recording
        Recording that was left open or damaged.
    out
        File to write; without it REC.recovered.h5 in the same folder.

    Returns
    -------
    Recovered
        Samples that were copied, and samples that are damaged.

    Raises
    ------
    InputError
        A file that is no recording, or that has no intact sample.

    Examples
    --------
    ::

        $ millfrf recover rec1.h5
    """
    source = Path(recording)
    target = free_name(source.with_name(f"{source.stem}.recovered.h5")) if out is None else Path(out)
    with progress(f"recovering {source.name}") as update:
        recovered = recover_file(source, target, progress=update, provenance=made("recover", [source]), overwrite=True)
    tell(lambda: _recovered(recovered))
    for line in recovered_lines(recovered):
        say(line)
    say_written([recovered.path])
    return recovered


def _recovered(recovered: Recovered) -> dict[str, object]:
    """Return the numbers of recovered and of damaged samples for JSON."""
    damaged = {
        name: [{"first_sample": span.first, "end_sample": span.end, "reason": span.reason} for span in spans]
        for name, spans in recovered.damaged.items()
    }
    return {
        "samples": recovered.samples,
        "damaged_samples": damaged,
        "events": recovered.events,
        "damaged_values": recovered.damaged_values,
        "has_checksums": recovered.has_checksums,
        "notes": list(recovered.notes),
    }


def recovered_lines(recovered: Recovered) -> list[str]:
    """Counts of recovered and damaged samples, as lines for the terminal."""
    lines = []
    for name, n_samples in recovered.samples.items():
        lines.append(f"stream {name}: {n_samples} samples")
        for span in recovered.damaged[name]:
            where = "left out at the end" if span.first >= n_samples else "missing (NaN) in the new file"
            lines.append(f"  samples {span.first} to {span.end - 1}: {span.reason}; {where}")
    lines += [f"events {name}: {count}" for name, count in recovered.events.items()]
    lines += [f"{name}: {count} damaged values left out" for name, count in recovered.damaged_values.items()]
    lines += recovered.notes
    if not recovered.has_checksums:
        lines.append("the file has no checksums (format version 1): damaged samples cannot be detected")
    return lines
