"""`RecordingWriter`: a recording written block by block, readable after a crash."""

import datetime
import json
import os
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .recording_format import FORMAT, FORMAT_VERSION
from .source import StreamDescription


class RecordingWriter:
    """Writes a recording in place; what was appended is on disk when ``append`` returns.

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
        Names of the slow series that ``append_event`` may be given.
    recorded_at
        ISO 8601 UTC; None: now.
    overwrite
        Replace an existing file.

    Raises
    ------
    InputError
        The file exists, its folder does not, or streams share a name.
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
        recorded_at: str | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        self.streams = {stream.name: stream for stream in streams}
        if not streams or len(self.streams) != len(streams):
            raise InputError(f"a recording needs streams of different names, got {[s.name for s in streams]}")
        self._file = self._create("w" if overwrite else "x")
        stamp = recorded_at or datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        self._file.attrs.update(
            {"format": FORMAT, "format_version": FORMAT_VERSION, "title": title, "recorded_at": stamp}
        )
        self._file.attrs["setup"] = setup
        self._file.attrs["complete"] = np.bool_(False)
        for stream in streams:
            self._make_stream(stream, dtype, block_length)
        for name in event_names:
            group = self._file.create_group(f"events/{name}")
            for column in ("time", "value"):
                group.create_dataset(column, (0,), "f8", maxshape=(None,), chunks=(1024,))
        self._file.swmr_mode = True
        self._file.flush()

    def _create(self, mode: str) -> h5py.File:
        if not self.path.parent.is_dir():
            raise InputError(f"cannot write {self.path}: folder {self.path.parent} does not exist; create it first")
        try:
            return h5py.File(self.path, mode, libver="latest")
        except FileExistsError as error:
            raise InputError(f"{self.path} exists; choose another name or remove it first") from error
        except OSError as error:
            raise InputError(f"cannot write {self.path}: {error}; choose another name or close its writer") from error

    def _make_stream(self, stream: StreamDescription, dtype: str, block_length: int) -> None:
        group = self._file.create_group(f"signals/{stream.name}")
        group.attrs["sample_rate"] = float(stream.sample_rate)
        group.attrs["start_time"] = float(stream.start_time)
        group.attrs["channels"] = json.dumps([channel.to_json() for channel in stream.channels])
        width = len(stream.channels)
        group.create_dataset("samples", (0, width), dtype, maxshape=(None, width), chunks=(block_length, width))
        group.create_dataset("clock", (0, 2), "f8", maxshape=(None, 2), chunks=(1024, 2))

    def append(self, stream: str, samples: NDArray[np.floating]) -> None:
        """Append rows (n_samples, n_channels) in SI units to a stream.

        Raises
        ------
        InputError
            Unknown stream, wrong number of columns, or samples that are not finite.
        """
        described = self._described(stream)
        if samples.ndim != 2 or samples.shape[1] != len(described.channels):
            raise InputError(
                f"block of shape {samples.shape} for stream {stream}, expected {len(described.channels)} columns"
            )
        if not np.isfinite(samples).all():
            column = int(np.argmax(~np.isfinite(samples).all(axis=0)))
            raise InputError(
                f"channel {described.channels[column].name} holds NaN or infinity; mend the data or its conversion"
            )
        self._extend(self._file["signals"][stream]["samples"], samples)

    def append_event(self, name: str, time: float | NDArray[np.floating], value: float | NDArray[np.floating]) -> None:
        """Append a slow value at ``time`` (s), or several of each (n,), to the series ``name``.

        Raises
        ------
        InputError
            A series that was not named when the file was made, or times and values of unequal length.
        """
        group = self._file.get(f"events/{name}")
        if group is None:
            raise InputError(f"event series {name!r} was not announced; name it in event_names")
        times, values = np.atleast_1d(time), np.atleast_1d(value)
        if times.shape != values.shape or times.ndim != 1:
            raise InputError(f"event {name}: {times.size} times but {values.size} values; give one value a time")
        self._extend(group["time"], times)
        self._extend(group["value"], values)

    def append_clock_pair(self, stream: str, sample_index: int, host_time: float) -> None:
        """Append (sample index, host monotonic time in s) to a stream's clock."""
        self._described(stream)
        self._extend(self._file["signals"][stream]["clock"], np.array([[sample_index, host_time]], dtype=float))

    def _described(self, stream: str) -> StreamDescription:
        if stream not in self.streams:
            raise InputError(f"no stream {stream!r} in {self.path.name}; it has {', '.join(self.streams)}")
        return self.streams[stream]

    @staticmethod
    def _extend(dataset: h5py.Dataset, rows: NDArray[np.floating]) -> None:
        start = dataset.shape[0]
        try:
            dataset.resize(start + len(rows), axis=0)
            dataset[start:] = rows
        except BaseException:  # also Ctrl-C: rows that were announced but not written must not be read as zeros
            dataset.resize(start, axis=0)
            raise
        dataset.flush()

    def close(self, *, complete: bool = True) -> None:
        """Close the file; ``complete`` is set when the recording ended in order."""
        if not self._file:
            return
        if complete:  # in place: reopening the file would leave a moment in which a kill makes it unreadable
            self._file.attrs.modify("complete", np.bool_(True))
        self._file.close()

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(complete=kind is None)
