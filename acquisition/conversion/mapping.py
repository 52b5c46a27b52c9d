"""`RecordingMapping`: which array or column of a file is which channel, a TOML file that is checked when read."""

import datetime
import os
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from millfrf.core import SI_UNITS, InputError, checked_toml, si_factor

from ..channels import STRICT, Channel, ChannelKeys, Name, Positive
from .text_lines import TextOptions


class NameChange(BaseModel):
    """Name of another file: the input's name with one part replaced.

    Parameters
    ----------
    replace
        Part of the input's name.
    by
        Text that replaces it in the other file's name.
    """

    model_config = STRICT
    replace: Name
    by: str


class ArrayMapping(BaseModel):
    """Place of an array, and the names of its axes.

    Parameters
    ----------
    file
        A file in the input's folder, or ``{replace, by}`` applied to the input's name; left out: the input itself.
    name
        Name of the array inside its file; left out: the mapping's own key if the file has it, else the only array.
    axes
        One name per axis: ``sample``, ``channel`` if there are several columns, and further ones; left out: the
        mapping's.
    """

    model_config = STRICT
    file: str | NameChange | None = None
    name: str | None = None
    axes: tuple[str, ...] | None = None


class ChannelMapping(ChannelKeys):
    """One channel: its place in the file, its place on the machine, and the conversion of its numbers to SI units.

    ``value = (stored - offset) / sensitivity * (unit in SI)``

    Parameters
    ----------
    unit
        Unit of the stored numbers after ``sensitivity``: ``kN``, ``g``, ``um``; the recording holds SI units.
    input_delay_s : s
        Time by which the input lags behind the others; samples stay as they are, spectra and fits compensate it.
    array
        Key of ``[arrays.KEY]`` or name of an array in the input; left out if there is only one.
    column
        Column along the ``channel`` axis: a number counted from 1, or a heading of the table. Left out if there is only
        one column.
    full_scale
        Largest magnitude of the input, in ``unit``; samples that reach it count as overload.
    sensitivity
        Stored numbers per ``unit``, for example 0.1 if 0.1 V are 1 g; not 0, and negative if the sign is reversed.
    offset
        Stored number that means zero; it is subtracted before the division by ``sensitivity``.
    """

    unit: str
    array: str | None = None
    column: Annotated[int, Field(ge=1)] | str | None = None
    full_scale: Positive | None = None
    input_delay_s: Annotated[float, Field(ge=0, le=1)] | None = None
    sensitivity: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _check(self) -> "ChannelMapping":
        if self.sensitivity == 0:
            raise ValueError("sensitivity 0 would divide by zero; give stored numbers per unit")
        try:
            self.channel()
        except InputError as error:
            raise ValueError(str(error)) from error
        return self

    def channel(self) -> Channel:
        factor = si_factor(self.quantity, self.unit)
        return Channel(
            self.name,
            self.quantity,
            SI_UNITS[self.quantity],
            self.node,
            self.direction,
            None if self.full_scale is None else self.full_scale * abs(factor),
            self.high_pass_hz,
            self.sensor,
            self.input_delay_s,
        )

    def to_si(self, stored: NDArray[np.floating]) -> NDArray[np.floating]:
        """Convert stored numbers to SI units; numbers that need no conversion keep their type."""
        values = stored if self.offset == 0 else stored - self.offset
        factor = si_factor(self.quantity, self.unit) / self.sensitivity
        return values if factor == 1 else values * factor


def _time_as_text(value: object) -> object:
    """Accept a date or time of TOML, which is written without quotation marks."""
    return value.isoformat() if isinstance(value, datetime.date) else value


def _checked_time(text: str) -> str:
    """Accept a date, or a time with its zone; without a zone, a time may be hours off."""
    if not text:
        return text
    try:
        moment = datetime.datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(
            f"{text!r} is no time as ISO 8601 writes it; write such as 2026-03-02T09:30:00Z, or the date, 2026-03-02"
        ) from error
    if moment.tzinfo is None and len(text) > len("2026-03-02"):
        raise ValueError(f"{text!r} has no zone; add it, such as {text}+01:00, or Z for UTC, or give the date alone")
    return text


class RecordingMapping(BaseModel):
    """Mapping file: which array or column of a file of another program is which channel.

    Parameters
    ----------
    channels
        Channels in the order of the recording's columns.
    sample_rate : Hz
        Samples per second, or the name of the array that holds this one number; or instead ``time``; neither if the
        file states its own (WAV, UFF, TDMS waveforms).
    arrays
        Arrays by key, for those that are not found by their name in the input.
    axes
        Axes of every array that does not name its own; left out: ``sample, channel``, and a single row is one channel.
    join
        Axes whose entries follow one another in time, slowest first.
    split
        Axis whose entries become one recording each: ``rec.h5`` becomes ``rec-1.h5``, ``rec-2.h5`` ...
    title
        Title of the recording.
    setup
        Set-up of the recording as TOML text (tool, cut, pose).
    recorded_at
        Time of the recording, ISO 8601 with zone, such as ``2026-03-02T09:30:00Z``, or its date alone, such as
        ``2026-03-02``; left out: not known.
    stream
        Name of the sample clock in the recording.
    time
        Array or column of times, a heading or a number from 1, evenly spaced to 1 % of a step; instead of
        ``sample_rate``. Missing samples stay missing.
    time_unit
        Unit of these times; left out: from the heading, else s.
    start_time : s
        Time that is added to the start that the file states.
    common_length
        Whether arrays of unequal lengths keep the first samples, as many as the shortest has.
    dtype
        Type of the stored samples; left out: ``float32`` if it holds the input's digits, else ``float64``.
    csv
        Layout of a text file, if it is not recognised.
    """

    model_config = STRICT
    channels: Annotated[tuple[ChannelMapping, ...], Field(min_length=1)]
    title: str = ""
    setup: str = ""
    recorded_at: Annotated[str, BeforeValidator(_time_as_text), AfterValidator(_checked_time)] = ""
    stream: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")] = "main"
    sample_rate: float | str | None = None
    time: Annotated[int, Field(ge=1)] | str | None = None
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    start_time: float = 0.0
    common_length: bool = False
    dtype: Literal["float32", "float64"] | None = None
    arrays: dict[str, ArrayMapping] = Field(default_factory=dict)
    axes: tuple[str, ...] | None = None
    join: tuple[str, ...] = ()
    split: str | None = None
    csv: TextOptions = TextOptions()

    @model_validator(mode="after")
    def _check(self) -> "RecordingMapping":
        repeated = [name for name, count in Counter(channel.name for channel in self.channels).items() if count > 1]
        if repeated:
            raise ValueError(f"channel {', '.join(repeated)} appears twice; give unique names")
        if isinstance(self.sample_rate, float) and self.sample_rate <= 0:
            raise ValueError(f"sample_rate must be above 0, not {self.sample_rate:g}")
        if self.sample_rate is not None and self.time is not None:
            raise ValueError("give either sample_rate (Hz) or time (name of the array or column of times), one of them")
        for key, axes in [("axes", self.axes), *((f"arrays.{k}.axes", a.axes) for k, a in self.arrays.items())]:
            if axes is not None:
                self._check_axes(key, axes)
        return self

    def _check_axes(self, key: str, axes: tuple[str, ...]) -> None:
        if len(set(axes)) != len(axes) or "sample" not in axes:
            raise ValueError(f"{key} = {list(axes)} must name each axis once, 'sample' among them")
        unused = set(axes) - {"sample", "channel", self.split, *self.join}
        if unused:
            raise ValueError(f"{key}: axis {', '.join(sorted(unused))} is neither in join nor split; put it into one")


def load_mapping(path: str | os.PathLike[str]) -> RecordingMapping:
    """Read a mapping file; raise an InputError for a missing file, wrong TOML, or a key that is unknown or wrong."""
    return checked_toml(Path(path), RecordingMapping, "mapping")
