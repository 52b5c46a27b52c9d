"""`record`: the blocks and events of a source, written to a recording."""

import math
import os
from collections.abc import Callable
from typing import Literal

from ..settings import SETTINGS
from ..sources.source import Block, Events, Source, announced_events
from .recording_writer import RecordingWriter


def record(
    source: Source,
    path: str | os.PathLike[str],
    *,
    dtype: Literal["float32", "float64"] = "float32",
    progress: Callable[[int], None] | None = None,
    stop: Callable[[], bool] | None = None,
    observer: Callable[[Block | Events], None] | None = None,
    spare_bytes: int = SETTINGS.recording_spare_bytes,
    provenance: str = "",
    overwrite: bool = False,
) -> None:
    """Write the blocks and events of ``source`` to a new recording until it ends or ``stop`` returns True.

    Whatever happens (a device unplugged, a full disk, Ctrl-C), source and file are closed, the file is readable and its
    attribute ``ending`` says what happened. It is marked complete only if the recording ended in order.

    Parameters
    ----------
    source
        Source of samples, not yet open.
    path
        New file to write.
    dtype
        Type of the stored samples.
    progress
        Function that is called with the number of samples written so far, over all streams.
    stop
        Function that is called before each block; True ends the recording in order.
    observer
        Function that is called with every block and event after it was written; it must return quickly.
    spare_bytes
        Disk space in bytes that is reserved, so that the file is not lost when the disk is full.
    provenance
        Origin of the recording as JSON text.
    overwrite
        Whether an existing recording is replaced, unless it is being written.

    Raises
    ------
    InputError
        The file exists or cannot be written, or the source gave samples that are not finite.
    DeviceError
        Overrun, Disconnected or DeviceTimeout of a device.
    DiskFull, DiskError
        No room is left, or the disk failed, or another program removed or replaced the file.
    """
    try:
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
            source.open()
            written = 0
            while not (stop is not None and stop()) and (item := source.read()) is not None:
                written += _write(writer, item)
                if observer is not None:
                    observer(item)
                if progress is not None:
                    progress(written)
    finally:  # the file is closed first: devices may take their time
        source.close()


def _write(writer: RecordingWriter, item: Block | Events) -> int:
    """Write a block or events of a source; return the number of samples."""
    if isinstance(item, Events):
        writer.append_events(item)
        return 0
    writer.append(item.stream, item.samples, item.first_sample)
    if math.isfinite(item.host_time):
        last = item.first_sample + len(item.samples)
        writer.append_clock_pair(item.stream, last if item.host_sample is None else item.host_sample, item.host_time)
    return len(item.samples)
