"""Mistakes of a laboratory in the chain from recordings to depth limits: which ones change a limit in silence?

``python -m benchmarks.lab_mistakes [--right N] [--only TEXT] [--further]``. Each mistake is made in good recordings,
taps or files of a simulated cell (:mod:`benchmarks.lab_cell`), and the chain fit, tap, calibrate, lobes is run. A
mistake is noticed if a step refuses its inputs, or fit, tap or calibrate, or lobes about the cutting file, warns of
what the right inputs do not give. It is uncertain if only the statuses of the limits contradict it, and silent if a
limit called verified changes by more than 5 %. Right inputs of other seeds count false alarms.
"""

import argparse
import re
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from estimation import Frf
from millfrf.core import MillfrfError
from millfrf.steps.calibrate import calibrate
from millfrf.steps.fit import fit
from millfrf.steps.lobes import lobes
from millfrf.steps.tap import tap

from .further_mistakes import further
from .lab_cell import Record, draw_structure
from .lab_faults import (
    AX,
    AY,
    AZ,
    BAND,
    FORCES,
    FX,
    FY,
    FZ,
    KILO,
    MOTIONS,
    ONE,
    RATE,
    SPEEDS,
    G,
    Laboratory,
    Mistake,
    channels_of_another,
    clocked,
    exchanged,
    filtered,
    humming,
    idle,
    integrated,
    late,
    other_cuts,
    other_taps,
    rated,
    relabelled,
    rolled,
    rounded,
    samples_of,
    scaled,
    tap_samples,
    turned,
)

CHANGED = 0.05  # relative change of a limit that a mistake must not make in silence
WITNESSES = ("recordings, taps or files can show", "only hammer and cut together can show", "nothing measured can show")


def mistakes() -> Iterator[Mistake]:
    """Yield the mistakes."""
    yield from _channels_and_chains()
    yield from _other_recordings()
    yield from _taps()


def _channels_and_chains() -> Iterator[Mistake]:
    first, two = ONE, (ONE, "up")
    g, kilo = G, KILO
    for name, columns, factor in (
        ("ax in g", AX, g), ("forces in kN", FORCES, kilo), ("fy in kN", FY, kilo), ("forces reversed", FORCES, -1),
        ("fx reversed", FX, -1), ("fz reversed", FZ, -1), ("ay reversed", AY, -1), ("az reversed", AZ, -1),
        ("accelerations in g", MOTIONS, g), ("ay 25 % too large", AY, 1.25), ("fy 25 % too large", FY, 1.25),
        ("fx 30 % too small", FX, 0.7),
    ):  # fmt: skip
        yield Mistake(f"{name} in one file", samples_of(scaled(columns, factor), first))
        yield Mistake(f"{name} in all files", samples_of(scaled(columns, factor)), needs_hammer=True)
    for names, a, b in (("fx and fy", 0, 1), ("fy and fz", 1, 2), ("ax and ay", 3, 4), ("ax and az", 3, 5)):
        yield Mistake(f"{names} exchanged in one file", samples_of(exchanged(a, b), first))
        yield Mistake(f"{names} exchanged in all files", samples_of(exchanged(a, b)), needs_hammer=True)
    for name, files in (("one file", (first,)), ("two files", two), ("all files", ())):
        yield Mistake(f"motions 8 samples late in {name}", samples_of(late(MOTIONS, 8 / RATE), *files))
        yield Mistake(f"motions on a clock 1 % fast in {name}", samples_of(clocked(MOTIONS, 1.01), *files))
        yield Mistake(f"forces AC-coupled at 5 Hz in {name}", samples_of(filtered(FORCES, 1, 5.0, "high"), *files))
        yield Mistake(
            f"motions behind a low-pass of 40 Hz in {name}", samples_of(filtered(MOTIONS, 4, 40, "low"), *files)
        )
        yield Mistake(f"dynamometer turned by 30 degrees in {name}", samples_of(turned(FORCES, 30), *files), not files)


def _other_recordings() -> Iterator[Mistake]:
    single = ONE
    yield Mistake("motions .5 s late in all files", samples_of(late(MOTIONS, 0.5)))
    yield Mistake("motions 10 ms early in all files", samples_of(late(MOTIONS, -0.01)))
    yield Mistake("fx 10 ms late in all files", samples_of(late(FX, 0.01)))
    yield Mistake("ay 8 ms late in all files", samples_of(late(AY, 0.008)))
    yield Mistake("motions on a clock .2 % slow in all files", samples_of(clocked(MOTIONS, 0.998)))
    yield Mistake("rate 2 % wrong in one file", rated(1.02, single))
    yield Mistake("rate 5 % wrong in one file", rated(0.95, single))
    yield Mistake("rate 5 % wrong in all files", rated(0.95), needs_hammer=True)
    yield Mistake("forces of another test", channels_of_another(FORCES))
    yield Mistake("motions of another test", channels_of_another(MOTIONS))
    yield Mistake("another pose in one file", other_cuts((single,), frequency=0.92))
    yield Mistake("another tool in one file", other_cuts((single,), tip=0.3))
    yield Mistake("another tool in all cuts", other_cuts(("central", "down", "up"), tip=0.3), needs_hammer=True)
    yield Mistake("motions behind a high-pass of 5 Hz", samples_of(filtered(MOTIONS, 1, 5.0, "high")))
    yield Mistake("forces behind a low-pass of 30 Hz in one file", samples_of(filtered(FORCES, 2, 30.0, "low"), single))
    yield Mistake("fx in steps of half its deviation", samples_of(rounded(FX, 0.5)))
    yield Mistake("motions in steps of their deviation in one file", samples_of(rounded(MOTIONS, 1.0), single))
    yield Mistake("hum of 50 Hz in the motions", samples_of(humming(MOTIONS, 1.0, 50.02)))
    yield Mistake("three air cuts", samples_of(idle))
    yield Mistake("one air cut", samples_of(idle, single))
    yield Mistake("accelerometers turned by 90 degrees in one file", samples_of(turned(MOTIONS, 90), single))
    yield Mistake("velocities called accelerations in one file", samples_of(integrated, single))
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
    """Depth limits (m) of a chain with their statuses, the warnings of its inputs, and the refusal."""

    limits: np.ndarray | None
    status: tuple[str, ...]
    said: tuple[str, ...]
    refused: str = ""


def run(lab: Laboratory, tapped: dict[str, Frf] | None = None) -> Outcome:
    """Run the chain on the inputs of a laboratory; ``tapped`` are the FRFs of its taps where they are known."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        here = Path(folder)
        limits, refused = None, ""
        status: tuple[str, ...] = ()
        try:
            frfs = tapped or tapped_frfs(lab, here)
            for change in lab.frfs:
                frfs = change(frfs)
            (here / "cut.toml").write_text(lab.cutting)
            cuts = (cut.write(here / f"{name}.h5") for name, cut in lab.cuts.items())
            fit(*cuts, band=BAND, out=here / "fit.json")
            calibrate(here / "fit.json", tip=frfs["tip"], sensor=frfs["sensor"], out=here / "tip.json")
            before_lobes = len(caught)
            result = lobes(here / "tip.json", here / "cut.toml", speeds=SPEEDS, max_depth=0.1)
            limits, status = result.depth_limits, result.status
            of_cut = [warning for warning in caught[before_lobes:] if "cut.toml" in str(warning.message)]
            caught[before_lobes:] = of_cut
        except MillfrfError as error:
            refused = str(error)
        except Exception as error:  # a mistake that no step expects is the worst outcome but a silent one
            refused = f"CRASH {type(error).__name__}: {error}"
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
    parser.add_argument("--from", dest="first", type=int, default=0, help="number of mistakes to leave out first")
    parser.add_argument("--further", action="store_true", help="the second list of mistakes")
    options = parser.parse_args()
    good = Laboratory(draw_structure(np.random.default_rng(11)), 11)
    right = run(deepcopy(good))
    with tempfile.TemporaryDirectory() as folder:
        tapped = tapped_frfs(good, Path(folder))
    print(f"right inputs, {right.status.count('verified')} of {len(right.status)} limits verified:")
    print(right.refused or np.round(1e3 * np.asarray(right.limits), 2), *right.said, sep="\n  ")
    usual, counts = {kind(text) for text in right.said}, {which: Counter[str]() for which in WITNESSES}
    for mistake in islice(further() if options.further else mistakes(), options.first, None):
        if options.only not in mistake.name:
            continue
        lab = deepcopy(good)
        mistake.spoil(lab)
        outcome = run(lab, tapped if all(same(lab.taps[n], record) for n, record in good.taps.items()) else None)
        new = [text for text in outcome.said if kind(text) not in usual]
        change, verified = changed(outcome, right)
        which = WITNESSES[2 if mistake.hidden else 1 if mistake.needs_hammer else 0]
        counts[which][verdict := verdict_of(outcome, new, change, verified)] += change > CHANGED
        mark = " (hidden)" if mistake.hidden else " (hammer)" if mistake.needs_hammer else ""
        said = (outcome.refused or (new[0] if new else ""))[:90]
        print(f"{mistake.name + mark:66s} {100 * change:8.1f} %  {verdict:9s} {said}", flush=True)
    for which, count in counts.items():
        listed = ", ".join(f"{count[word]} {word}" for word in ("refused", "warned", "uncertain", "SILENT", "CRASH"))
        print(f"of {count.total()} that change a limit and that {which}: {listed}")
    alarms = 0
    for seed in range(options.right):
        outcome = run(Laboratory(draw_structure(np.random.default_rng(100 + seed)), 100 + seed))
        texts = [text for text in (*outcome.said, outcome.refused) if text]
        alarms += bool(texts)
        print(f"right inputs {seed}", *(text[:160] for text in texts), sep="\n  ", flush=True)
    print(f"right inputs with a warning or refusal: {alarms} of {options.right}")


def same(record: Record, other: Record) -> bool:
    """Whether two recordings are equal."""
    stated = ((each.rate, each.places, each.setup, each.units) for each in (record, other))
    return next(stated) == next(stated) and np.array_equal(record.samples, other.samples)


def verdict_of(outcome: Outcome, new: Sequence[str], change: float, verified: float) -> str:
    """Whether a mistake is noticed, or how its limits are called."""
    if outcome.refused:
        return "CRASH" if outcome.refused.startswith("CRASH") else "refused"
    if new:
        return "warned"
    return "SILENT" if verified > CHANGED else "uncertain" if change > CHANGED else "harmless"


if __name__ == "__main__":
    main()
