"""`RecordingWriter`: a recording written block by block, readable after a crash."""

import contextlib
import datetime
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import DiskError, DiskFull, InputError, Real, command, is_disk_full, writing_whole_file
from millfrf.core.disk_errors import failure_of_disk
from millfrf.core.errors import NotKept
from millfrf.core.file_locks import HAS_LOCKS

from ..sources.source import (
    SAMPLES_AXIS,
    EventAxis,
    Events,
    Overrun,
    StreamDescription,
    stored_texts,
)
from .chunk_places import ChunkPlaces
from .durability import SpareSpace, Syncer, abandon, failure_of_hdf5
from .journal import Journal, end_frame
from .recording_format import ENDING_BYTES
from .tables import PAGE, NewRows, Tables, append_rows, empty_recording, missing_rows, sample_rows, summed_rows

_REFUSED = "cannot write {}: its disk failed ({}); choose another disk"


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
        if not self.path.parent.is_dir():
            raise InputError(f"cannot write {self.path}: folder {self.path.parent} does not exist; create it first")
        if self.path.exists() and not overwrite:
            raise InputError(f"{self.path} exists; choose another name or remove it first")
        self._spare = SpareSpace(self.path.parent, spare_bytes) if spare_bytes else None
        self._event_axes = dict.fromkeys(event_names, SAMPLES_AXIS) | dict(event_axes or {})
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        time = now if recorded_at is None else recorded_at
        texts = {"title": title, "recorded_at": time, "setup": setup, "provenance": provenance}
        self._closed = False
        self._failure = ""  # of the disk, in the words of the system
        self._create(
            partial(
                empty_recording,
                streams=streams,
                event_axes=self._event_axes,
                texts=texts,
                dtype=dtype,
                block_length=block_length,
            )
        )

    def _create(self, make: Callable[[Path], tuple[h5py.File, Journal]]) -> None:
        """Put an empty recording in place, which is locked before it gets its name."""
        try:
            with writing_whole_file(self.path) as temporary:
                if HAS_LOCKS:
                    self._open(temporary, make)
                else:  # Windows renames no open file
                    temporary.touch()
            if not HAS_LOCKS:
                self._open(self.path, make)
        except NotKept as error:
            self._drop()
            if not failure_of_disk(error):  # another program has taken it away
                raise
            with contextlib.suppress(OSError):
                self.path.unlink()
            raise DiskError(_REFUSED.format(self.path, failure_of_disk(error))) from error
        except BaseException:
            self._drop()
            raise

    def _open(self, path: Path, make: Callable[[Path], tuple[h5py.File, Journal]]) -> None:
        """Open the empty file for its writer and readers."""
        try:
            self._file, self._journal = make(path)
            self._stream_tables = {name: dict(self._file[f"signals/{name}"].items()) for name in self.streams}
            self._event_tables = {name: dict(self._file[f"events/{name}"].items()) for name in self._event_axes}
            self._file.swmr_mode = True
            self._file.flush()
            self._syncer = Syncer(path, self.path)
            self._places = {
                name: ChunkPlaces(tables["samples"], self._syncer.read, PAGE)
                for name, tables in self._stream_tables.items()
            }
        except (OSError, RuntimeError) as error:
            self._closed = True
            abandon((self, error))  # the frames of the error hold the objects of a file that was not finished
            if is_disk_full(error):
                raise DiskFull(f"cannot record in {self.path.parent}: its disk is full; make room first") from error
            raise DiskError(_REFUSED.format(self.path, failure_of_hdf5(error))) from error

    def _drop(self) -> None:
        """Close a file that could not be put in place."""
        if self._spare is not None:
            self._spare.release()
        if self._closed:
            return
        self._closed = True
        if hasattr(self, "_syncer"):
            self._syncer.release()
        if hasattr(self, "_file"):
            try:
                self._file.close()
            except (OSError, RuntimeError):
                abandon(self)

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
        DiskFull, DiskError
            No room is left, or the disk failed.
        """
        description, tables = self._checked_stream(stream, samples)
        if first_sample is not None:
            self._check_order(stream, first_sample, tables["samples"].shape[0])
        if not np.isfinite(samples).all():
            column = int(np.argmax(~np.isfinite(samples).all(axis=0)))
            raise InputError(
                f"channel {description.channels[column].name} holds NaN or infinity; correct the data or its conversion"
            )
        self._append(sample_rows(tables, self._places[stream], samples))

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
        DiskFull, DiskError
            No room is left, or the disk failed.
        """
        _, tables = self._checked_stream(stream, samples)
        missing = missing_rows(tables, samples, reason)
        self._append(sample_rows(tables, self._places[stream], samples))
        self._append(missing)

    def _append(self, rows: NewRows) -> None:
        self._require_kept()
        try:
            append_rows(rows, self._journal, self._spare, self.path)
        except DiskError as error:
            self._failure = failure_of_disk(error)
            raise

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
        DiskFull, DiskError
            No room is left, or the disk failed.
        """
        self.append_events(Events(name, np.atleast_1d(time), np.atleast_1d(value)))

    def append_events(self, events: Events) -> None:
        """Append values of one series.

        Raises
        ------
        InputError
            As :meth:`append_event`, or times of a device without the host's arrival times.
        DiskFull, DiskError
            No room is left, or the disk failed.
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
        DiskFull, DiskError
            Even the spare space was not enough, or the disk failed: only :func:`recover` can read the file. Or another
            program removed or replaced the file.
        """
        if self._closed:
            return
        self._closed = True
        if self._spare is not None:
            self._spare.release()
        try:
            self._file.flush()
            if not self._syncer.sync():
                complete, ending = False, ending or f"DiskError: a sync failed: {self._syncer.failure}"
            # Modify in place: while a file is reopened, a kill would make it unreadable.
            line = " ".join(ending.split()).encode()[:ENDING_BYTES]
            self._journal.append([end_frame(complete, line.decode("utf-8", "replace"))])
            if ending:
                self._file.attrs.modify("ending", np.array(line, f"S{ENDING_BYTES}"))
            if complete:
                self._file.attrs.modify("complete", np.bool_(True))
            self._file.close()
        except (OSError, RuntimeError) as error:
            abandon(self)
            self._syncer.close()
            remedy = f"save what is there onto another disk: {command('recover', self.path, '--out')} FILE.h5"
            if is_disk_full(error):
                reason = "there is no more room for it (a FAT32 disk ends a file at 4 GB)"
                raise DiskFull(f"{self.path} could not be closed, {reason}; {remedy}") from error
            reason = self._failure or failure_of_hdf5(error)
            raise DiskError(f"{self.path} could not be closed, its disk failed ({reason}); {remedy}") from error
        self._require_kept(self._syncer.close())

    def _require_kept(self, missing: str = "") -> None:
        """Raise an error if the file is gone, or if the disk did not take what was written."""
        if missing:
            raise NotKept(missing)
        if (failure := self._syncer.failure) is not None:
            raise NotKept(
                f"the disk of {self.path} did not keep what was written ({failure.strerror}); the recording ends here, "
                "copy it onto another disk and look at it there with 'millfrf inspect'"
            ) from failure

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(complete=kind is None, ending=f"{kind.__name__}: {value}" if kind is not None else "")
