"""Hammer tests whose truth is known: modal superposition with the response to half-sine taps in closed form.

For one mode, ``y' = p y + sin(W t)`` from rest has ``y = (W exp(p t) - W cos(W t) - p sin(W t)) / (p^2 + W^2)`` during
the contact, ``W = pi / width``, and decays freely after it. Nothing of the project's simulation or estimation is used.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.signal import decimate

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from estimation import (
    FoundTaps,
    MergedTaps,
    TapSettings,
    TapTest,
    choose_channels,
    choose_segments,
    found_taps,
    merge_taps,
    response_decay,
    screened,
    tap_sums,
    window_for,
    without_hum,
)

FINER = 8
UNITS = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
ORDER = {"displacement": 0, "velocity": 1, "acceleration": 2}
QUANTITY = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}


@dataclass(frozen=True)
class Structure:
    """Real modes, scaled to unit mass: frequencies (Hz), damping ratios, and a shape (n_modes,) for each place."""

    frequencies: np.ndarray
    damping: np.ndarray
    shapes: dict[str, np.ndarray]

    @property
    def poles(self) -> np.ndarray:
        """rad/s."""
        natural = 2 * np.pi * self.frequencies
        return natural * (-self.damping + 1j * np.sqrt(1 - self.damping**2))

    def residues(self, response: str, excitation: str) -> np.ndarray:
        """Of the receptance ``sum R / (s - p) + conjugate``."""
        return self.shapes[response] * self.shapes[excitation] / (2j * self.poles.imag)

    def frf(self, s: np.ndarray, response: str, excitation: str, order: int = 0) -> np.ndarray:
        """At points of the Laplace plane; order 2 gives accelerance."""
        parts = self.residues(response, excitation) / (s[:, None] - self.poles)
        mirrored = self.residues(response, excitation).conj() / (s[:, None] - self.poles.conj())
        return s**order * (parts + mirrored).sum(axis=1)

    def response(self, time: np.ndarray, residues: np.ndarray, width: float, order: int = 0) -> np.ndarray:
        """To a half sine of 1 N that begins at 0 s, (n_times, n_responses) of residues (n_modes, n_responses)."""
        omega, inside, later = np.pi / width, (time >= 0) & (time < width), time >= width
        touching, free = time[inside], time[later] - width
        total = np.zeros((len(time), residues.shape[1]))
        for pole, residue in zip(self.poles, residues, strict=True):
            forced = (
                omega * np.exp(pole * touching) - omega * np.cos(omega * touching) - pole * np.sin(omega * touching)
            )
            y = np.zeros(len(time), dtype=complex)
            y[inside] = forced / (pole**2 + omega**2)
            end = omega * (np.exp(pole * width) + 1) / (pole**2 + omega**2)
            y[later] = end * np.exp(pole * free)
            motion = pole**order * y
            if order == 2:
                motion[inside] += pole * np.sin(omega * touching)
            total += 2 * (np.outer(motion.real, residue.real) - np.outer(motion.imag, residue.imag))
        return total


@dataclass(frozen=True)
class Hits:
    """What was done in one recording.

    Parameters
    ----------
    times
        When each contact begins, s.
    at
        Place of each; one for all, or one each.
    again
        ``{number of the tap: (delay in s, share of the force)}``: double hits.
    aside
        Other place that feels a share of each force, and the share: an oblique hit.
    peak, width, spread
        N, s, and how far peaks differ, as a share.
    """

    times: Sequence[float]
    at: str | Sequence[str] = "P1:+Z"
    again: dict[int, tuple[float, float]] = field(default_factory=dict)
    aside: tuple[str, float] | None = None
    peak: float = 200.0
    width: float = 2e-3
    spread: float = 0.2

    @property
    def places(self) -> list[str]:
        """Of each tap."""
        return [self.at] * len(self.times) if isinstance(self.at, str) else list(self.at)


@dataclass(frozen=True)
class Bench:
    """How it was recorded.

    Parameters
    ----------
    rate, seconds
        Hz and s.
    quantity
        Of the responses.
    noise, force_noise
        Standard deviation over the largest value of each channel; of the force None: as of the responses.
    offset, drift
        Of each response over its largest value: constant, and by the end.
    zero
        Of each force: what it shows at rest, N.
    hum
        Of the mains, 50 Hz, in each response over its largest value.
    full_scale
        Of forces and of responses; larger values are clipped. None: not known, and not clipped.
    stated
        Whether the file states its full scale.
    """

    rate: float = 5120.0
    seconds: float = 10.0
    quantity: str = "acceleration"
    noise: float = 1e-3
    force_noise: float | None = None
    offset: float = 0.0
    drift: float = 0.0
    zero: float = 0.0
    hum: float = 0.0
    full_scale: tuple[float | None, float | None] = (None, None)
    stated: bool = True
    seed: int = 0


def write_taps(
    path: Path,
    structure: Structure,
    hits: Hits,
    responses: Sequence[str],
    bench: Bench = Bench(),
    *,
    forces: Sequence[str] = (),
    unnamed: bool = False,
    setup: str = "",
) -> Path:
    """Record; ``forces`` are the places of the force channels (default: those that were hit).

    As in a converter, signals are computed eight times faster and pass one linear-phase filter before they are sampled.
    """
    fine = np.arange(FINER * round(bench.rate * bench.seconds)) / (FINER * bench.rate)
    generator = np.random.default_rng(bench.seed)
    channels_of = list(forces) or list(dict.fromkeys(hits.places))
    force, motion = np.zeros((len(fine), len(channels_of))), np.zeros((len(fine), len(responses)))
    for number, (start, place) in enumerate(zip(hits.times, hits.places, strict=True)):
        peak = hits.peak * (1 + hits.spread * (generator.random() - 0.5))
        for delay, share in itertools.chain([(0.0, 1.0)], [hits.again[number]] if number in hits.again else []):
            for where, part in itertools.chain([(place, 1.0)], [hits.aside] if hits.aside else []):
                first = int(np.searchsorted(fine, start + delay))
                own, size = fine[first:] - start - delay, peak * share * part
                pulse = np.where(own < hits.width, np.sin(np.pi * np.minimum(own, hits.width) / hits.width), 0.0)
                if where in channels_of:
                    force[first:, channels_of.index(where)] += size * pulse
                residues = np.column_stack([structure.residues(response, where) for response in responses])
                motion[first:] += size * structure.response(own, residues, hits.width, ORDER[bench.quantity])
    force, motion = (decimate(table, FINER, ftype="fir", axis=0) for table in (force, motion))
    time, size = fine[::FINER], np.abs(motion).max(axis=0)
    motion += size * (bench.offset + bench.drift * (time / time[-1])[:, None])
    motion += size * bench.hum * np.sin(2 * np.pi * 50.0 * time)[:, None]
    motion += bench.noise * size * generator.standard_normal(motion.shape)
    force_noise = bench.noise if bench.force_noise is None else bench.force_noise
    force += force_noise * np.abs(force).max() * generator.standard_normal(force.shape) + bench.zero
    samples, channels = [], []
    for kind, table, places, scale in (
        ("force", force, channels_of, bench.full_scale[0]),
        (bench.quantity, motion, responses, bench.full_scale[1]),
    ):
        for column, place in enumerate(places):
            node, direction = ("", "") if unnamed else place.split(":")
            name = f"{'f' if kind == 'force' else 'a'}{column + 1}"
            stated = scale if bench.stated else None
            channels.append(Channel(name, kind, UNITS.get(kind, "N"), node, direction, stated))
            samples.append(table[:, column] if scale is None else np.clip(table[:, column], -scale, scale))
    description = StreamDescription("main", bench.rate, 0.0, tuple(channels))
    with RecordingWriter(path, [description], title="taps", setup=setup, dtype="float64") as writer:
        writer.append("main", np.column_stack(samples))
    return path


def plate(n_places: int = 4, damping: Sequence[float] = (0.02, 0.015, 0.01, 0.012)) -> Structure:
    """Four modes between 60 and 420 Hz, seen from places ``P1:+Z`` ... with shapes of a free strip."""
    frequencies = np.array([62.0, 141.0, 260.0, 418.0])
    x = np.linspace(0.05, 0.95, n_places)
    shapes = np.array([np.cos((k + 1) * np.pi * x + 0.2 * k) for k in range(4)]) * 0.7
    return Structure(frequencies, np.array(damping), {f"P{n + 1}:+Z": shapes[:, n] for n in range(n_places)})


def at_resonances(structure: Structure, frequencies: np.ndarray) -> np.ndarray:
    """Lines within half a half-power bandwidth of a natural frequency."""
    half = structure.damping * structure.frequencies
    near = np.abs(frequencies[:, None] - structure.frequencies) < half / 2
    nearest = np.zeros_like(near)
    nearest[np.abs(frequencies[:, None] - structure.frequencies).argmin(axis=0), np.arange(near.shape[1])] = True
    return np.asarray((near | nearest).any(axis=1))


def test_of(path: Path) -> TapTest:
    """All channels of a recording."""
    with Recording(path) as recording:
        return TapTest(path, *choose_channels(recording.stream()))


test_of.__test__ = False  # type: ignore[attr-defined]


def frf_of(
    paths: Sequence[Path], *, exponential: float | None = None, subtract_hum: bool = False, **how: float
) -> tuple[MergedTaps, list[FoundTaps], TapSettings]:
    """As the command does it, where ``subtract_hum``; ``exponential`` 0: none, None: chosen."""
    judged = [found_taps(test_of(path)) for path in paths]
    if subtract_hum:
        judged = [without_hum(each) for each in judged]
    settings = choose_segments(judged, **how)  # type: ignore[arg-type]
    judged = [screened(each, settings) for each in judged]
    chosen = window_for(response_decay(judged, settings).left, settings) if exponential is None else exponential or None
    settings = replace(settings, time_constant=chosen)
    places = {each.test.excitations[tap.tap.channel].degree_of_freedom for each in judged for tap in each.used}
    return merge_taps([tap_sums(each, settings, None, places) for each in judged], chosen), judged, settings


def error_at_resonances(structure: Structure, merged: MergedTaps) -> float:
    """Largest error over all entries on lines at resonances, over the largest entry of the same line's column."""
    frf = merged.frf
    order = next(ORDER[name] for name, quantity in QUANTITY.items() if quantity == frf.quantity)
    lines = at_resonances(structure, frf.frequencies)
    worst = 0.0
    for q, excitation in enumerate(frf.excitations):
        truth = np.column_stack([structure.frf(frf.laplace, p, excitation, order) for p in frf.responses])[lines]
        error = np.abs(frf.values[lines, :, q] - truth)
        worst = max(worst, float((error / np.abs(truth).max(axis=1, keepdims=True)).max()))
    return worst
