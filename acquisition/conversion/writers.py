"""Write a recording's content as HDF5, NPZ, MAT or CSV."""

import csv
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from foundation import InputError, require_memory

from ..recordings import FORMAT, FORMAT_VERSION, RecordingWriter
from ..sources import EventAxis, Events
from .content import Content, row_blocks
from .flat_fields import described_fields, tables_of, to_fields

Progress = Callable[[int], None]

SPARE_BYTES = 1_000_000
"""Disk space kept aside so that the HDF5 library can close its file in order on a full disk."""

_BYTES_A_MAT_VALUE = 16.0  # seen at the peak
_LARGEST_MAT_ARRAY = 2**31 - 1


def write_content(content: Content, path: Path, progress: Progress | None = None) -> None:
    """Write ``content`` in the format that the suffix of ``path`` names.

    Raises
    ------
    InputError
        A suffix that cannot be written, or content that the format cannot hold.
    """
    require_writable(path)
    report: Progress = progress or (lambda n_samples: None)
    {".h5": _write_h5, ".npz": _write_npz, ".mat": _write_mat, ".csv": _write_csv}[path.suffix.lower()](
        content, path, report
    )


def require_writable(path: Path) -> None:
    """Refuse a suffix that :func:`write_content` does not know."""
    if path.suffix.lower() not in (".h5", ".npz", ".mat", ".csv"):
        raise InputError(f"cannot write {path.name}: suffix {path.suffix!r}; use .h5, .npz, .mat or .csv")


def _write_h5(content: Content, path: Path, progress: Progress) -> None:
    described = [samples.description for samples in content.streams]
    dtype: Literal["float32", "float64"] = "float32"
    if any(samples.dtype == np.float64 for samples in content.streams):
        dtype = "float64"
    with RecordingWriter(
        path,
        described,
        title=content.title,
        setup=content.setup,
        dtype=dtype,
        event_axes={name: EventAxis(texts=name in content.event_texts) for name in content.events},
        recorded_at=content.recorded_at,
        provenance=content.provenance,
        overwrite=True,
        spare_bytes=SPARE_BYTES,
    ) as writer:
        written = 0
        for samples in content.streams:
            for block in row_blocks(samples):
                if np.isfinite(block).all():
                    writer.append(samples.description.name, block)
                else:
                    writer.append_with_missing(samples.description.name, block, "missing in the recording it is from")
                written += len(block)
                progress(written)
        for name, (times, values) in content.events.items():
            writer.append_events(Events(name, times, values, None, content.event_texts.get(name)))
        for name, pairs in content.clock_pairs.items():
            if len(pairs):
                writer.append_clock_pairs(name, np.asarray(pairs, dtype=float))


def _write_npz(content: Content, path: Path, progress: Progress) -> None:
    """As `numpy.savez` writes it, with the samples block by block."""
    written = 0
    with zipfile.ZipFile(path, "w", allowZip64=True) as archive:
        for name, value in described_fields(content).items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(value), allow_pickle=False)
        for name, samples in tables_of(content).items():
            shape = (samples.n_samples, len(samples.description.channels))
            header = {"descr": samples.dtype.str, "fortran_order": False, "shape": shape}
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array_header_1_0(entry, header)
                for block in row_blocks(samples):
                    entry.write(block.astype(samples.dtype).tobytes())
                    written += len(block)
                    progress(written)


def _write_mat(content: Content, path: Path, progress: Progress) -> None:
    for samples in content.streams:
        size = samples.n_samples * len(samples.description.channels) * samples.dtype.itemsize
        if size > _LARGEST_MAT_ARRAY:
            raise InputError(f"stream {samples.description.name} has {size} bytes, more than a MAT file holds; use .h5")
        require_memory(
            _BYTES_A_MAT_VALUE * size / samples.dtype.itemsize,
            f"{path.name}, a MAT file of {size / 1e6:.0f} MB, which is written at once",
            "write .h5, which MATLAB reads with h5read, or a part with --span",
        )
    with path.open("wb") as handle:
        savemat(handle, to_fields(content), oned_as="column")
    progress(_total(content))


def _total(content: Content) -> int:
    return sum(samples.n_samples for samples in content.streams)


def _write_csv(content: Content, path: Path, progress: Progress) -> None:
    if len(content.streams) != 1:
        names = ", ".join(samples.description.name for samples in content.streams)
        raise InputError(f"a CSV file holds one sample clock, this recording has {names}; use .npz, .mat or .h5")
    samples = content.streams[0]
    described = samples.description
    digits = "%.9g" if samples.dtype == np.float32 else "%.17g"
    row_format = ",".join(["%.15g", *[digits] * len(described.channels)])
    with path.open("w", encoding="utf-8", newline="\n") as handle:
        for key, value in _csv_metadata(content).items():
            handle.write(f"# {key}: {json.dumps(value)}\n")
        headings = ["time [s]", *(f"{channel.name} [{channel.unit}]" for channel in described.channels)]
        csv.writer(handle, lineterminator="\n").writerow(headings)
        written = 0
        for block in row_blocks(samples):
            time = described.start_time + np.arange(written, written + len(block)) / described.sample_rate
            np.savetxt(handle, np.column_stack([time, block]), fmt=row_format)
            written += len(block)
            progress(written)


def _csv_metadata(content: Content) -> dict[str, object]:
    samples = content.streams[0]
    described = samples.description

    def listed(pairs: tuple[NDArray[np.float64], NDArray[np.float64]]) -> list[list[float]]:
        return [pairs[0].tolist(), pairs[1].tolist()]

    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "title": content.title,
        "recorded_at": content.recorded_at,
        "setup": content.setup,
        "provenance": json.loads(content.provenance or "{}"),
        "stream": described.name,
        "sample_rate": described.sample_rate,
        "start_time": described.start_time,
        "dtype": samples.dtype.name,
        "channels": [channel.to_json() for channel in described.channels],
        "events": {name: listed(pairs) for name, pairs in content.events.items()},
        "event_texts": {name: list(texts) for name, texts in content.event_texts.items()},
        "clock": content.clock_pairs.get(described.name, np.empty((0, 2))).tolist(),
    }
