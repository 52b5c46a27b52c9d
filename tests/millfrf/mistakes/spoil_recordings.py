"""Ways to spoil recordings: samples, channels, sample rates, files that end too early."""

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from acquisition import Recording, RecordingWriter, StreamDescription

SAMPLES = "signals/daq/samples"


def column(folder: Path, file: str, channel: str, change: str) -> None:
    """Change one channel's samples: ``dead``, ``nan``, ``clipped`` ..., or ``=other``, the copy of another."""
    path = folder / file
    names = _names(path)
    with h5py.File(path, "r+") as opened:
        samples = opened[SAMPLES][:]
        chosen = [names.index(each) for each in channel.split("+")]
        for i in chosen:
            other = change.removeprefix("=")
            samples[:, i] = samples[:, names.index(other)] if other != change else CHANGES[change](samples[:, i])
        opened[SAMPLES][...] = samples
        opened.attrs["format_version"] = 1  # as another program writes it: without checksums


def swapped(folder: Path, file: str, first: str, second: str) -> None:
    """Two channels plugged into each other's inputs."""
    path = folder / file
    a, b = _names(path).index(first), _names(path).index(second)
    with h5py.File(path, "r+") as opened:
        samples = opened[SAMPLES][:]
        samples[:, [a, b]] = samples[:, [b, a]]
        opened[SAMPLES][...] = samples
        opened.attrs["format_version"] = 1  # as another program writes it: without checksums


CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "dead": lambda x: np.zeros_like(x),
    "offset": lambda x: np.full_like(x, 2.5),
    "huge": lambda x: np.full_like(x, 1e30) * np.sign(x),
    "nan": lambda x: np.where(np.arange(len(x)) == len(x) // 2, np.nan, x),
    "clipped": lambda x: np.clip(x, np.quantile(x, 0.1), np.quantile(x, 0.9)),
    "limited": lambda x: np.clip(x, -0.4 * np.abs(x).max(), 0.4 * np.abs(x).max()),
    "in g": lambda x: x / 9.80665,
    "in kN": lambda x: x / 1000,
    "reversed": lambda x: -x,
    "cable": lambda x: np.where(np.arange(len(x)) > len(x) // 2, 0.0, x),
}


def channel(folder: Path, file: str, name: str, **changes: object) -> None:
    """Change what a recording says of a channel."""
    with h5py.File(folder / file, "r+") as opened:
        stream = opened["signals/daq"]
        described = json.loads(stream.attrs["channels"])
        for each in described:
            if each["name"] == name:
                each.update(changes)
        stream.attrs["channels"] = json.dumps(described)
        _state_no_copy(opened)


def unplaced(folder: Path, file: str, name: str) -> None:
    """A channel that nobody gave a node and a direction."""
    channel(folder, file, name, node="", direction="")


def without_full_scale(folder: Path, file: str) -> None:
    """No channel says how large it can be."""
    with h5py.File(folder / file, "r+") as opened:
        stream = opened["signals/daq"]
        described = json.loads(stream.attrs["channels"])
        kept = [{key: value for key, value in each.items() if key != "full_scale"} for each in described]
        stream.attrs["channels"] = json.dumps(kept)
        _state_no_copy(opened)


def full_scale(folder: Path, file: str, name: str) -> None:
    """The input's range is 94 % of what the signal reached, and the record is clipped there."""
    names = _names(folder / file)
    with h5py.File(folder / file, "r+") as opened:
        samples = opened[SAMPLES][:]
        i = names.index(name)
        top = float(np.quantile(np.abs(samples[:, i]), 0.97))
        samples[:, i] = np.clip(samples[:, i], -top, top)
        opened[SAMPLES][...] = samples
        opened.attrs["format_version"] = 1  # as another program writes it: without checksums
    channel(folder, file, name, full_scale=top)


def rate(folder: Path, file: str, hertz: float) -> None:
    """State another sample rate."""
    with h5py.File(folder / file, "r+") as opened:
        opened["signals/daq"].attrs["sample_rate"] = hertz
        _state_no_copy(opened)


def shortened(folder: Path, file: str, seconds: float) -> None:
    """Only the first seconds."""
    _rewritten(folder / file, lambda samples, hertz: samples[: round(seconds * hertz)])


def missing(folder: Path, file: str, n_samples: int) -> None:
    """Samples lost in the middle, nobody said so."""

    def lose(samples: np.ndarray, hertz: float) -> np.ndarray:
        middle = len(samples) // 2
        return np.concatenate([samples[:middle], samples[middle + n_samples :]])

    _rewritten(folder / file, lose)


def held(folder: Path, file: str, n_samples: int) -> None:
    """A buffer was lost, and the driver repeated the last values."""
    with h5py.File(folder / file, "r+") as opened:
        samples = opened[SAMPLES][:]
        middle = len(samples) // 2
        samples[middle : middle + n_samples] = samples[middle]
        opened[SAMPLES][...] = samples
        opened.attrs["format_version"] = 1  # as another program writes it: without checksums


def without(folder: Path, file: str, *names: str) -> None:
    """Channels that nobody plugged in."""
    with Recording(folder / file) as recording:
        stream = recording.stream()
        kept = [c for c in stream.channels if c.name not in names]
        samples, described = stream.read(channels=[c.name for c in kept]), stream
        description = StreamDescription(described.name, described.sample_rate, described.start_time, tuple(kept))
        setup = recording.setup
    (folder / file).unlink()
    with RecordingWriter(folder / file, (description,), setup=setup) as writer:
        writer.append(description.name, samples)


def without_setup(folder: Path, file: str) -> None:
    """A recording that states nothing of tool, cut and speed."""
    with h5py.File(folder / file, "r+") as opened:
        opened.attrs["setup"] = ""
        _state_no_copy(opened)


def unclosed(folder: Path, file: str) -> None:
    """As a program leaves it that was killed."""
    with h5py.File(folder / file, "r+") as opened:
        opened.attrs["complete"] = False
        _state_no_copy(opened)


def truncated(folder: Path, file: str) -> None:
    """Half of the bytes, as a copy that was broken off leaves it."""
    whole = (folder / file).read_bytes()
    (folder / file).write_bytes(whole[: len(whole) // 2])


def _state_no_copy(opened: h5py.File) -> None:
    """State a version without a copy of the texts, as another program writes it."""
    opened.attrs["format_version"] = min(int(opened.attrs["format_version"]), 2)


def _rewritten(path: Path, change: Callable[[np.ndarray, float], np.ndarray]) -> None:
    with Recording(path) as recording:
        stream = recording.stream()
        samples, setup = change(stream.read(), stream.sample_rate), recording.setup
        description = StreamDescription(stream.name, stream.sample_rate, stream.start_time, stream.channels)
    path.unlink()
    with RecordingWriter(path, (description,), setup=setup) as writer:
        writer.append(description.name, samples)


def _names(path: Path) -> list[str]:
    with Recording(path) as recording:
        return [channel.name for channel in recording.stream().channels]
