"""Conversion of recordings from one kind of file into one or several files of another kind."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from millfrf.core import FileFormatError, InputError, Real, is_unit, si_factor, time_unit
from millfrf.core.runtime import notice

from ..recordings.recording import Recording
from ..sources.source import StreamDescription
from .array_file import ArrayFile, OrderedArray, usual_axes
from .content import Content, between_times, recording_content, samples_on_request, with_gaps
from .guesses import split_heading
from .mapping import ArrayMapping, ChannelMapping, RecordingMapping, load_mapping
from .proposal import proposed_mapping
from .read_arrays import open_arrays
from .sample_axis import (
    Cut,
    SampleAxis,
    agreed_axis,
    are_one_rate,
    common_span,
    is_time_name,
    looks_like_clock,
    measured_axis,
)
from .text_table import TEXT_SUFFIXES
from .writers import from_fields, own_csv_metadata, read_own_csv, require_writable, written_content


def convert(
    input_path: str | os.PathLike[str],
    output_path: str | os.PathLike[str],
    mapping_path: str | os.PathLike[str] | RecordingMapping | None = None,
    progress: Callable[[int], None] | None = None,
    *,
    span: tuple[float, float] | None = None,
    provenance: str = "",
) -> list[Path]:
    """Convert a recording; the suffixes of the files decide: ``.h5 .npz .npy .mat .csv`` into ``.h5 .npz .mat .csv``.

    Parameters
    ----------
    input_path
        A recording, a file written by this function, or, with a mapping, a file of another program.
    output_path
        File to write; with ``split`` in the mapping ``rec.h5`` becomes ``rec-1.h5``, ``rec-2.h5`` ...
    mapping_path
        TOML file that states which array or column is which channel, or its content, a :class:`RecordingMapping`.
    progress
        Function that is called with the number of samples written so far in the current file.
    span : s
        First and last time to keep, counted from the first sample; None: all.
    provenance
        Origin of the output as JSON text; every kind of file stores it.

    Returns
    -------
    list[Path]
        Paths of the new files. Either all of them are complete, or none is written.

    Raises
    ------
    InputError, FileFormatError
        A file cannot be used; nothing is written.
    """
    source, target = Path(input_path), Path(output_path)
    require_writable(target)
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    written: list[Path] = []
    with ExitStack() as stack, _opened_contents(source, mapping_path) as (contents, is_split):
        for number, content in enumerate(contents, 1):
            path = target.with_name(f"{target.stem}-{number}{target.suffix}") if is_split else target
            if path.exists() and path.samefile(source):
                raise InputError(f"{path} is the input itself; choose another output name")
            chosen = content if span is None else between_times(content, span)
            stack.enter_context(written_content(replace(chosen, provenance=provenance), path, progress))
            written.append(path)
    return written


@contextmanager
def _opened_contents(
    source: Path, mapping_path: str | os.PathLike[str] | RecordingMapping | None
) -> Iterator[tuple[Iterator[Content], bool]]:
    """Open a file; yield its contents, and whether the mapping splits it into several recordings."""
    if mapping_path is not None:
        mapping = mapping_path if isinstance(mapping_path, RecordingMapping) else load_mapping(mapping_path)
        yield _MappedArrays(source, mapping).contents(), mapping.split is not None
    elif source.suffix.lower() in (".h5", ".hdf5"):
        with Recording(source) as recording:
            yield iter([recording_content(recording)]), False
    else:
        yield iter([_self_described(source)]), False


def _self_described(source: Path) -> Content:
    """Return the content of a file that this program wrote, or of one that says itself what its channels are."""
    if source.suffix.lower() == ".csv" and (metadata := own_csv_metadata(source)):
        return read_own_csv(source, metadata)
    fields = {} if source.suffix.lower() in (*TEXT_SUFFIXES, ".npy") else open_arrays(source).fields
    if "format" in fields:
        return from_fields(fields, source)
    proposal = proposed_mapping(source)
    if proposal.open_keys:
        raise FileFormatError(
            f"{source} does not say {proposal.open_keys[0]}; give a mapping file (--map map.toml), which this command "
            f"begins: millfrf new mapping {source.name} --out map.toml (for FRFs: add --frf)"
        )
    mapping = proposal.mapping()
    places = [f" at {each.node}:{each.direction}" if each.node else "" for each in mapping.channels]
    pairs = zip(mapping.channels, places, strict=True)
    names = [f"{each.name} {each.quantity} in {each.unit}{place}" for each, place in pairs]
    notice(
        f"{source.name}: taken {', '.join(names)}; names are guesses: check them, or begin a mapping with new mapping"
    )
    return next(_MappedArrays(source, mapping, proposal.file).contents())


class _MappedArrays:
    """Arrays of a file of another program, and of the further files that its mapping names."""

    def __init__(self, input_path: Path, mapping: RecordingMapping, opened: ArrayFile | None = None) -> None:
        self._input_path = input_path
        self._mapping = mapping
        self._files = {} if opened is None else {opened.path: opened}

    def contents(self) -> Iterator[Content]:
        """Yield one content for every entry of the split axis, or a single content."""
        mapping = self._mapping
        arrays = {key: self._ordered(key) for key in dict.fromkeys(channel.array for channel in mapping.channels)}
        columns = [arrays[channel.array].column_number(channel) for channel in mapping.channels]
        for channel, column in zip(mapping.channels, columns, strict=True):
            self._require_unit(channel, arrays[channel.array], column)
        axis, cuts = self._axis(arrays)
        length = self._common_length(arrays, cuts)
        for file in self._files.values():
            notice(file.account(self._used(file, arrays, columns), length))
        if axis.gaps:
            notice(f"{self._input_path.name}: {axis.gaps_text()}; they stay missing in the recording")
        channels = tuple(
            replace(channel.channel(), input_delay_s=(channel.input_delay_s or 0.0) + cuts[channel.array].lag or None)
            for channel in mapping.channels
        )
        stream = StreamDescription(mapping.stream, axis.rate, axis.start + mapping.start_time, channels)
        dtype = np.dtype(mapping.dtype or np.result_type(np.float32, *(a.values.dtype for a in arrays.values())))
        n_parts = next(iter(arrays.values())).n_split
        places = [(channel, arrays[channel.array], k) for channel, k in zip(mapping.channels, columns, strict=True)]
        starts = [cuts[channel.array].first for channel in mapping.channels]
        for part in range(n_parts):
            stored = [array.values[part, ..., column].reshape(-1) for _, array, column in places]

            def read(start: int, stop: int, stored: Sequence[np.ndarray] = stored) -> Real:
                rows = np.empty((stop - start, len(stored)), dtype)
                for k, (channel, begin) in enumerate(zip(mapping.channels, starts, strict=True)):
                    rows[:, k] = channel.to_si(stored[k][begin + start : begin + stop])
                return rows.astype(float, copy=False)

            title = mapping.title if mapping.split is None else f"{mapping.title} {mapping.split} {part + 1}".strip()
            content = samples_on_request(stream, length, dtype, read)
            yield Content((with_gaps(content, axis.gaps),), title, mapping.setup, mapping.recorded_at)

    def _used(
        self, file: ArrayFile, arrays: "Mapping[str | None, OrderedArray]", columns: Sequence[int]
    ) -> dict[str, set[int]]:
        """Return the columns of a file that are channels or times, by the name of their array."""
        used: dict[str, set[int]] = {}
        for channel, column in zip(self._mapping.channels, columns, strict=True):
            array = arrays[channel.array]
            if array.file is file:
                used.setdefault(array.name or next(iter(file.fields)), set()).add(column)
        times = [name for name, _ in self._time_columns()]
        for name in (*times, *filter(None, (self._mapping.time, self._mapping.sample_rate))):
            if file.table is not None and (isinstance(name, int) or name in file.headings):
                used.setdefault("table", set()).add(file.table.column(name, "time"))
            elif str(name) in self._mapping.arrays or str(name) in file.fields:
                used.setdefault(self._find(str(name))[1], set())
        return used

    def _require_unit(self, channel: ChannelMapping, array: "OrderedArray", column: int) -> None:
        """Refuse a unit that the file contradicts; a sensitivity in the mapping says what the stored numbers are."""
        heading = array.file.headings[column] if array.file.headings else array.name or ""
        said = array.file.unit_of(array.name, column) or split_heading(heading)[1]
        if not said or "sensitivity" in channel.model_fields_set or not is_unit(said):
            return
        try:
            ratio = si_factor(channel.quantity, said) / si_factor(channel.quantity, channel.unit)
            agrees = abs(ratio - 1) < 1e-6
        except InputError:
            agrees = False
        if not agrees:
            raise InputError(
                f"channel {channel.name}: {channel.quantity} in {channel.unit} in the mapping, but {array.label} is in "
                f"{said}; correct the mapping, or write sensitivity too: stored numbers per {channel.unit}, 1.0 if the "
                "file is wrong"
            )

    def _axis(self, arrays: "Mapping[str | None, OrderedArray]") -> "tuple[SampleAxis, dict[str | None, Cut]]":
        """Return rate, start and gaps of the samples, and where each array is cut to begin at one time."""
        mapping = self._mapping
        whole = dict.fromkeys(arrays, Cut(0, 0.0))
        stated = self._stored_rate(mapping.sample_rate) if isinstance(mapping.sample_rate, str) else mapping.sample_rate
        if mapping.time is not None:
            return self._measured(mapping.time, mapping.time_unit, None), whole
        axes = {key: axis for key, array in arrays.items() if (axis := array.file.axis_of(array.name)) is not None}
        times = self._time_columns() if not axes else []
        if stated is None and not axes:
            raise InputError(
                "the mapping must give either sample_rate (Hz) or time (name of the array or column of times); "
                "add one of them"
            )
        for name, unit in times[:1]:  # further ones are of other clocks
            axis = self._measured(name, unit or "s", stated)
            return agreed_axis(stated or 1.0, axis, unit_is_known=bool(unit)), whole
        if not axes:
            return SampleAxis(float(stated or 0.0), 0.0, "the mapping"), whole
        if stated is not None:
            axes = {key: agreed_axis(stated, axis, unit_is_known=True) for key, axis in axes.items()}
        return self._aligned(arrays, axes)

    def _aligned(
        self, arrays: "Mapping[str | None, OrderedArray]", axes: "Mapping[str | None, SampleAxis]"
    ) -> "tuple[SampleAxis, dict[str | None, Cut]]":
        """Return the axis that all arrays share, and the rows of each that lie in their common span."""
        first_key, first = next(iter(axes.items()))
        n_samples = max(array.n_samples for array in arrays.values())
        for key, axis in axes.items():
            if not are_one_rate(first, axis, n_samples):
                raise InputError(
                    f"{arrays[first_key].label} has {first.rate:.9g} Hz, {arrays[key].label} {axis.rate:.9g} Hz: one "
                    "recording has one rate; make a mapping for the channels of each rate, and convert twice"
                )
            if axis.gaps != first.gaps:
                gaps = (axis if axis.gaps else first).gaps_text()
                raise InputError(
                    f"{arrays[first_key].label} and {arrays[key].label} lack different samples ({gaps}); make a "
                    "mapping for each of them, and convert twice"
                )
        start, cuts = common_span({key: axes.get(key, first) for key in arrays}, n_samples)
        if any(cut.first or cut.lag for cut in cuts.values()):
            if first.gaps:
                raise InputError(f"channels began at different times, and {first.gaps_text()}; convert them separately")
            ends = {key: cut for key, cut in cuts.items() if cut.first or cut.lag}
            texts = [
                f"{arrays[key].label} begins {start - axes[key].start:.6g} s early, {cut.first} samples of it cut off"
                + (f", {cut.lag:.3g} s kept as its input_delay_s" if cut.lag else "")
                for key, cut in ends.items()
            ]
            notice(f"{self._input_path.name}: channels began at different times: {'; '.join(texts)}")
        return replace(first, start=start), cuts

    def _common_length(self, arrays: "Mapping[str | None, OrderedArray]", cuts: "Mapping[str | None, Cut]") -> int:
        """Return the number of samples that all arrays have after the cuts; refuse lengths that nothing explains."""
        kept = {key: array.n_samples - cuts[key].first for key, array in arrays.items()}
        sizes = {(array.n_split, array.n_samples) for array in arrays.values()}
        short = [array.label for array in arrays.values() if array.is_short]
        is_shifted = any(cut.first for cut in cuts.values())
        explained = (is_shifted and max(kept.values()) - min(kept.values()) <= 1) or self._mapping.common_length
        if (
            (len(sizes) > 1 and not explained)
            or len({array.n_split for array in arrays.values()}) > 1
            or (short and not self._mapping.common_length)
        ):
            lengths = ", ".join(
                f"{array.label}: {array.n_split} x {array.n_samples} samples" for array in arrays.values()
            )
            raise FileFormatError(
                f"arrays of unequal lengths ({lengths}); common_length = true in the mapping keeps the first "
                f"{min(kept.values())} of each, if those at the end are missing"
            )
        if self._mapping.common_length and max(kept.values()) > min(kept.values()):
            notice(
                f"{self._input_path.name}: {min(kept.values())} of {max(kept.values())} samples kept, which all have"
            )
        return min(kept.values())

    def _array_mapping(self, key: str | None) -> ArrayMapping:
        return self._mapping.arrays.get(key or "", ArrayMapping())

    def _find(self, key: str | None) -> tuple[ArrayFile, str]:
        """Return the file of an array, and the name of the array in it, empty if it has none."""
        array = self._array_mapping(key)
        path = self._path(array)
        if path not in self._files:
            self._files[path] = open_arrays(path, self._mapping.csv)
        file = self._files[path]
        name = array.name or (key if key in file.fields or key not in self._mapping.arrays else None)
        if name is None and len(file.fields) == 1:
            name = next(iter(file.fields))
        return file, name or ""

    def _path(self, array: ArrayMapping) -> Path:
        source = self._input_path
        if array.file is None:
            return source
        if isinstance(array.file, str):
            return source.parent / array.file
        change = array.file
        if change.replace not in source.name:
            raise InputError(f"the input's name {source.name} holds no {change.replace!r} to replace by {change.by!r}")
        return source.with_name(source.name.replace(change.replace, change.by, 1))

    def _ordered(self, key: str | None) -> OrderedArray:
        mapping = self._mapping
        file, name = self._find(key)
        values = file.array(name or None)
        label = f"array {name} of {file.path.name}"
        axes = self._array_mapping(key).axes or mapping.axes
        if axes is None:
            axes = ("sample", "channel") if file.table is not None else usual_axes(values, label)
        if len(axes) != values.ndim:
            raise FileFormatError(
                f"{label} has shape {values.shape} but axes {', '.join(axes)}; name one axis per dimension"
            )
        required = [*([mapping.split] if mapping.split else []), *mapping.join]
        missing = [axis for axis in required if axis not in axes]
        if missing:
            raise InputError(
                f"{label} has axes {', '.join(axes)}, without {', '.join(missing)} of join or split; add it"
            )
        if "channel" not in axes:
            values, axes = values[..., np.newaxis], (*axes, "channel")
        values = np.transpose(values, [axes.index(axis) for axis in (*required, "sample", "channel")])
        return OrderedArray(label, values if mapping.split else values[np.newaxis], file, name)

    def _measured(self, name: int | str, unit: str, stated: float | None) -> SampleAxis:
        """Measure the axis of an array or a column of times; ``stated`` is the rate that the mapping gives."""
        table = self._files.get(self._input_path)
        if table is not None and str(name).isdigit() and name not in table.headings:
            name = int(name)
        if table is not None and table.table is not None and (isinstance(name, int) or name in table.headings):
            column = table.table.column(name, "time")
            said = time_unit(table.table.units[column])
            if said is not None and "time_unit" not in self._mapping.model_fields_set:
                unit = said
            if said not in (None, unit):
                raise InputError(f"time_unit = {unit!r} in the mapping, but the file says {said}; correct the mapping")
            digits = table.table.resolutions[column]
            return measured_axis(table.array(None)[:, column], f"time {name}", unit, stated, digits)
        file, array_name = self._find(str(name))
        return measured_axis(file.array(array_name).reshape(-1), f"time {name}", unit, stated)

    def _time_columns(self) -> list[tuple[int | str, str]]:
        """Return the columns of times, with their unit, that a file has and the mapping does not use."""
        result: list[tuple[int | str, str]] = []
        used = {str(channel.column or channel.array) for channel in self._mapping.channels}
        for file in self._files.values():
            if file.path != self._input_path or self._mapping.join or self._mapping.split:
                continue
            if file.table is not None:
                names = [heading or str(k) for k, heading in enumerate(file.table.headings, 1)]
                for k, (name, unit) in enumerate(zip(names, file.table.units, strict=True), 1):
                    first = k == 1 and not file.headings and looks_like_clock(file.table.values[:, 0])
                    named = is_time_name(name) or time_unit(unit) is not None
                    named = named or first or k - 1 in file.table.clocks
                    if named and not {name, str(k)} & used:
                        result.append((k, time_unit(unit) or ""))
            else:
                lengths = {max(np.shape(file.fields[key])) for key in used if key in file.fields}
                result += [
                    (name, time_unit(file.unit_of(name, 0)) or "")
                    for name, value in file.fields.items()
                    if is_time_name(name.rpartition("/")[2]) and name not in used and {np.size(value)} == lengths
                ]
        return result

    def _stored_rate(self, name: str) -> float:
        file, array_name = self._find(name)
        array_name = array_name or name
        if array_name not in file.fields:
            raise FileFormatError(
                f"sample_rate = {name!r}: {file.path.name} has no such array ({', '.join(file.fields)}); "
                "give Hz as a number"
            )
        values = file.array(array_name).reshape(-1)
        if len(values) != 1 or not (np.isfinite(values[0]) and values[0] > 0):
            content = f"{len(values)} numbers" if len(values) != 1 else f"{values[0]:g}"
            raise FileFormatError(
                f"sample_rate = {name!r}: {file.path.name} holds {content} there; name one rate in Hz"
            )
        return float(values[0])
