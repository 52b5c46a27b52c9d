"""What is in a file, and what looks wrong with it."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acquisition import Channel, Recording, Stream
from cutting import read_cutting_process
from estimation import read_frf
from modal_fit import read_modal_model
from stability import read_lobes

from .file_kinds import CUTTING, FRF, LOBES, MODEL, RECORDING, kind_of
from .progress import Watch, silent
from .tables import Table, mode_table

NEAR_FULL_SCALE = 0.999
"""Samples above this share of full scale count as overloaded."""


@dataclass(frozen=True)
class Findings:
    """What a look at a file gave.

    Parameters
    ----------
    kind, summary
        What it is, in one line.
    tables
        Its contents.
    concerns
        What looks wrong, one sentence each with the remedy; empty where nothing does.
    """

    kind: str
    summary: str
    tables: tuple[Table, ...] = ()
    concerns: tuple[str, ...] = ()


def inspect_file(path: str | os.PathLike[str], watch: Watch = silent) -> Findings:
    """Look at a recording, an FRF, a model, lobes or a cutting file.

    Raises
    ------
    InputError
        No such file, or none of these.
    """
    kind = kind_of(path)
    if kind == RECORDING:
        return _recording(path, watch)
    readers: dict[str, Callable[[str | os.PathLike[str]], Findings]] = {
        FRF: _frf,
        MODEL: _model,
        LOBES: _lobes,
        CUTTING: _cutting,
    }
    return readers[kind](path)


@dataclass
class ChannelLevel:
    """Running level of one channel.

    Parameters
    ----------
    channel
        Whose samples these are.
    """

    channel: Channel
    n_samples: int = 0
    total: float = 0.0
    squares: float = 0.0
    lowest: float = field(default=np.inf)
    highest: float = field(default=-np.inf)
    n_missing: int = 0
    n_overloaded: int = 0
    _origin: float | None = None

    def add(self, samples: np.ndarray) -> None:
        """Take in the next samples (n,); those that are not finite are counted and left out."""
        finite = samples[np.isfinite(samples)]
        self.n_missing += len(samples) - len(finite)
        if not len(finite):
            return
        if self._origin is None:
            self._origin = float(finite[0])  # squares about a near value: no cancellation for a large offset
        centred = finite - self._origin
        self.n_samples += len(finite)
        self.total += float(centred.sum())
        self.squares += float(centred @ centred)
        self.lowest = min(self.lowest, float(finite.min()))
        self.highest = max(self.highest, float(finite.max()))
        if self.channel.full_scale:
            self.n_overloaded += int(np.sum(np.abs(finite) >= NEAR_FULL_SCALE * self.channel.full_scale))

    @property
    def mean(self) -> float:
        """Of all finite samples."""
        return (self._origin or 0.0) + self.total / max(self.n_samples, 1)

    @property
    def deviation(self) -> float:
        """Standard deviation: root mean square about the mean."""
        n = max(self.n_samples, 1)
        return float(np.sqrt(max(self.squares / n - (self.total / n) ** 2, 0.0)))

    @property
    def peak(self) -> float:
        """Largest magnitude."""
        return max(abs(self.lowest), abs(self.highest)) if self.n_samples else 0.0

    def concerns(self) -> list[str]:
        """What looks wrong with this channel."""
        name, found = self.channel.name, []
        if self.n_missing:
            found.append(f"{name}: {self.n_missing} samples are NaN or infinite; record anew or cut them out")
        if self.n_overloaded:
            found.append(f"{name}: {self.n_overloaded} samples at full scale (overload); choose a larger range")
        if self.n_samples and self.deviation == 0:
            found.append(f"{name}: every sample is {self.mean:g} (dead channel); check cable and supply")
        full_scale = self.channel.full_scale
        if full_scale and self.n_samples and 0 < self.peak < 1e-3 * full_scale:
            found.append(f"{name}: peak is {100 * self.peak / full_scale:.2g} % of full scale; choose a smaller range")
        return found


def channel_levels(stream: Stream, watch: Watch = silent) -> tuple[ChannelLevel, ...]:
    """Levels of every channel, in one pass over the file."""
    levels = tuple(ChannelLevel(channel) for channel in stream.channels)
    done = 0
    with watch(f"levels of {stream.name}", stream.n_samples) as update:
        for block in stream.blocks():
            for column, level in enumerate(levels):
                level.add(block[:, column])
            done += len(block)
            update(done)
    return levels


def level_table(stream: Stream, levels: tuple[ChannelLevel, ...]) -> Table:
    """One row a channel."""
    rows = tuple(
        (
            level.channel.name,
            level.channel.degree_of_freedom if level.channel.node else "",
            level.channel.quantity,
            level.channel.unit,
            f"{level.mean:.4g}",
            f"{level.deviation:.4g}",
            f"{level.peak:.4g}",
            "" if level.channel.full_scale is None else f"{level.channel.full_scale:g}",
            str(level.n_overloaded) if level.channel.full_scale else "",
        )
        for level in levels
    )
    columns = ("channel", "place", "quantity", "unit", "mean", "rms about mean", "peak", "full scale", "overloaded")
    title = f"stream {stream.name}: {stream.sample_rate:g} Hz, {stream.duration:.4g} s, {stream.n_samples} samples"
    return Table(title, columns, rows)


def _recording(path: str | os.PathLike[str], watch: Watch) -> Findings:
    tables, concerns = [], []
    with Recording(path) as recording:
        if recording.complete is not True:
            concerns.append("the recording was not closed in order: its end may be missing")
        for stream in recording.streams.values():
            if stream.n_samples == 0:
                concerns.append(f"stream {stream.name} holds no sample")
                continue
            levels = channel_levels(stream, watch)
            tables.append(level_table(stream, levels))
            concerns += [concern for level in levels for concern in level.concerns()]
        title = recording.title or "untitled"
        summary = f"recording, {title}, {recording.recorded_at or 'no date'}"
        if recording.events:
            rows = tuple((name, str(len(series.read()[0]))) for name, series in recording.events.items())
            tables.append(Table("events", ("name", "values"), rows))
    return Findings(RECORDING, summary, tuple(tables), tuple(concerns))


def _frf(path: str | os.PathLike[str]) -> Findings:
    frf = read_frf(path)
    f, concerns = frf.frequencies, []
    if not frf.valid.all():
        concerns.append(f"{int((~frf.valid).sum())} of {len(f)} lines have no FRF (dependent inputs)")
    coherence = frf.multiple_coherence
    rows = []
    for p, response in enumerate(frf.responses):
        peak = np.abs(frf.values[:, p]).max(axis=1)
        line = int(np.argmax(np.where(frf.valid, peak, 0.0)))
        median = "" if coherence is None else f"{np.median(coherence[frf.valid, p]):.3f}"
        rows.append((response, f"{peak[line]:.3g} {frf.unit}", f"{f[line]:.4g}", median))
        if coherence is not None and frf.valid.any() and np.median(coherence[frf.valid, p]) < 0.5:
            concerns.append(f"{response}: median multiple coherence below 0.5; keep only the band that is excited")
    summary = (
        f"{frf.quantity} in {frf.unit}, {f[0]:g} to {f[-1]:g} Hz in {len(f)} lines, "
        f"excited at {', '.join(frf.excitations)}"
    )
    table = Table("responses", ("response", "largest value", "at (Hz)", "median multiple coherence"), tuple(rows))
    return Findings(FRF, summary, (table,), tuple(concerns))


def _model(path: str | os.PathLike[str]) -> Findings:
    model = read_modal_model(path)
    concerns = [
        f"mode {r + 1} at {model.natural_frequencies[r]:.4g} Hz has a damping ratio of {zeta:.3g}: not a vibration mode"
        for r, zeta in enumerate(model.damping_ratios)
        if not 0 < zeta < 0.5
    ]
    summary = (
        f"modal model, {len(model.poles)} modes, {model.quantity} in {model.unit}, responses "
        f"{', '.join(model.responses)}, excitations {', '.join(model.excitations)}"
    )
    return Findings(MODEL, summary, (mode_table(model),), tuple(concerns))


def _lobes(path: str | os.PathLike[str]) -> Findings:
    lobes = read_lobes(path)
    if not len(lobes.spindle_speeds):
        return Findings(LOBES, "stability lobes", concerns=("the table holds no spindle speed",))
    rpm, depths = lobes.spindle_speeds_rpm, lobes.depth_limits
    summary = (
        f"stability lobes at {len(rpm)} speeds, {rpm.min():.0f} to {rpm.max():.0f} rpm, lowest limit "
        f"{1e3 * depths.min():.3g} mm at {rpm[depths.argmin()]:.0f} rpm"
    )
    concerns = ("no depth limit at any speed",) if not np.isfinite(depths).any() else ()
    return Findings(LOBES, summary, concerns=concerns)


def _cutting(path: str | os.PathLike[str]) -> Findings:
    process = read_cutting_process(path)
    immersion = (np.degrees(process.start_angle), np.degrees(process.exit_angle))
    summary = (
        f"cutting data of {Path(path).name}: {process.teeth} teeth, {1e3 * process.diameter:g} mm, "
        f"Ktc {process.ktc / 1e6:g} MPa, immersion {immersion[0]:g} to {immersion[1]:g} deg"
    )
    return Findings(CUTTING, summary)
