"""Record: take every block a source gives and write it to a file."""

import math
import os
from collections.abc import Callable
from typing import Literal

from .recording_writer import RecordingWriter
from .source import Source


def record(
    source: Source,
    path: str | os.PathLike[str],
    *,
    dtype: Literal["float32", "float64"] = "float32",
    progress: Callable[[int], None] | None = None,
) -> None:
    """Write ``source`` to a new recording until it ends.

    Whatever happens (a device unplugged, Ctrl-C), the source is closed and the file is closed and readable,
    marked complete only when the source ended in order.

    Parameters
    ----------
    source
        Not yet open.
    path
        New file.
    dtype
        How samples are stored.
    progress
        Called with the number of samples written so far, over all streams.

    Raises
    ------
    InputError
        The file exists or cannot be written, or the source gave samples that are not finite.
    """
    with RecordingWriter(path, source.streams, title=source.title, setup=source.setup, dtype=dtype) as writer:
        try:
            source.open()
            written = 0
            while (block := source.read()) is not None:
                writer.append(block.stream, block.samples)
                if math.isfinite(block.host_time):
                    last = block.first_sample + len(block.samples)
                    writer.append_clock_pair(block.stream, last, block.host_time)
                written += len(block.samples)
                if progress is not None:
                    progress(written)
        finally:
            source.close()
