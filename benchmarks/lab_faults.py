"""What a laboratory measures in a simulated cell, and changes of it: units, axes, clocks, filters, poses."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy

from estimation import Frf

from .lab_cell import FINE, Record, Structure, record, shifted, sweeps, tap_force

RATE, TAP_RATE, BAND = 512.0, 1024.0, (13.0, 25.0)
CUTTING = """[cutting]
teeth = 2
diameter_m = 0.0127
edge_angle_deg = 90.0
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.15e-3
"""
ONE, G, KILO = "down", 1 / 9.80665, 1e-3  # the file with the mistake; units
SPEEDS = (500.0, 1100.0, 13)
FORCES, MOTIONS, FX, FY, FZ, AX, AY, AZ = slice(0, 3), slice(3, 6), *(slice(k, k + 1) for k in range(6))


@dataclass
class Laboratory:
    """Good inputs of the chain, which a mistake changes."""

    structure: Structure
    seed: int
    cuts: dict[str, Record] = field(init=False)
    taps: dict[str, Record] = field(init=False)
    cutting: str = CUTTING  # text of the cutting file
    frfs: list[Callable[[dict[str, Frf]], dict[str, Frf]]] = field(default_factory=list)  # what happens to FRF files

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        self.cuts, self.taps = sweeps(self.structure, rng, rate=RATE), taps_of(self.structure, rng)


def taps_of(structure: Structure, rng: np.random.Generator) -> dict[str, Record]:
    """Three taps along each axis, with accelerations at housing and tip."""
    made = {}
    for axis, name in enumerate("xyz"):
        single = record(structure, tap_force(axis, 12.0, FINE * TAP_RATE, rng), TAP_RATE, rng, "", tip=True)
        kept = [axis, *range(3, 9)]
        single.samples, single.names = single.samples[:, kept], [single.names[k] for k in kept]
        single.places = [single.places[k] for k in kept]
        made[name] = single
    return made


Spoil = Callable[[Laboratory], None]


@dataclass(frozen=True)
class Mistake:
    """A mistake; ``needs_hammer`` where only hammer and cut together can show it, ``hidden`` where nothing can."""

    name: str
    spoil: Spoil
    needs_hammer: bool = False
    hidden: bool = False  # no second measurement of the same thing exists


def samples_of(change: Callable[[np.ndarray], object], *files: str) -> Spoil:
    """A change of the samples of some sweeps, or of all."""

    def spoil(lab: Laboratory) -> None:
        for name in files or tuple(lab.cuts):
            changed = change(lab.cuts[name].samples)
            if changed is not None:
                lab.cuts[name].samples = np.asarray(changed)

    return spoil


def scaled(columns: slice, factor: float) -> Callable[[np.ndarray], object]:
    return lambda x: x.__setitem__((slice(None), columns), factor * x[:, columns])


def late(columns: slice, seconds: float) -> Callable[[np.ndarray], object]:
    return lambda x: x.__setitem__((slice(None), columns), shifted(x[:, columns], seconds, RATE))


def exchanged(a: int, b: int) -> Callable[[np.ndarray], object]:
    return lambda x: x.__setitem__((slice(None), [a, b]), x[:, [b, a]])


def clocked(columns: slice, factor: float) -> Callable[[np.ndarray], object]:
    """Columns that another clock sampled, ``factor`` times faster."""

    def change(x: np.ndarray) -> None:
        at = np.arange(len(x))
        spline = scipy.interpolate.CubicSpline(at, x[:, columns])
        x[:, columns] = spline(np.minimum(at * factor, at[-1]))

    return change


def filtered(columns: slice, order: int, corner: float, kind: str) -> Callable[[np.ndarray], object]:
    """Columns behind a Butterworth filter that nobody stated."""
    sections = scipy.signal.butter(order, corner, kind, fs=RATE, output="sos")
    return lambda x: x.__setitem__((slice(None), columns), scipy.signal.sosfilt(sections, x[:, columns], axis=0))


def rounded(columns: slice, share: float) -> Callable[[np.ndarray], object]:
    """Columns in steps of a share of their standard deviation."""

    def change(x: np.ndarray) -> None:
        step = share * x[:, columns].std(axis=0)
        x[:, columns] = step * np.rint(x[:, columns] / step)

    return change


def turned(columns: slice, degrees: float) -> Callable[[np.ndarray], object]:
    """Three columns of a sensor that stands turned about Z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    rotation = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return lambda x: x.__setitem__((slice(None), columns), x[:, columns] @ rotation.T)


def humming(columns: slice, share: float, mains: float) -> Callable[[np.ndarray], object]:
    def change(x: np.ndarray) -> None:
        wave = np.sin(2 * np.pi * mains * np.arange(len(x)) / RATE)[:, None]
        x[:, columns] += share * x[:, columns].std(axis=0) * wave

    return change


def idle(x: np.ndarray) -> None:
    """Noise alone, as of an air cut."""
    noise = np.random.default_rng(1).standard_normal(x.shape)
    x[:] = 0.01 * x.std(axis=0) * noise


def integrated(x: np.ndarray) -> None:
    """Velocities where accelerations are stated."""
    sections = scipy.signal.butter(1, 1.0, "high", fs=RATE, output="sos")
    x[:, MOTIONS] = scipy.signal.sosfilt(sections, np.cumsum(x[:, MOTIONS], axis=0) / RATE, axis=0)


def other_structure(lab: Laboratory, frequency: float = 1.0, tip: float = 0.0) -> Structure:
    """The structure in another pose (frequencies), or with another tool (shapes at the tip)."""
    rng, old = np.random.default_rng(7), lab.structure
    size = np.linalg.norm(old.tip, axis=1)[:, None]
    return Structure(
        frequency * old.natural,
        old.damping,
        old.tip + tip * size * rng.standard_normal((4, 3)) / np.sqrt(3),
        old.sensor,
    )


def other_cuts(names: tuple[str, ...], frequency: float = 1.0, tip: float = 0.0) -> Spoil:
    def spoil(lab: Laboratory) -> None:
        others = sweeps(other_structure(lab, frequency, tip), np.random.default_rng(lab.seed + 1), rate=RATE)
        lab.cuts |= {name: others[name] for name in names}

    return spoil


def other_taps(frequency: float = 1.0, tip: float = 0.0) -> Spoil:
    def spoil(lab: Laboratory) -> None:
        lab.taps = taps_of(other_structure(lab, frequency, tip), np.random.default_rng(lab.seed + 1))

    return spoil


def channels_of_another(columns: slice) -> Spoil:
    """Channels of the first sweep come from the second."""

    def spoil(lab: Laboratory) -> None:
        lab.cuts["central"].samples[:, columns] = lab.cuts["down"].samples[:, columns]
        lab.cuts["central"].samples += 1e-9 * np.random.default_rng(0).standard_normal(
            lab.cuts["central"].samples.shape
        )

    return spoil


def rated(factor: float, *files: str) -> Spoil:
    """Files that state another rate than the samples have, all channels alike."""
    return samples_of(clocked(slice(0, 6), factor), *files)


def tap_samples(change: Callable[[np.ndarray], object], *files: str) -> Spoil:
    def spoil(lab: Laboratory) -> None:
        for name in files or tuple(lab.taps):
            change(lab.taps[name].samples)

    return spoil


def rolled(columns: slice, samples: int) -> Callable[[np.ndarray], object]:
    return lambda x: x.__setitem__((slice(None), columns), np.roll(x[:, columns], samples, axis=0))


def relabelled(lab: Laboratory) -> None:
    """Taps along X and Y with each other's label."""
    for name, place in (("x", "TCP:+Y"), ("y", "TCP:+X")):
        lab.taps[name].places[0] = place
