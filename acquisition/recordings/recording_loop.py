"""Recording: every block and event of a source is written to a file."""

import math
import os
from collections.abc import Callable
from typing import Literal

from ..sources.source import Block, Events, Source, announced_events
from .recording_writer import RecordingWriter

SPARE_BYTES = 16_000_000
"""Disk space kept aside while recording, so that a full disk does not cost the file."""


def record(
    source: Source,
    path: str | os.PathLike[str],
    *,
    dtype: Literal["float32", "float64"] = "float32",
    progress: Callable[[int], None] | None = None,
    stop: Callable[[], bool] | None = None,
    observer: Callable[[Block | Events], None] | None = None,
    spare_bytes: int = SPARE_BYTES,
    provenance: str = "",
    overwrite: bool = False,
) -> None:
    """Write ``source`` to a new recording until it ends or ``stop`` says so.

    Whatever happens (a device unplugged, a full disk, Ctrl-C), the source and the file are closed, the file is readable
    and its attribute ``ending`` says what happened; it is marked complete only when it ended in order.

    Parameters
    ----------
    source
        Source of samples, not yet open.
    path
        New file to write.
    dtype
        Number format in which samples are stored.
    progress
        Called with the number of samples written so far, over all streams.
    stop
        Function that is asked before each block; True ends the recording in order.
    observer
        Shown every block and event after it was written; it must return quickly.
    spare_bytes
        Disk space kept aside, in bytes.
    provenance
        Where the recording comes from, as JSON text.
    overwrite
        Whether a recording of that name may be replaced, unless it is being written.

    Raises
    ------
    InputError
        The file exists or cannot be written, or the source gave samples that are not finite.
    DeviceError
        Overrun, Disconnected or DeviceTimeout of a device.
    DiskFull
        No room was left.
    """
    with RecordingWriter(
        path,
        source.streams,
        title=source.title,
        setup=source.setup,
        dtype=dtype,
        event_axes=announced_events(source),
        spare_bytes=spare_bytes,
        provenance=provenance,
        overwrite=overwrite,
    ) as writer:
        try:
            source.open()
            written = 0
            while not (stop is not None and stop()) and (taken := source.read()) is not None:
                written += _write(writer, taken)
                if observer is not None:
                    observer(taken)
                if progress is not None:
                    progress(written)
        finally:
            source.close()


def _write(writer: RecordingWriter, taken: Block | Events) -> int:
    """Write what a source gave; returns the number of samples."""
    if isinstance(taken, Events):
        writer.append_events(taken)
        return 0
    writer.append(taken.stream, taken.samples, taken.first_sample)
    if math.isfinite(taken.host_time):
        last = taken.first_sample + len(taken.samples)
        pair = last if taken.host_sample is None else taken.host_sample
        writer.append_clock_pair(taken.stream, pair, taken.host_time)
    return len(taken.samples)
