"""Ways to spoil good files as a laboratory does: each function takes the folder and the words of the table."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from acquisition import Recording, RecordingWriter, StreamDescription
from estimation import Frf, read_frf, write_frf, write_frf_uff
from modal_fit import read_modal_model, write_modal_model

SAMPLES = "signals/daq/samples"


def toml(folder: Path, file: str, *lines: str) -> None:
    """Replace each key's first line, or add it to the last table; ``-key`` takes it out."""
    path = folder / file
    rows = path.read_text(encoding="utf-8").splitlines()
    for line in lines:
        key = line.partition("=")[0].strip()
        found = next((i for i, row in enumerate(rows) if row.partition("=")[0].strip() == key.lstrip("-")), None)
        if key.startswith("-"):
            assert found is not None, key
            del rows[found]
        elif found is None:
            rows.append(line)
        else:
            rows[found] = line
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def cut(folder: Path, *lines: str) -> None:
    """Change the cutting file."""
    toml(folder, "cut.toml", *lines)


def plan(folder: Path, *lines: str) -> None:
    """Change the plan."""
    toml(folder, "plan.toml", *lines)


def renamed(folder: Path, file: str, old: str, new: str) -> None:
    """Write a key otherwise."""
    path = folder / file
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")


def timed(folder: Path, file: str) -> None:
    """Columns after one of times, which the mapping names."""
    path = folder / file
    kept = [
        row for row in path.read_text(encoding="utf-8").splitlines() if not row.startswith(("sample_rate", "column"))
    ]
    content = "\n".join(['time = "t"', *kept]) + "\n"
    for name in ("fx", "ax"):
        content = content.replace(f'name = "{name}"', f'name = "{name}"\ncolumn = "{name}"')
    path.write_text(content, encoding="utf-8")


def text(folder: Path, file: str, content: str) -> None:
    """A file of text, whatever its suffix."""
    (folder / file).write_text(content, encoding="utf-8")


def pdf(folder: Path, file: str) -> None:
    """The head of a PDF, binary."""
    (folder / file).write_bytes(b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n" + bytes(range(256)) * 4)


def empty(folder: Path, file: str) -> None:
    """A file of no bytes."""
    (folder / file).write_bytes(b"")


def subfolder(folder: Path, name: str) -> None:
    """A folder where a file is expected."""
    (folder / name).unlink(missing_ok=True)
    (folder / name).mkdir()


def copy(folder: Path, source: str, target: str) -> None:
    """A copy under another name."""
    shutil.copy(folder / source, folder / target)


def column(folder: Path, file: str, channel: str, change: str) -> None:
    """Change one channel's samples: ``dead``, ``nan``, ``clipped`` ..., or ``=other``, the copy of another."""
    path = folder / file
    names = _names(path)
    with h5py.File(path, "r+") as opened:
        samples = opened[SAMPLES][:]
        chosen = [names.index(one) for one in channel.split("+")]
        for i in chosen:
            other = change.removeprefix("=")
            samples[:, i] = samples[:, names.index(other)] if other != change else CHANGES[change](samples[:, i])
        opened[SAMPLES][...] = samples


def swapped(folder: Path, file: str, first: str, second: str) -> None:
    """Two channels plugged into each other's inputs."""
    path = folder / file
    a, b = _names(path).index(first), _names(path).index(second)
    with h5py.File(path, "r+") as opened:
        samples = opened[SAMPLES][:]
        samples[:, [a, b]] = samples[:, [b, a]]
        opened[SAMPLES][...] = samples


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
        for one in described:
            if one["name"] == name:
                one.update(changes)
        stream.attrs["channels"] = json.dumps(described)


def unplaced(folder: Path, file: str, name: str) -> None:
    """A channel that nobody gave a node and a direction."""
    channel(folder, file, name, node="", direction="")


def without_full_scale(folder: Path, file: str) -> None:
    """No channel says how large it can be."""
    with h5py.File(folder / file, "r+") as opened:
        stream = opened["signals/daq"]
        described = json.loads(stream.attrs["channels"])
        kept = [{key: value for key, value in one.items() if key != "full_scale"} for one in described]
        stream.attrs["channels"] = json.dumps(kept)


def full_scale(folder: Path, file: str, name: str) -> None:
    """The input's range is 94 % of what the signal reached, and the record is clipped there."""
    names = _names(folder / file)
    with h5py.File(folder / file, "r+") as opened:
        samples = opened[SAMPLES][:]
        i = names.index(name)
        top = float(np.quantile(np.abs(samples[:, i]), 0.97))
        samples[:, i] = np.clip(samples[:, i], -top, top)
        opened[SAMPLES][...] = samples
    channel(folder, file, name, full_scale=top)


def rate(folder: Path, file: str, hertz: float) -> None:
    """State another sample rate."""
    with h5py.File(folder / file, "r+") as opened:
        opened["signals/daq"].attrs["sample_rate"] = hertz


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


def unclosed(folder: Path, file: str) -> None:
    """As a program leaves it that was killed."""
    with h5py.File(folder / file, "r+") as opened:
        opened.attrs["complete"] = False


def truncated(folder: Path, file: str) -> None:
    """Half of the bytes, as a copy that was broken off leaves it."""
    whole = (folder / file).read_bytes()
    (folder / file).write_bytes(whole[: len(whole) // 2])


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


def frf(folder: Path, file: str, change: str) -> None:
    """Change an FRF file by name of the change."""
    if change in DAMAGE:  # what no program of ours would write
        with h5py.File(folder / file, "r+") as opened:
            DAMAGE[change](opened)
        return
    path = folder / file
    write_frf(path, FRF_CHANGES[change](read_frf(path)))


def _negative(opened: h5py.File) -> None:
    opened["frequencies"][0] = -1.0


def _unordered(opened: h5py.File) -> None:
    f = opened["frequencies"][:]
    f[[10, 20]] = f[[20, 10]]
    opened["frequencies"][...] = f


def _nan_lines(opened: h5py.File) -> None:
    values = opened["values"][:]
    values[100:140] = np.nan
    opened["values"][...] = values


def _coherence_five(opened: h5py.File) -> None:
    opened["multiple_coherence"][...] = 5.0


DAMAGE: dict[str, Callable[[h5py.File], None]] = {
    "negative frequency": _negative,
    "unordered frequencies": _unordered,
    "nan lines": _nan_lines,
    "coherence 5": _coherence_five,
}


def _accelerance(frf: Frf) -> np.ndarray:
    return frf.values * ((2j * np.pi * frf.frequencies) ** 2)[:, None, None]


def _poor(frf: Frf) -> Frf:
    rng = np.random.default_rng(4)
    noise = rng.standard_normal(frf.values.shape) + 1j * rng.standard_normal(frf.values.shape)
    coherence = np.full(frf.values.shape[:2], 0.2)
    return replace(frf, values=frf.values + np.abs(frf.values) * noise, multiple_coherence=coherence)


FRF_CHANGES: dict[str, Callable[[Frf], Frf]] = {
    "conjugate": lambda one: replace(one, values=one.values.conj()),
    "all zero": lambda one: replace(one, values=np.zeros_like(one.values)),
    "accelerance called receptance": lambda one: replace(one, values=_accelerance(one)),
    "accelerance": lambda one: replace(one, values=_accelerance(one), quantity="accelerance", unit="m/s^2/N"),
    "kN": lambda one: replace(one, values=1e3 * one.values),
    "mm": lambda one: replace(one, values=1e3 * one.values),
    "reversed sensor": lambda one: replace(one, values=-one.values),
    "two responses swapped": lambda one: replace(one, values=one.values[:, [1, 0, 2]]),
    "one entry turned": lambda one: replace(one, values=one.values * [[1, -1, 1], [1, 1, 1], [1, 1, 1]]),
    "another structure": lambda one: replace(one, frequencies=2.3 * one.frequencies),
    "poor": _poor,
    "incoherent": lambda one: replace(one, multiple_coherence=np.full(one.values.shape[:2], 0.2), covariance=None),
    "shorter axis": lambda one: replace(
        one,
        frequencies=one.frequencies[::2],
        values=one.values[::2],
        valid=one.valid[::2],
        multiple_coherence=None if one.multiple_coherence is None else one.multiple_coherence[::2],
    ),
}


def model(folder: Path, file: str, change: str) -> None:
    """Change a modal model by name of the change."""
    path = folder / file
    if change in JSON_CHANGES:
        content = json.loads(path.read_text(encoding="utf-8"))
        JSON_CHANGES[change](content)
        path.write_text(json.dumps(content), encoding="utf-8")
        return
    one = read_modal_model(path)
    changed = {
        "in Hz": lambda: replace(one, poles=one.poles / (2 * np.pi)),
        "unstable": lambda: replace(one, poles=-one.poles.conj()),
        "no mode": lambda: replace(one, poles=one.poles[:0], right=one.right[:0], left=one.left[:0]),
        "two directions": lambda: replace(one, right=one.right[:, :2], responses=one.responses[:2]),
        "mm": lambda: replace(one, right=1e3 * one.right),
        "far band": lambda: replace(one, band=(2.0, 3.0)),
        "narrow band": lambda: replace(one, band=(15.0, 20.0)),
    }[change]()
    write_modal_model(path, changed)


JSON_CHANGES: dict[str, Callable[[dict[str, object]], None]] = {
    "missing field": lambda content: content.pop("left") and None,
    "text for numbers": lambda content: content.update(poles_rad_per_s=[["a", "b"]] * 2),
}


def lobes(folder: Path, file: str = "lobes.csv") -> None:
    """Lobes as the command writes them."""
    from millfrf.__main__ import run

    base = [str(folder / "model_tip.json"), "--cutting", str(folder / "cut.toml"), "--max-depth", "0.01"]
    assert run(["lobes", *base, "--speeds", "600", "1200", "5", "--out", str(folder / file)]) == 0


def estimated(folder: Path) -> None:
    """An FRF of the sweeps, as the command writes it."""
    from millfrf.__main__ import run

    names = [str(folder / f"{name}.h5") for name in ("central", "down", "up")]
    assert run(["estimate", *names, "--segment", "4", "--band", "12", "30", "--out", str(folder / "frf.h5")]) == 0


def fitted(folder: Path) -> None:
    """The model fitted to :func:`estimated`."""
    from millfrf.__main__ import run

    assert run(["fit", str(folder / "frf.h5"), "--band", "15.2", "22.5", "--out", str(folder / "model.json")]) == 0


RAIL = """
[[frames]]
name = "rail"
antecedent = "0"
motion = "prismatic"
alpha_deg = 90.0
{limits}
source = "test"
[[frames]]
name = "carriage"
antecedent = "rail"
motion = "fixed"
alpha_deg = -90.0
source = "test"
"""
ON_RAIL = """
[[joints]]
frame = "rail"
nodes = [0, 12]
axial_n_per_m = 5e7
source = "test"
[[links]]
nodes = [12, 13]
source = "test"
[[points]]
node = 13
frame = "carriage"
at_m = [0.0, 0.0, 0.0]
source = "test"
"""


def rail(folder: Path, limits: str) -> None:
    """A robot on a rail, whose file states the rail's limits by this line."""
    from importlib.resources import files

    text = (files("robot_model") / "robots" / "kuka_kr90_r3100.toml").read_text(encoding="utf-8")
    text = text.replace('antecedent = "0"\nr_m = 0.675', 'antecedent = "carriage"\nr_m = 0.675')
    head, tail = text.split("[[frames]]", 1)
    tail = tail.replace("nodes = [0, 1]", "nodes = [13, 1]", 1)
    tail = tail.replace("driven_deg = [0.0, -10.0", "driven = [2.0, 0.0, -10.0")
    (folder / "rail.toml").write_text(
        head + RAIL.format(limits=limits) + "[[frames]]" + tail + ON_RAIL, encoding="utf-8"
    )


def robot(folder: Path, *lines: str) -> None:
    """A robot's file beside the others, lines replaced as :func:`toml` does."""
    from importlib.resources import files

    content = (files("robot_model") / "robots" / "staubli_rx170.toml").read_text(encoding="utf-8")
    (folder / "robot.toml").write_text(content, encoding="utf-8")
    toml(folder, "robot.toml", *lines)


def analyser(folder: Path, file: str, unit: str = "m/N", change: str = "") -> None:
    """The tool tip's first FRF as an analyser exports it, and its mapping; ``conjugated`` for exp(-i w t)."""
    frf = read_frf(folder / "frf_tip.h5")
    values = frf.values[:, 0, 0].conj() if change == "conjugated" else frf.values[:, 0, 0]
    rows = (f"{f:.6e}\t{h.real:.9e}\t{h.imag:.9e}" for f, h in zip(frf.frequencies, values, strict=True))
    header = f"Analyser\n\nFrequency\tReal\tImaginary\nHz\t{unit}\t{unit}\n"
    (folder / file).write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    labels = f'responses = ["{frf.responses[0]}"]\nexcitations = ["{frf.excitations[0]}"]\n'
    (folder / "frf.toml").write_text("[frf]\n" + labels, encoding="utf-8")


def exported(folder: Path, file: str) -> None:
    """The tool tip's FRFs as a UFF file."""
    write_frf_uff(folder / file, read_frf(folder / "frf_tip.h5"), binary=False)


def records(folder: Path, file: str) -> None:
    """The same data sets, called time records (function type 1)."""
    exported(folder, file)
    text = (folder / file).read_text(encoding="utf-8")
    (folder / file).write_text(
        text.replace("    4         0    0         0", "    1         0    0         0"), encoding="utf-8"
    )
