"""`recover`: whatever a killed writer acknowledged, copied into a whole new recording."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from foundation import InputError, writing_whole_file

from ..file_safety import is_being_written
from ..sources import Events
from .recording import Recording
from .recording_writer import RecordingWriter
from .stream import Stream

_ROWS = 1 << 16


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery: the samples and events that came back.

    Parameters
    ----------
    path
        The new file.
    samples
        Rows by stream.
    events
        Values by series.
    lost
        Rows by stream that the file announced but does not hold whole; zero after a kill, more after a power failure.
    """

    path: Path
    samples: dict[str, int]
    events: dict[str, int]
    lost: dict[str, int]


def recover(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Recovered:
    """Copy a recording whose writer was killed into a new file that opens anywhere; the old one is left as it is.

    Parameters
    ----------
    path
        The recording left behind.
    out
        New file; None: ``REC.recovered.h5`` beside it.
    progress
        Called with the number of samples copied, over all streams.

    Raises
    ------
    InputError
        The file is still being written, was closed in order, or ``out`` exists.
    FileFormatError
        It is damaged beyond what a killed writer or a power failure leaves.
    """
    source = Path(path)
    target = Path(out) if out is not None else source.with_name(f"{source.stem}.recovered.h5")
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    if target.exists():
        raise InputError(f"{target} exists; choose another name as out (--out) or remove it first")
    if is_being_written(source):
        raise InputError(f"{source} is still being written; stop its writer first")
    with writing_whole_file(target) as temporary:
        return _copy(source, temporary, target, progress)


def _copy(source: Path, temporary: Path, target: Path, progress: Callable[[int], None] | None) -> Recovered:
    with Recording(source, accept_cut=True) as recording:
        if recording.complete:
            raise InputError(f"{source} was closed in order; there is nothing to recover")
        events = recording.events
        axes = {name: series.axis for name, series in events.items()}
        samples: dict[str, int] = {}
        lost: dict[str, int] = {}
        n_events: dict[str, int] = {}
        with RecordingWriter(
            temporary,
            [stream.description for stream in recording.streams.values()],
            title=recording.title,
            setup=recording.setup,
            dtype="float64" if any(s.dtype.itemsize == 8 for s in recording.streams.values()) else "float32",
            event_axes=axes,
            recorded_at=recording.recorded_at,
            overwrite=True,
        ) as writer:
            for name, stream in recording.streams.items():
                samples[name] = _copy_stream(stream, writer, source.stat().st_size, sum(samples.values()), progress)
                lost[name] = stream.n_samples - samples[name]
                writer.append_clock_pairs(name, recording.clock_pairs(name))
            for name, series in events.items():
                raw = series.read_raw()
                writer.append_events(Events(name, *raw, series.read_texts()))
                n_events[name] = len(raw[0])
            writer.close(complete=False, ending=f"recovered from {source.name}: its writer did not close it")
    return Recovered(target, samples, n_events, lost)


def _copy_stream(
    stream: Stream, writer: RecordingWriter, file_size: int, before: int, progress: Callable[[int], None] | None
) -> int:
    """Copy the rows that the file holds whole; returns how many."""
    whole = stream.whole_rows(file_size)
    for start in range(0, whole, _ROWS):
        stop = min(start + _ROWS, whole)
        writer.append(stream.name, stream.read(start, stop))
        if progress is not None:
            progress(before + stop)
    return whole
