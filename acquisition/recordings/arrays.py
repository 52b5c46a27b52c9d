"""Recordings of arrays in memory: channels described in a few words, samples converted and written to a file."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Literal
from weakref import finalize

import numpy as np
from numpy.typing import ArrayLike, NDArray

from millfrf.core import SI_UNITS, DegreeOfFreedom, InputError, Real, listed, quantities_of, si_factor, without_unit
from millfrf.core.argument_types import checked_type, shown

from ..channels import Channel
from ..sources.source import StreamDescription
from .recording_writer import RecordingWriter

Signals = Mapping[str, ArrayLike] | NDArray[Any]
Channels = Mapping[str, str] | Sequence[Channel]
STREAM = "main"  # name of the clock


class TemporaryFolder:
    """New folder of one file; it is removed when nothing refers to this object any more."""

    def __init__(self) -> None:
        self.path = Path(mkdtemp(prefix="millfrf-"))
        finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    def file(self, name: str) -> Path:
        """Return the path of a recording of this name.

        Raises
        ------
        InputError
            A name that no file has.
        """
        if not isinstance(name, str) or not name.strip(".") or Path(name).name != name:
            raise InputError(f"name {shown(name)}: give the name of a file without folder and suffix")
        return self.path / f"{name}.h5"


def write_bytes(content: bytes, path: Path) -> None:
    """Write a file of this content."""
    path.write_bytes(content)


def write_arrays(
    signals: Signals, rate: float, channels: Channels, start_time: float, texts: Mapping[str, str], path: Path
) -> None:
    """Write signals as a recording; see `Recording.from_arrays` for the parameters.

    Parameters
    ----------
    signals, rate, channels, start_time
        Samples, their rate (Hz), their channels, and the time of the first sample (s).
    texts
        Title, set-up and time of the recording.
    path
        File to write.
    """
    rate, start_time = (
        float(checked_type(name, value, float, unit))
        for name, value, unit in (("rate", rate, "Hz"), ("start_time", start_time, "s"))
    )
    texts = {name: checked_type(name, text, str) for name, text in texts.items()}
    described = _described(channels)
    columns = _columns(signals, list(described))
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        sizes = ", ".join(
            f"{name} has {length}{' samples' * (not n)}" for n, (name, length) in enumerate(lengths.items())
        )
        raise InputError(f"signals of unequal length: {sizes}; cut them to one length")
    if not all(lengths.values()):
        raise InputError("the signals hold no sample; give at least one")
    converted = [_in_si(name, columns[name], words) for name, words in described.items()]
    samples = np.stack([values for _, values in converted], axis=1)
    stream = StreamDescription(STREAM, rate, start_time, tuple(channel for channel, _ in converted))
    kind: Literal["float32", "float64"] = "float32" if samples.dtype == np.float32 else "float64"
    title, setup, recorded_at = (texts[name] for name in ("title", "setup", "recorded_at"))
    with RecordingWriter(path, (stream,), dtype=kind, title=title, setup=setup, recorded_at=recorded_at) as writer:
        writer.append(STREAM, samples)


def _described(channels: Channels) -> dict[str, Channel | str]:
    """Return the description of each channel by its name, in the order of the columns."""
    if isinstance(channels, Mapping):
        for name, words in channels.items():
            if not isinstance(name, str):
                raise InputError(f"channels: {shown(name)}: give the name of a channel as a text")
            if not isinstance(words, str):
                raise InputError(f"channels: {name} {shown(words)}: give unit and place, such as 'N TCP:+X'")
        return dict(channels)
    if isinstance(channels, list | tuple) and all(isinstance(channel, Channel) for channel in channels):
        return {channel.name: channel for channel in channels}
    raise InputError(
        f"channels {shown(channels)}: give a mapping of names to unit and place, such as {{'fx': 'N TCP:+X'}}, or a "
        "list of Channel"
    )


def _columns(signals: Any, names: Sequence[str]) -> dict[str, Any]:
    """Return the samples of each channel."""
    if isinstance(signals, Mapping) or hasattr(signals, "columns"):  # or a table of pandas
        named: dict[str, Any] = {str(name): values for name, values in signals.items()}
        missing = [name for name in named if name not in names]
        if missing:
            raise InputError(f"no description of {listed(missing)}; describe {listed(list(named))} in channels")
        for name in names:
            if name not in named:
                raise InputError(f"no signal {name}; there are {listed(list(named))}")
        return named
    shape = getattr(signals, "shape", None)
    if not isinstance(shape, tuple):
        raise InputError(
            f"signals {shown(signals)}: give an array (n_samples, n_channels), or a mapping of names to arrays"
        )
    if len(shape) != 2:
        raise InputError(f"signals of shape {shape}: give (n_samples, n_channels), or a mapping of names to arrays")
    if shape[1] != len(names):
        remedy = "give signals.T" if shape[0] == len(names) else f"describe {shape[1]} channels"
        raise InputError(f"signals of shape {shape} for {len(names)} channels {listed(names)}: {remedy}")
    return {name: signals[:, number] for number, name in enumerate(names)}


def _in_si(name: str, values: Any, words: Channel | str) -> tuple[Channel, Real]:
    """Return a channel, and its samples in SI units."""
    if isinstance(words, Channel):
        return words, _real(name, without_unit(values, words.unit))
    unit, place = _unit_and_place(words)
    own = str(getattr(values, "units", "")) if hasattr(values, "magnitude") else ""  # a quantity of pint
    if not (own or unit):
        raise InputError(f"channel {name}: {words!r} has no unit; write unit and place, such as 'N TCP:+X'")
    if own:
        values = without_unit(values, unit) if unit else values.magnitude
    unit = unit or own
    quantities = quantities_of(unit)
    if not quantities:
        raise InputError(
            f"channel {name}: {unit} is no unit of {', '.join(SI_UNITS)}; write it as N, g, m/s^2, um or rpm"
        )
    node, direction = ("", "") if not place else (place.node, place.direction)
    samples = _real(name, values)
    factor = samples.dtype.type(si_factor(quantities[0], unit))
    return Channel(name, quantities[0], SI_UNITS[quantities[0]], node, direction), samples * factor


def _unit_and_place(words: str) -> tuple[str, DegreeOfFreedom | None]:
    """Split ``N TCP:+X`` into unit and degree of freedom; a channel without a place has its unit alone."""
    *unit, last = words.split() or [""]
    if ":" not in last:
        return words.strip(), None
    return " ".join(unit), DegreeOfFreedom.parse(last)


def _real(name: str, values: Any) -> Real:
    array = np.asarray(values)
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        raise InputError(f"signal {name}: give real numbers of the shape (n_samples,), not {array.dtype} {array.shape}")
    return np.asarray(array, dtype=np.float32 if array.dtype == np.float32 else np.float64)
