"""Mistakes of a laboratory in the chain from recordings to depth limits: which ones change a limit in silence?

``python -m benchmarks.lab_mistakes [--right N] [--only TEXT]``. Each mistake is made in good recordings or taps of a
simulated cell (:mod:`benchmarks.lab_cell`), and the chain fit, tap, calibrate, lobes is run. A mistake is noticed
if a step refuses its inputs, or fit, tap or calibrate warns of what the right inputs do not give. It is uncertain if
only the statuses of the limits contradict it, and silent if a limit called verified changes by more than 5 %. Right
inputs of other seeds count false alarms.
"""

import argparse
import re
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import MillfrfError
from millfrf.cutting import MillingProcess
from millfrf.steps.calibrate import calibrate
from millfrf.steps.fit import fit
from millfrf.steps.lobes import lobes
from millfrf.steps.tap import tap

from .lab_cell import FINE, Record, Structure, draw_structure, record, shifted, sweeps, tap_force

RATE, TAP_RATE, BAND = 512.0, 1024.0, (13.0, 25.0)
PROCESS = MillingProcess(2, 12.7e-3, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
ONE, G, KILO = "down", 1 / 9.80665, 1e-3  # the file with the mistake; units
SPEEDS, CHANGED = (500.0, 1100.0, 13), 0.05
FORCES, MOTIONS, FX, FY, FZ, AX, AY, AZ = slice(0, 3), slice(3, 6), *(slice(k, k + 1) for k in range(6))


@dataclass
class Laboratory:
    """Good inputs of the chain, which a mistake changes."""

    structure: Structure
    seed: int
    cuts: dict[str, Record] = field(init=False)
    taps: dict[str, Record] = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        self.cuts, self.taps = sweeps(self.structure, rng, rate=RATE), taps_of(self.structure, rng)


def taps_of(structure: Structure, rng: np.random.Generator) -> dict[str, Record]:
    """Three taps along each axis, with accelerations at housing and tip."""
    made = {}
    for axis, name in enumerate("xyz"):
        one = record(structure, tap_force(axis, 12.0, FINE * TAP_RATE, rng), TAP_RATE, rng, "", tip=True)
        kept = [axis, *range(3, 9)]
        one.samples, one.names = one.samples[:, kept], [one.names[k] for k in kept]
        one.places = [one.places[k] for k in kept]
        made[name] = one
    return made


Spoil = Callable[[Laboratory], None]


@dataclass(frozen=True)
class Mistake:
    """A mistake; ``needs_hammer`` where only the comparison of hammer and cut can show it."""

    name: str
    spoil: Spoil
    needs_hammer: bool = False


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


def mistakes() -> Iterator[Mistake]:
    """Yield the mistakes."""
    yield from _channels_and_chains()
    yield from _other_recordings()
    yield from _taps()


def _channels_and_chains() -> Iterator[Mistake]:
    one, two = ONE, (ONE, "up")
    g, kilo = G, KILO
    for name, columns, factor in (
        ("ax in g", AX, g), ("forces in kN", FORCES, kilo), ("fy in kN", FY, kilo), ("forces reversed", FORCES, -1),
        ("fx reversed", FX, -1), ("fz reversed", FZ, -1), ("ay reversed", AY, -1), ("az reversed", AZ, -1),
        ("accelerations in g", MOTIONS, g), ("ay 25 % too large", AY, 1.25), ("fy 25 % too large", FY, 1.25),
        ("fx 30 % too small", FX, 0.7),
    ):  # fmt: skip
        yield Mistake(f"{name} in one file", samples_of(scaled(columns, factor), one))
        yield Mistake(f"{name} in all files", samples_of(scaled(columns, factor)), needs_hammer=True)
    for names, a, b in (("fx and fy", 0, 1), ("fy and fz", 1, 2), ("ax and ay", 3, 4), ("ax and az", 3, 5)):
        yield Mistake(f"{names} exchanged in one file", samples_of(exchanged(a, b), one))
        yield Mistake(f"{names} exchanged in all files", samples_of(exchanged(a, b)), needs_hammer=True)
    for name, files in (("one file", (one,)), ("two files", two), ("all files", ())):
        yield Mistake(f"motions 8 samples late in {name}", samples_of(late(MOTIONS, 8 / RATE), *files))
        yield Mistake(f"motions on a clock 1 % fast in {name}", samples_of(clocked(MOTIONS, 1.01), *files))
        yield Mistake(f"forces AC-coupled at 5 Hz in {name}", samples_of(filtered(FORCES, 1, 5.0, "high"), *files))
        yield Mistake(
            f"motions behind a low-pass of 40 Hz in {name}", samples_of(filtered(MOTIONS, 4, 40, "low"), *files)
        )
        yield Mistake(f"dynamometer turned by 30 degrees in {name}", samples_of(turned(FORCES, 30), *files), not files)


def _other_recordings() -> Iterator[Mistake]:
    one = ONE
    yield Mistake("motions .5 s late in all files", samples_of(late(MOTIONS, 0.5)))
    yield Mistake("motions 10 ms early in all files", samples_of(late(MOTIONS, -0.01)))
    yield Mistake("fx 10 ms late in all files", samples_of(late(FX, 0.01)))
    yield Mistake("ay 8 ms late in all files", samples_of(late(AY, 0.008)))
    yield Mistake("motions on a clock .2 % slow in all files", samples_of(clocked(MOTIONS, 0.998)))
    yield Mistake("rate 2 % wrong in one file", rated(1.02, one))
    yield Mistake("rate 5 % wrong in one file", rated(0.95, one))
    yield Mistake("rate 5 % wrong in all files", rated(0.95), needs_hammer=True)
    yield Mistake("forces of another test", channels_of_another(FORCES))
    yield Mistake("motions of another test", channels_of_another(MOTIONS))
    yield Mistake("another pose in one file", other_cuts((one,), frequency=0.92))
    yield Mistake("another tool in one file", other_cuts((one,), tip=0.3))
    yield Mistake("another tool in all cuts", other_cuts(("central", "down", "up"), tip=0.3), needs_hammer=True)
    yield Mistake("motions behind a high-pass of 5 Hz", samples_of(filtered(MOTIONS, 1, 5.0, "high")))
    yield Mistake("forces behind a low-pass of 30 Hz in one file", samples_of(filtered(FORCES, 2, 30.0, "low"), one))
    yield Mistake("fx in steps of half its deviation", samples_of(rounded(FX, 0.5)))
    yield Mistake("motions in steps of their deviation in one file", samples_of(rounded(MOTIONS, 1.0), one))
    yield Mistake("hum of 50 Hz in the motions", samples_of(humming(MOTIONS, 1.0, 50.02)))
    yield Mistake("three air cuts", samples_of(idle))
    yield Mistake("one air cut", samples_of(idle, one))
    yield Mistake("accelerometers turned by 90 degrees in one file", samples_of(turned(MOTIONS, 90), one))
    yield Mistake("velocities called accelerations in one file", samples_of(integrated, one))
    yield Mistake("velocities called accelerations in all files", samples_of(integrated), needs_hammer=True)


def _taps() -> Iterator[Mistake]:
    g, kilo = G, KILO
    yield Mistake("tip's response 2 samples late in the taps", tap_samples(rolled(slice(4, 7), 2)))
    yield Mistake("all responses 2 samples late in the taps", tap_samples(rolled(slice(1, 7), 2)))
    yield Mistake(
        "housing's response 3 samples late in the taps", tap_samples(rolled(slice(1, 4), 3)), needs_hammer=True
    )
    yield Mistake("hammer in kN", tap_samples(scaled(slice(0, 1), kilo)), needs_hammer=True)
    yield Mistake("hammer 20 % too small along x", tap_samples(scaled(slice(0, 1), 0.8), "x"), needs_hammer=True)
    yield Mistake("tip's accelerations in g", tap_samples(scaled(slice(4, 7), g)), needs_hammer=True)
    yield Mistake("one tip accelerometer in g", tap_samples(scaled(slice(5, 6), g)), needs_hammer=True)
    yield Mistake("taps along x and y with each other's label", relabelled)
    yield Mistake("another tool tapped", other_taps(tip=0.3), needs_hammer=True)
    yield Mistake("tapped in another pose", other_taps(frequency=0.9), needs_hammer=True)


@dataclass(frozen=True)
class Outcome:
    """Depth limits (m) of a chain with their statuses, the warnings before the lobes, and the refusal."""

    limits: np.ndarray | None
    status: tuple[str, ...]
    said: tuple[str, ...]
    refused: str = ""


def run(lab: Laboratory, tapped: dict[str, Frf] | None = None) -> Outcome:
    """Run the chain on the inputs of a laboratory; ``tapped`` are the FRFs of its taps where they are known."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        limits, refused = None, ""
        status: tuple[str, ...] = ()
        try:
            frfs = tapped or tapped_frfs(lab, Path(folder))
            fitted = fit(*(cut.write(Path(folder) / f"{name}.h5") for name, cut in lab.cuts.items()), band=BAND)
            at_tip = calibrate(fitted.model, tip=frfs["tip"], sensor=frfs["sensor"])
            before_lobes = len(caught)
            result = lobes(at_tip.model, PROCESS, speeds=SPEEDS, max_depth=0.1)
            limits, status = result.depth_limits, result.status
            del caught[before_lobes:]
        except MillfrfError as error:
            refused = str(error)
    return Outcome(limits, status, tuple(dict.fromkeys(str(warning.message) for warning in caught)), refused)


def tapped_frfs(lab: Laboratory, folder: Path) -> dict[str, Frf]:
    """FRFs of the taps at the tip and at the sensor."""
    hits = [record.write(folder / f"tap_{name}.h5") for name, record in lab.taps.items()]
    channels = {"tip": ["atx", "aty", "atz"], "sensor": ["ax", "ay", "az"]}
    return {side: tap(*hits, responses=names).frf for side, names in channels.items()}


def kind(text: str) -> str:
    """A warning without its numbers."""
    return re.sub(r"[-+]?\d[\d.e+-]*", "#", text)


def changed(outcome: Outcome, right: Outcome) -> tuple[float, float]:
    """Largest relative change of a limit, and of a limit called verified; infinite if there are no limits any more."""
    if outcome.limits is None or right.limits is None:
        return float("inf"), 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(np.log(outcome.limits / right.limits))
    ratio = np.where(outcome.limits == right.limits, 0.0, np.nan_to_num(ratio, nan=np.inf))
    verified = ratio[np.array(outcome.status) == "verified"]
    return float(np.expm1(ratio.max())), float(np.expm1(verified.max(initial=0.0)))


def main() -> None:
    """Print the outcome of each mistake, and the counts."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.lab_mistakes", description=__doc__.split("\n\n")[0])
    parser.add_argument("--right", type=int, default=20, help="number of right inputs")
    parser.add_argument("--only", default="", help="run mistakes whose names contain this text")
    options = parser.parse_args()
    good = Laboratory(draw_structure(np.random.default_rng(11)), 11)
    right = run(deepcopy(good))
    with tempfile.TemporaryDirectory() as folder:
        tapped = tapped_frfs(good, Path(folder))
    print(f"right inputs, {right.status.count('verified')} of {len(right.status)} limits verified:")
    print(right.refused or np.round(1e3 * np.asarray(right.limits), 2), *right.said, sep="\n  ")
    usual, counts = {kind(text) for text in right.said}, {False: Counter[str](), True: Counter[str]()}
    for mistake in mistakes():
        if options.only not in mistake.name:
            continue
        lab = deepcopy(good)
        mistake.spoil(lab)
        same_taps = all(
            lab.taps[n].places == one.places and (lab.taps[n].samples == one.samples).all()
            for n, one in good.taps.items()
        )
        outcome = run(lab, tapped if same_taps else None)
        new = [text for text in outcome.said if kind(text) not in usual]
        change, verified = changed(outcome, right)
        counts[mistake.needs_hammer][verdict := verdict_of(outcome, new, change, verified)] += change > CHANGED
        mark = " (hammer)" if mistake.needs_hammer else ""
        said = (outcome.refused or (new[0] if new else ""))[:90]
        print(f"{mistake.name + mark:66s} {100 * change:8.1f} %  {verdict:9s} {said}", flush=True)
    for needs_hammer, count in counts.items():
        which = "only hammer and cut together can show" if needs_hammer else "the recordings or taps can show"
        listed = ", ".join(f"{count[word]} {word}" for word in ("refused", "warned", "uncertain", "SILENT"))
        print(f"of {count.total()} that change a limit and {which}: {listed}")
    alarms = 0
    for seed in range(options.right):
        outcome = run(Laboratory(draw_structure(np.random.default_rng(100 + seed)), 100 + seed))
        texts = [text for text in (*outcome.said, outcome.refused) if text]
        alarms += bool(texts)
        print(f"right inputs {seed}", *(text[:160] for text in texts), sep="\n  ", flush=True)
    print(f"right inputs with a warning or refusal: {alarms} of {options.right}")


def verdict_of(outcome: Outcome, new: Sequence[str], change: float, verified: float) -> str:
    """Whether a mistake is noticed, or how its limits are called."""
    if outcome.refused:
        return "refused"
    if new:
        return "warned"
    return "SILENT" if verified > CHANGED else "uncertain" if change > CHANGED else "harmless"


if __name__ == "__main__":
    main()
