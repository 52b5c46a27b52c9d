"""A small simulated robot cell for the benchmark of laboratory mistakes; it shares no code with `replay_data`.

Rigid teeth cut porous material: the force does not depend on the motion, and ``X = H F`` holds exactly. Records begin
at rest, and leave the simulation through an ideal low-pass.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, RecordingWriter, StreamDescription

Real = NDArray[np.float64]

FINE = 8  # steps of the simulation per sample
AXES = ("X", "Y", "Z")


@dataclass(frozen=True)
class Structure:
    """Real modes, scaled to unit modal mass."""

    natural: Real  # (n,), Hz
    damping: Real  # (n,), ratios
    tip: Real  # (n, 3)
    sensor: Real  # (n, 3)

    def receptance(self, frequencies: Real, responses: str) -> NDArray[np.complex128]:
        """FRF (n_lines, 3, 3), m/N, from the tip's forces to motions at ``tip`` or ``sensor``."""
        w, w0 = 2 * np.pi * frequencies[:, None], 2 * np.pi * self.natural
        gain = 1 / (w0**2 - w**2 + 2j * self.damping * w0 * w)
        return np.asarray(np.einsum("kr,rp,rq->kpq", gain, getattr(self, responses), self.tip))


def draw_structure(rng: np.random.Generator) -> Structure:
    """Two modes in the band of the sweeps and two above it; the stiffness of each is about 1 N/um."""
    natural = np.array([rng.uniform(15, 17), rng.uniform(19, 22), rng.uniform(32, 40), rng.uniform(60, 90)])
    damping = rng.uniform(0.025, 0.05, 4)
    shapes = rng.standard_normal((4, 3))
    shapes[1] -= 0.8 * (shapes[1] @ shapes[0]) / (shapes[0] @ shapes[0]) * shapes[0]
    stiffness = 1e6 * np.array([1.0, 1.3, 4.0, 12.0]) * rng.uniform(0.8, 1.25, 4)
    tip = shapes / np.linalg.norm(shapes, axis=1)[:, None] * (2 * np.pi * natural / np.sqrt(stiffness))[:, None]
    sensor = 0.6 * tip + 0.1 * np.linalg.norm(tip, axis=1)[:, None] * rng.standard_normal((4, 3))
    return Structure(natural, damping, tip, sensor)


@dataclass(frozen=True)
class Cut:
    """Cutter and cut of a sweep."""

    start: float  # rad
    leave: float
    teeth: int = 2
    ktc: float = 119e6  # Pa
    krc: float = 0.17
    kac: float = 0.33
    feed: float = 0.15e-3  # m per tooth
    depth: float = 2e-3  # m
    first_rpm: float = 450.0
    last_rpm: float = 690.0

    def setup(self, seconds: float) -> str:
        """What the recording states of itself."""
        return (
            f'[test]\nkind = "milling"\nduration_s = {seconds}\n[cut]\ndepth_m = {self.depth}\n'
            f"first_spindle_speed_rpm = {self.first_rpm}\nlast_spindle_speed_rpm = {self.last_rpm}\n"
            f"[cutting]\nteeth = {self.teeth}\ndiameter_m = 0.0127\nedge_angle_deg = 90.0\nktc_pa = {self.ktc}\n"
            f"krc = {self.krc}\nkac = {self.kac}\nstart_angle_deg = {np.degrees(self.start)}\n"
            f"exit_angle_deg = {np.degrees(self.leave)}\nfeed_per_tooth_m = {self.feed}\n"
        )


def milling_force(cut: Cut, seconds: float, rate: float, rng: np.random.Generator) -> Real:
    """Force on the tool (n, 3), N: teeth in a material whose strength varies from place to place."""
    t = np.arange(round(seconds * rate)) / rate
    speed0, speed1 = (2 * np.pi * rpm / 60 for rpm in (cut.first_rpm, cut.last_rpm))
    angle = speed0 * t + (speed1 - speed0) * t**2 / (2 * seconds)
    places = rng.uniform(0.3, 1.7, int(angle[-1] / 0.05) + 2)  # a pore every 0.05 rad of the spindle
    strength = np.interp(angle, 0.05 * np.arange(len(places)), places)
    force = np.zeros((len(t), 3))
    for tooth in range(cut.teeth):
        phi = np.mod(angle + 2 * np.pi * tooth / cut.teeth, 2 * np.pi)
        chip = np.where((phi >= cut.start) & (phi < cut.leave), np.maximum(cut.feed * np.sin(phi) + 5e-6 * tooth, 0), 0)
        tangential = cut.ktc * cut.depth * strength * chip
        force[:, 0] += tangential * (-np.cos(phi) - cut.krc * np.sin(phi))
        force[:, 1] += tangential * (np.sin(phi) - cut.krc * np.cos(phi))
        force[:, 2] -= tangential * cut.kac
    return force


def tap_force(axis: int, seconds: float, rate: float, rng: np.random.Generator, taps: int = 3) -> Real:
    """Half sines of 4 ms and about 200 N at the tip along one axis, (n, 3)."""
    t, force = np.arange(round(seconds * rate)) / rate, np.zeros((round(seconds * rate), 3))
    for number in range(taps):
        since = t - (0.2 + number * seconds / taps + rng.uniform(0, 1 / rate))
        force[:, axis] += np.where(
            (since > 0) & (since < 4e-3), rng.uniform(160, 240) * np.sin(np.pi * since / 4e-3), 0
        )
    return force


def motions(structure: Structure, force: Real, rate: float, responses: str) -> Real:
    """Accelerations (n, 3) of a structure that begins at rest; zeros after the record let it come to rest again."""
    length = 2 ** int(np.ceil(np.log2(len(force) + 8 * rate)))
    frequencies = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
    spectrum = np.fft.rfft(force, length, axis=0)
    frf = -((2 * np.pi * frequencies) ** 2)[:, None, None] * structure.receptance(frequencies, responses)
    return np.asarray(np.fft.irfft(np.einsum("kpq,kq->kp", frf, spectrum), length, axis=0)[: len(force)])


def sampled(signals: Real) -> Real:
    """Every eighth sample behind a low-pass that is flat up to 0.35 of the new rate."""
    spectrum = np.fft.rfft(signals, axis=0)
    share = np.arange(len(spectrum)) / len(spectrum) * FINE  # of the new Nyquist frequency
    spectrum *= np.clip((0.95 - share) / 0.25, 0, 1)[:, None]
    return np.asarray(np.fft.irfft(spectrum, len(signals), axis=0)[::FINE])


@dataclass
class Record:
    """Samples with their channels, as they are written; a mistake changes them."""

    samples: Real
    names: list[str]
    places: list[str]
    rate: float
    setup: str
    units: dict[str, tuple[str, str]] = field(default_factory=dict)  # quantity and unit of channels that state others

    def write(self, path: Path) -> Path:
        """Write the recording; forces are in N and accelerations in m/s^2 where ``units`` states no others."""
        channels = []
        for name, place in zip(self.names, self.places, strict=True):
            usual = ("force", "N") if name[0] == "f" else ("acceleration", "m/s^2")
            quantity, unit = self.units.get(name, usual)
            node, _, direction = place.partition(":")
            channels.append(Channel(name, quantity, unit, node, direction))
        stream = StreamDescription("daq", self.rate, 0.0, tuple(channels))
        with RecordingWriter(path, (stream,), setup=self.setup) as writer:
            writer.append("daq", self.samples)
        return path


def record(
    structure: Structure, force: Real, rate: float, rng: np.random.Generator, setup: str, tip: bool = False
) -> Record:
    """Record forces and motions with 1 % of noise each; ``force`` comes at eight times the rate."""
    parts = [force, motions(structure, force, FINE * rate, "sensor")]
    names, places = ["fx", "fy", "fz", "ax", "ay", "az"], [f"{node}:+{a}" for node in ("TCP", "HOUSING") for a in AXES]
    if tip:
        parts.append(motions(structure, force, FINE * rate, "tip"))
        names, places = [*names, "atx", "aty", "atz"], [*places, *(f"TCP:+{a}" for a in AXES)]
    clean = sampled(np.hstack(parts))
    size = np.concatenate([np.full(3, clean[:, :3].std()), np.full(clean.shape[1] - 3, clean[:, 3:].std())])
    return Record(clean + 0.01 * size * rng.standard_normal(clean.shape), names, places, rate, setup)


IMMERSIONS = {"central": (0.38, 0.61), "down": (0.77, 1.0), "up": (0.0, 0.23)}  # start and exit angle over pi


def sweeps(
    structure: Structure, rng: np.random.Generator, seconds: float = 20.0, rate: float = 512.0
) -> dict[str, Record]:
    """Record one sweep of each immersion."""
    cuts = {name: Cut(start * np.pi, leave * np.pi) for name, (start, leave) in IMMERSIONS.items()}
    return {
        name: record(structure, milling_force(cut, seconds, FINE * rate, rng), rate, rng, cut.setup(seconds))
        for name, cut in cuts.items()
    }


def shifted(samples: Real, seconds: float, rate: float) -> Real:
    """Return columns later by any time; zeros follow the record, so that nothing comes round."""
    n = len(samples)
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(2 * n, 1 / rate) * seconds)[:, None]
    return np.asarray(np.fft.irfft(np.fft.rfft(samples, 2 * n, axis=0) * turn, 2 * n, axis=0)[:n])
