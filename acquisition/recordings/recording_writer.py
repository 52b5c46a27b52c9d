"""`RecordingWriter`: a recording written block by block, readable after a crash; `record` writes a source with it."""

import datetime
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import DiskFull, InputError, Real, command, is_disk_full

from ..settings import SETTINGS
from ..sources.source import (
    SAMPLES_AXIS,
    Block,
    EventAxis,
    Events,
    Overrun,
    Source,
    StreamDescription,
    announced_events,
    stored_texts,
)
from .durability import SpareSpace, Syncer, is_being_written
from .recording_format import ENDING_BYTES, FORMAT, FORMAT_VERSION
from .tables import NewRows, Tables, append_rows, make_events, make_stream, missing_rows, sample_rows, summed_rows


class RecordingWriter:
    """Writes a recording in place.

    Appended rows survive if the writer is killed after ``append`` returned, and are on the disk about a second later.
    Every dataset is created when the file is opened, and the file is then switched to single-writer, multiple-reader
    mode: a writer that is killed leaves a readable file that lacks at most the current block.

    Parameters
    ----------
    path
        New file; an existing one is refused unless ``overwrite``.
    streams
        The sample clocks.
    title, setup
        Title of the recording; tool, cut and pose as TOML text.
    dtype
        Type of the stored samples, ``float32`` or ``float64``.
    block_length
        Number of rows in a chunk.
    event_names
        Names of the event series whose times are on the samples' axis.
    event_axes
        Clock of each event series whose times are not on the samples' axis.
    recorded_at
        Time of the recording, ISO 8601 UTC, empty if it is not known; None: now.
    provenance
        Origin of the recording as JSON text: files with hashes, options, versions.
    overwrite
        Whether an existing file is replaced, unless it is being written.
    spare_bytes
        Disk space that is reserved so that the file can be closed when the disk is full; 0: none.

    Raises
    ------
    InputError
        The file exists, its folder does not, there is no room, streams share a name, or a text holds a zero character.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        streams: Sequence[StreamDescription],
        *,
        title: str = "",
        setup: str = "",
        dtype: Literal["float32", "float64"] = "float32",
        block_length: int = 4096,
        event_names: Sequence[str] = (),
        event_axes: Mapping[str, EventAxis] | None = None,
        recorded_at: str | None = None,
        provenance: str = "",
        overwrite: bool = False,
        spare_bytes: int = 0,
    ) -> None:
        self.path = Path(path)
        self.streams = {stream.name: stream for stream in streams}
        if not streams or len(self.streams) != len(streams):
            raise InputError(
                f"a recording needs streams of different names, got {[s.name for s in streams]}; name each once"
            )
        for name, text in {"title": title, "setup": setup, "recorded_at": recorded_at or ""}.items():
            if (place := text.find("\0")) >= 0:  # HDF5 cannot store it
                raise InputError(f"the recording's {name} holds a zero character at place {place}; leave it out")
        self._file = self._create(overwrite)
        self._spare: SpareSpace | None = None
        try:
            self._spare = SpareSpace(self.path.parent, spare_bytes) if spare_bytes else None
        except BaseException:
            self._file.close()
            self.path.unlink()
            raise
        self._event_axes = dict.fromkeys(event_names, SAMPLES_AXIS) | dict(event_axes or {})
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        time = now if recorded_at is None else recorded_at
        texts = {"title": title, "recorded_at": time, "setup": setup, "provenance": provenance}
        self._file.attrs.update({"format": FORMAT, "format_version": FORMAT_VERSION, **texts})
        self._file.attrs["complete"] = np.bool_(False)
        self._file.attrs["ending"] = np.array(b"", f"S{ENDING_BYTES}")
        self._stream_tables = {s.name: make_stream(self._file, s, dtype, block_length) for s in streams}
        self._event_tables = {name: make_events(self._file, name, axis) for name, axis in self._event_axes.items()}
        self._file.swmr_mode = True
        self._file.flush()
        self._syncer = Syncer(self.path)

    def _create(self, overwrite: bool) -> h5py.File:
        if not self.path.parent.is_dir():
            raise InputError(f"cannot write {self.path}: folder {self.path.parent} does not exist; create it first")
        if overwrite and self.path.is_file() and is_being_written(self.path):
            raise InputError(f"{self.path} is being written by another program; choose another name or wait for it")
        try:
            # With pages of 4096 bytes, the metadata of a small table lie in one page, which a failing disk writes as a
            # whole or not at all (docs/decisions/0021-checked-recordings.md).
            paging = {"fs_strategy": "page", "fs_page_size": 4096}
            return h5py.File(self.path, "w" if overwrite else "x", libver="latest", **paging)
        except FileExistsError as error:
            raise InputError(f"{self.path} exists; choose another name or remove it first") from error
        except OSError as error:
            raise InputError(f"cannot write {self.path}: {error}; choose another name or close its writer") from error

    def append(self, stream: str, samples: NDArray[np.floating], first_sample: int | None = None) -> None:
        """Append rows to a stream.

        Parameters
        ----------
        stream
            Name of the stream.
        samples : (n_samples, n_channels)
            Rows in SI units.
        first_sample
            Number of the first row since the recording began, as the device counts; None: the device does not count.

        Raises
        ------
        InputError
            Unknown stream, wrong number of columns, or samples that are not finite.
        Overrun
            The rows do not follow those before: samples are missing, or come twice.
        DiskFull
            No room is left.
        """
        description, tables = self._checked_stream(stream, samples)
        if first_sample is not None:
            self._check_order(stream, first_sample, tables["samples"].shape[0])
        if not np.isfinite(samples).all():
            column = int(np.argmax(~np.isfinite(samples).all(axis=0)))
            raise InputError(
                f"channel {description.channels[column].name} holds NaN or infinity; correct the data or its conversion"
            )
        self._append(sample_rows(tables, samples))

    def append_with_missing(self, stream: str, samples: NDArray[np.floating], reason: str) -> None:
        """Append rows of which some are missing: rows with NaN or infinity are listed in the file with the reason.

        Parameters
        ----------
        stream
            Name of the stream.
        samples : (n_samples, n_channels)
            Rows in SI units.
        reason
            Why rows are missing, in a few words.

        Raises
        ------
        InputError
            Unknown stream, or wrong number of columns.
        DiskFull
            No room is left.
        """
        _, tables = self._checked_stream(stream, samples)
        missing = missing_rows(tables, samples, reason)
        self._append(sample_rows(tables, samples))
        self._append(missing)

    def _append(self, rows: NewRows) -> None:
        append_rows(rows, self._spare, self.path)

    def _checked_stream(self, stream: str, samples: NDArray[np.floating]) -> tuple[StreamDescription, Tables]:
        description = self._description(stream)
        if samples.ndim != 2 or samples.shape[1] != len(description.channels):
            raise InputError(
                f"block of shape {samples.shape} for stream {description.name}, expected {len(description.channels)} "
                "columns; give one a channel"
            )
        return description, self._stream_tables[stream]

    def _check_order(self, stream: str, first_sample: int, written: int) -> None:
        if first_sample > written:
            missing = first_sample - written
            raise Overrun(
                f"stream {stream}: {missing} samples are missing after sample {written}; the recording ends there; "
                "use a larger buffer or fewer channels",
                missing,
            )
        if first_sample < written:
            raise Overrun(
                f"stream {stream}: a block begins at sample {first_sample} though {written} are written; the driver "
                "gives samples twice, the recording ends there",
                0,
            )

    def append_event(self, name: str, time: float | NDArray[np.floating], value: float | NDArray[np.floating]) -> None:
        """Append one value at ``time`` (s) on the samples' axis, or several of each (n,), to the series ``name``.

        Raises
        ------
        InputError
            A series that was not named when the file was created, or times and values of unequal length.
        DiskFull
            No room is left.
        """
        self.append_events(Events(name, np.atleast_1d(time), np.atleast_1d(value)))

    def append_events(self, events: Events) -> None:
        """Append values of one series.

        Raises
        ------
        InputError
            As :meth:`append_event`, or times of a device without the host's arrival times.
        DiskFull
            No room is left.
        """
        axis, name = self._event_axes.get(events.series), events.series
        if axis is None:
            raise InputError(f"event series {name!r} was not announced; name it in event_names")
        columns: dict[str, NDArray[np.generic]] = {"time": events.times, "value": events.values}
        if axis.kind == "device":
            if events.arrivals is None:
                raise InputError(f"event {name}: times of the clock {axis.clock} need the host's arrival times")
            columns["arrival"] = events.arrivals
        if axis.texts:
            columns["text"] = stored_texts(events.texts or ("",) * len(events.values))
        if events.times.ndim != 1 or len({column.shape for column in columns.values()}) != 1:
            raise InputError(
                f"event {name}: {events.times.size} times but {events.values.size} values (or texts); give one a time"
            )
        self._append(summed_rows(self._event_tables[name], columns, "sum"))

    def append_clock_pair(self, stream: str, sample_index: int, host_time: float) -> None:
        """Append a sample count and the host's monotonic time (s) to a stream's clock."""
        self.append_clock_pairs(stream, np.array([[sample_index, host_time]], dtype=float))

    def append_clock_pairs(self, stream: str, pairs: Real) -> None:
        """Append pairs of sample count and host's monotonic time (s), (n_pairs, 2), to a stream's clock."""
        self._description(stream)
        self._append(summed_rows(self._stream_tables[stream], {"clock": pairs}, "clock_sum"))

    def _description(self, stream: str) -> StreamDescription:
        if stream not in self.streams:
            raise InputError(f"no stream {stream!r} in {self.path.name}; it has {', '.join(self.streams)}")
        return self.streams[stream]

    def close(self, *, complete: bool = True, ending: str = "") -> None:
        """Close the file.

        Parameters
        ----------
        complete
            Whether the recording ended in order.
        ending
            One line that says how the recording ended; a longer line is cut.

        Raises
        ------
        DiskFull
            Even the spare space was not enough; only :func:`recover` can read the file.
        """
        if not self._file:
            return
        if self._spare is not None:
            self._spare.release()
        try:
            # Modify in place: while a file is reopened, a kill would make it unreadable.
            if ending:
                line = " ".join(ending.split()).encode()[:ENDING_BYTES]
                self._file.attrs.modify("ending", np.array(line, f"S{ENDING_BYTES}"))
            if complete:
                self._file.attrs.modify("complete", np.bool_(True))
            self._file.close()
        except (OSError, RuntimeError) as error:
            if not is_disk_full(error):
                raise
            raise DiskFull(
                f"{self.path} could not be closed, there is no more room for it (a FAT32 disk ends a file at 4 GB); "
                f"save what is there onto another disk: {command('recover', self.path, '--out')} FILE.h5"
            ) from error
        finally:
            self._syncer.close()

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(complete=kind is None, ending=f"{kind.__name__}: {value}" if kind is not None else "")


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
    DiskFull
        No room is left.
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
            while not (stop is not None and stop()) and (item := source.read()) is not None:
                written += _write(writer, item)
                if observer is not None:
                    observer(item)
                if progress is not None:
                    progress(written)
        finally:
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
