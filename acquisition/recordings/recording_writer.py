"""`RecordingWriter`: a recording written block by block, readable after a crash."""

import datetime
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import DiskFull, InputError, is_disk_full

from ..errors import Overrun
from ..sources.source import SAMPLES_AXIS, EventAxis, Events, StreamDescription, stored_texts
from .durability import SpareSpace, Syncer, is_being_written
from .recording_format import ENDING_BYTES, FORMAT, FORMAT_VERSION
from .tables import Tables, append_missing, append_samples, append_summed, make_events, make_stream

PAGE_BYTES = 4096
"""Bytes that systems write back to a disk together."""


class RecordingWriter:
    """Writes a recording in place; what was appended outlives the writer when ``append`` returns, and is on the disk
    itself about a second later.

    Every dataset is made when the file is opened, and the file is then switched to single-writer,
    multiple-reader mode: a writer that is killed leaves a readable file that lacks at most the block in hand.

    Parameters
    ----------
    path
        New file; an existing one is refused unless ``overwrite``.
    streams
        The sample clocks to come.
    title, setup
        Free title; tool, cut and pose as TOML text.
    dtype
        ``float32`` or ``float64``.
    block_length
        Rows in a chunk.
    event_names
        Names of the slow series that ``append_event`` may be given; their times are on the samples' axis.
    event_axes
        The same for series whose times are told by another clock.
    recorded_at
        ISO 8601 UTC, empty where it is not known; None: now.
    provenance
        Where the recording comes from, as JSON text: files with hashes, options, versions.
    overwrite
        Replace an existing file, unless it is being written.
    spare_bytes
        Disk space kept aside so that the file can still be closed when the disk is full; 0: none.

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
            # HDF5 cannot hold it
            if (place := text.find("\0")) >= 0:
                raise InputError(f"the recording's {name} holds a zero character at place {place}; leave it out")
        self._file = self._create(overwrite)
        self._spare: SpareSpace | None = None
        try:
            self._spare = SpareSpace(self.path.parent, spare_bytes) if spare_bytes else None
        except BaseException:
            self._file.close()
            self.path.unlink()
            raise
        self._tables: dict[str, Tables] = {}
        self._event_axes = dict.fromkeys(event_names, SAMPLES_AXIS) | dict(event_axes or {})
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        stamp = now if recorded_at is None else recorded_at
        self._write_texts({"title": title, "recorded_at": stamp, "setup": setup, "provenance": provenance})
        for stream in streams:
            self._tables[f"signals/{stream.name}"] = make_stream(self._file, stream, dtype, block_length)
        for name, axis in self._event_axes.items():
            self._tables[f"events/{name}"] = make_events(self._file, name, axis)
        self._file.swmr_mode = True
        self._file.flush()
        self._syncer = Syncer(self.path)

    def _create(self, overwrite: bool) -> h5py.File:
        if not self.path.parent.is_dir():
            raise InputError(f"cannot write {self.path}: folder {self.path.parent} does not exist; create it first")
        if overwrite and self.path.is_file() and is_being_written(self.path):
            raise InputError(f"{self.path} is being written by another program; choose another name or wait for it")
        try:
            # pages: what HDF5 knows of a small table lies in one page, which a failing disk writes whole or not at all
            paged = {"fs_strategy": "page", "fs_page_size": PAGE_BYTES}
            return h5py.File(self.path, "w" if overwrite else "x", libver="latest", **paged)
        except FileExistsError as error:
            raise InputError(f"{self.path} exists; choose another name or remove it first") from error
        except OSError as error:
            raise InputError(f"cannot write {self.path}: {error}; choose another name or close its writer") from error

    def _write_texts(self, texts: Mapping[str, str]) -> None:
        self._file.attrs.update({"format": FORMAT, "format_version": FORMAT_VERSION, **texts})
        self._file.attrs["complete"] = np.bool_(False)
        self._file.attrs["ending"] = np.array(b"", f"S{ENDING_BYTES}")

    def append(self, stream: str, samples: NDArray[np.floating], first_sample: int | None = None) -> None:
        """Append rows (n_samples, n_channels) in SI units to a stream.

        Parameters
        ----------
        stream
            Name of the stream.
        samples : (n_samples, n_channels)
            Rows in SI units.
        first_sample
            Number of the first row since the recording began, as the device counts; None: it does not count.

        Raises
        ------
        InputError
            Unknown stream, wrong number of columns, or samples that are not finite.
        Overrun
            The rows do not follow on those before: samples are missing, or come twice.
        DiskFull
            No room is left.
        """
        described, group = self._described(stream), self._tables[f"signals/{stream}"]
        self._check_columns(described, samples)
        if first_sample is not None:
            self._check_order(stream, first_sample, group["samples"].shape[0])
        if not np.isfinite(samples).all():
            column = int(np.argmax(~np.isfinite(samples).all(axis=0)))
            raise InputError(
                f"channel {described.channels[column].name} holds NaN or infinity; mend the data or its conversion"
            )
        append_samples(group, samples, self._spare, self.path)

    def append_with_missing(self, stream: str, samples: NDArray[np.floating], reason: str) -> None:
        """Append rows of which some are missing: NaN, listed in the file with the reason.

        Parameters
        ----------
        stream
            Name of the stream.
        samples : (n_samples, n_channels)
            Rows in SI units; a row that holds NaN or infinity is missing.
        reason
            Why rows are missing, in a few words.

        Raises
        ------
        InputError
            Unknown stream, or wrong number of columns.
        DiskFull
            No room is left.
        """
        self._check_columns(self._described(stream), samples)
        append_missing(self._tables[f"signals/{stream}"], samples, reason, self._spare, self.path)

    def _check_columns(self, described: StreamDescription, samples: NDArray[np.floating]) -> None:
        if samples.ndim != 2 or samples.shape[1] != len(described.channels):
            raise InputError(
                f"block of shape {samples.shape} for stream {described.name}, expected {len(described.channels)} "
                "columns; give one a channel"
            )

    def _check_order(self, stream: str, first_sample: int, written: int) -> None:
        """Refuse a block that does not follow on the one before."""
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
        """Append a slow value at ``time`` (s), or several of each (n,), to the series ``name``.

        Raises
        ------
        InputError
            A series that was not named when the file was made, or times and values of unequal length.
        DiskFull
            No room is left.
        """
        self.append_events(Events(name, np.atleast_1d(time), np.atleast_1d(value)))

    def append_events(self, events: Events) -> None:
        """Append values of one series.

        Raises
        ------
        InputError
            As :meth:`append_event`, or a device's times without the host's arrival times.
        DiskFull
            No room is left.
        """
        axis, name = self._event_axes.get(events.series), events.series
        if axis is None:
            raise InputError(f"event series {name!r} was not announced; name it in event_names")
        columns: dict[str, NDArray[np.generic]] = {"time": events.times, "value": events.values}
        if axis.kind == "device":
            if events.arrivals is None:
                raise InputError(f"event {name}: times of the clock {axis.clock} need the host's arrival times beside")
            columns["arrival"] = events.arrivals
        if axis.texts:
            columns["text"] = stored_texts(events.texts or ("",) * len(events.values))
        if events.times.ndim != 1 or len({column.shape for column in columns.values()}) != 1:
            raise InputError(
                f"event {name}: {events.times.size} times but {events.values.size} values (or texts); give one a time"
            )
        group = self._tables[f"events/{name}"]
        append_summed(group, list(columns), "sum", list(columns.values()), self._spare, self.path)

    def append_clock_pair(self, stream: str, sample_index: int, host_time: float) -> None:
        """Append (sample index, host monotonic time in s) to a stream's clock."""
        self.append_clock_pairs(stream, np.array([[sample_index, host_time]], dtype=float))

    def append_clock_pairs(self, stream: str, pairs: NDArray[np.float64]) -> None:
        """Append several such pairs (n_pairs, 2)."""
        self._described(stream)
        append_summed(self._tables[f"signals/{stream}"], ["clock"], "clock_sum", [pairs], self._spare, self.path)

    def _described(self, stream: str) -> StreamDescription:
        if stream not in self.streams:
            raise InputError(f"no stream {stream!r} in {self.path.name}; it has {', '.join(self.streams)}")
        return self.streams[stream]

    def close(self, *, complete: bool = True, ending: str = "") -> None:
        """Close the file; ``complete``: it ended in order; ``ending``: one line that says how it did.

        Raises
        ------
        DiskFull
            Not even the spare space was enough; the file is readable by :func:`recover` alone.
        """
        if not self._file:
            return
        if self._spare is not None:
            self._spare.release()
        try:
            # in place: reopening the file would leave a moment in which a kill makes it unreadable
            if ending:
                cut = " ".join(ending.split()).encode()[:ENDING_BYTES]
                self._file.attrs.modify("ending", np.array(cut, f"S{ENDING_BYTES}"))
            if complete:
                self._file.attrs.modify("complete", np.bool_(True))
            self._file.close()
        except (OSError, RuntimeError) as error:
            if not is_disk_full(error):
                raise
            raise DiskFull(
                f"{self.path} could not be closed, there is no more room for it (a FAT32 disk ends a file at 4 GB); "
                "save what is there with millfrf recover, onto another disk"
            ) from error
        finally:
            self._syncer.close()

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(complete=kind is None, ending=f"{kind.__name__}: {value}" if kind is not None else "")
