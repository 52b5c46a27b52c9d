"""Further mistakes of a laboratory, for :mod:`benchmarks.lab_mistakes`."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import scipy

from estimation import Frf

from .lab_cell import FINE, Structure, record, tap_force
from .lab_faults import (
    AX,
    AY,
    AZ,
    FORCES,
    FX,
    FY,
    FZ,
    MOTIONS,
    ONE,
    RATE,
    TAP_RATE,
    Laboratory,
    Mistake,
    Spoil,
    exchanged,
    filtered,
    other_structure,
    samples_of,
    scaled,
    tap_samples,
    taps_of,
    turned,
)

POUND = 1 / 4.4482216  # lbf for N
Change = Callable[[np.ndarray], object]


def both(*spoils: Spoil) -> Spoil:
    def spoil(lab: Laboratory) -> None:
        for each in spoils:
            each(lab)

    return spoil


def stated_rate(factor: float, side: str, *files: str) -> Spoil:
    """Recordings that state a wrong sample rate."""

    def spoil(lab: Laboratory) -> None:
        records = getattr(lab, side)
        for name in files or tuple(records):
            records[name].rate *= factor

    return spoil


def stated(pattern: str, text: str, *files: str) -> Spoil:
    """Set-ups of sweeps with another text."""

    def spoil(lab: Laboratory) -> None:
        for name in files or tuple(lab.cuts):
            lab.cuts[name].setup, count = re.subn(pattern, text, lab.cuts[name].setup)
            assert count

    return spoil


def exchanged_setups(lab: Laboratory) -> None:
    down, up = lab.cuts["down"], lab.cuts["up"]
    down.setup, up.setup = up.setup, down.setup


def cutting(pattern: str, text: str) -> Spoil:
    """Another text in the cutting file of the lobes."""

    def spoil(lab: Laboratory) -> None:
        lab.cutting, count = re.subn(pattern, text, lab.cutting)
        assert count

    return spoil


def stated_as(quantity: str, unit: str, side: str, *channels: str) -> Spoil:
    """Channels with another quantity and unit than they have."""

    def spoil(lab: Laboratory) -> None:
        for each in getattr(lab, side).values():
            each.units |= dict.fromkeys(channels, (quantity, unit))

    return spoil


def renamed(side: str, old: str, new: str) -> Spoil:
    """Channels at another place than they are."""

    def spoil(lab: Laboratory) -> None:
        for each in getattr(lab, side).values():
            each.places = [re.sub(old, new, place) for place in each.places]

    return spoil


def frf_files(change: Callable[[Frf], Frf], *sides: str) -> Spoil:
    """FRF files that are changed after the taps."""

    def spoil(lab: Laboratory) -> None:
        lab.frfs.append(lambda frfs: frfs | {side: change(frfs[side]) for side in sides})

    return spoil


def ordered(columns: list[int]) -> Change:
    return lambda x: x.__setitem__(slice(None), x[:, columns])


def leaked(source: int, target: int, share: float) -> Change:
    return lambda x: x.__setitem__((slice(None), target), x[:, target] + share * x[:, source])


def carried(mass: float) -> Change:
    """Forces of a dynamometer that carries a vibrating mass."""
    return lambda x: x.__setitem__((slice(None), FORCES), x[:, FORCES] + mass * x[:, MOTIONS])


def resonant(columns: slice, natural: float, damping: float, rate: float = RATE) -> Change:
    """Columns behind a resonance of their sensor."""

    def change(x: np.ndarray) -> None:
        n = len(x)
        f = np.fft.rfftfreq(2 * n, 1 / rate)[:, None] / natural
        spectrum = np.fft.rfft(x[:, columns], 2 * n, axis=0) / (1 - f**2 + 2j * damping * f)
        x[:, columns] = np.fft.irfft(spectrum, 2 * n, axis=0)[:n]

    return change


def aliased(columns: slice) -> Change:
    """Columns of which every second sample was kept without a filter, and interpolated again."""

    def change(x: np.ndarray) -> None:
        x[:, columns] = scipy.signal.resample_poly(x[::2, columns], 2, 1, axis=0)[: len(x)]

    return change


def lost(columns: slice, count: int) -> Change:
    """Samples that were lost in the middle; zeros fill the end."""

    def change(x: np.ndarray) -> None:
        at = len(x) // 2
        x[at:-count, columns] = x[at + count :, columns]
        x[-count:, columns] *= 0.001

    return change


def drifting(columns: slice, share: float) -> Change:
    """A charge amplifier that drifts through a share of the deviation each second."""

    def change(x: np.ndarray) -> None:
        x[:, columns] += share * x[:, columns].std(axis=0) * np.arange(len(x))[:, None] / RATE

    return change


def clipped(columns: slice, share: float) -> Change:
    def change(x: np.ndarray) -> None:
        most = share * np.abs(x[:, columns]).max(axis=0)
        x[:, columns] = np.clip(x[:, columns], -most, most)

    return change


def rectified(columns: slice, share: float) -> Change:
    """A loose sensor that rattles: half waves of one sign are smaller."""
    return lambda x: x.__setitem__((slice(None), columns), np.where(x[:, columns] > 0, 1, 1 - share) * x[:, columns])


def interrupted(columns: slice, share: float) -> Change:
    """A loose cable: noise alone during a share of the time."""

    def change(x: np.ndarray) -> None:
        n = round(share * len(x))
        noise = np.random.default_rng(2).standard_normal((n, x[:, columns].shape[1]))
        x[len(x) // 3 : len(x) // 3 + n, columns] = 0.01 * x[:, columns].std(axis=0) * noise

    return change


def summed(columns: slice) -> Change:
    """Velocities from accelerations, less their drift."""

    def change(x: np.ndarray) -> None:
        speed = np.cumsum(x[:, columns], axis=0) / RATE
        x[:, columns] = scipy.signal.sosfiltfilt(scipy.signal.butter(2, 1.0, "high", fs=RATE, output="sos"), speed, 0)

    return change


def rung(seconds: float) -> Change:
    """Responses that an analyser has multiplied by an exponential window at each tap, and did not say so."""

    def change(x: np.ndarray) -> None:
        taps, _ = scipy.signal.find_peaks(x[:, 0], height=0.5 * x[:, 0].max(), distance=TAP_RATE)
        since = np.arange(len(x)) - np.concatenate([[0], taps])[np.searchsorted(taps, np.arange(len(x)))]
        x[:, 1:] *= np.exp(-np.maximum(since, 0) / TAP_RATE / seconds)[:, None]

    return change


def taps_again(lab: Laboratory, names: str, forces: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> None:
    """Taps of other forces than the files state."""
    rng = np.random.default_rng(lab.seed + 2)
    for axis, name in enumerate("xyz"):
        if name not in names:
            continue
        force = tap_force(axis, 12.0, FINE * TAP_RATE, rng)
        new = record(lab.structure, forces(force, rng), TAP_RATE, rng, "", tip=True)
        lab.taps[name].samples[:, 1:] = new.samples[:, 3:]
        lab.taps[name].samples[:, 0] = np.linalg.norm(new.samples[:, :3], axis=1)


def oblique(degrees: float, names: str = "xyz") -> Spoil:
    """Hits that are oblique: the hammer measures along itself."""
    angle = np.radians(degrees)

    def turn(force: np.ndarray, _: np.random.Generator) -> np.ndarray:
        return np.asarray(np.cos(angle) * force + np.sin(angle) * np.roll(force, 1, axis=1))

    return lambda lab: taps_again(lab, names, turn)


def twice(force: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Double hits, 60 ms apart."""
    return np.asarray(force + 0.5 * np.roll(force, round(0.06 * FINE * TAP_RATE), axis=0))


def tapped_at_housing(lab: Laboratory) -> None:
    """Hits at the housing, stated as the tip."""
    old = lab.structure
    moved = Structure(old.natural, old.damping, old.sensor, old.tip)
    new = taps_of(moved, np.random.default_rng(lab.seed + 3))
    for name, each in new.items():  # the accelerometers stay where they were
        lab.taps[name].samples = each.samples[:, [0, 4, 5, 6, 1, 2, 3]]


def tapped_elsewhere(names: str, **other: float) -> Spoil:
    """Some directions tapped with another tool or in another pose."""

    def spoil(lab: Laboratory) -> None:
        new = taps_of(other_structure(lab, **other), np.random.default_rng(lab.seed + 1))
        lab.taps |= {name: new[name] for name in names}

    return spoil


def wrong_file(lab: Laboratory) -> None:
    """The file of the taps along X is given for those along Y."""
    rng = np.random.default_rng(4)
    lab.taps["y"].samples = lab.taps["x"].samples + 1e-9 * rng.standard_normal(lab.taps["x"].samples.shape)


def cuts_and_taps(factor: float, cuts: slice, taps: slice) -> Spoil:
    return both(samples_of(scaled(cuts, factor)), tap_samples(scaled(taps, factor)))


def further() -> Iterator[Mistake]:
    """Yield the further mistakes."""
    yield from _sensors()
    yield from _clocks_and_filters()
    yield from _set_ups()
    yield from _taps()
    yield from _frfs()
    yield from _cutting_data()


def _sensors() -> Iterator[Mistake]:
    single = ONE
    for where, files in (("one file", (single,)), ("all files", ())):
        all_files = not files
        for name, change in (
            ("forces in lbf", scaled(FORCES, POUND)),
            ("az of a sensor twice as sensitive", scaled(AZ, 2.0)),
            ("accelerations of a range of 5 V called 10 V", scaled(MOTIONS, 2.0)),
            ("fx 15 % too large", scaled(FX, 1.15)),
            ("dynamometer turned by 90 degrees", turned(FORCES, 90)),
            ("dynamometer turned by 180 degrees", turned(FORCES, 180)),
            ("accelerometers turned by 45 degrees", turned(MOTIONS, 45)),
            ("fx and fz exchanged", exchanged(0, 2)),
            ("ay and az exchanged", exchanged(4, 5)),
            ("crosstalk of 25 % from fx into fy", leaked(0, 1, 0.25)),
            ("transverse sensitivity of 20 % from ay into ax", leaked(4, 3, 0.2)),
        ):
            yield Mistake(f"{name} in {where}", samples_of(change, *files), all_files)
    yield Mistake("dynamometer that carries 5 kg in all files", samples_of(carried(5.0)), True)
    yield Mistake("fy clipped at 50 % in all files", samples_of(clipped(FY, 0.5)))
    yield Mistake("ax loose: half waves 40 % smaller", samples_of(rectified(AX, 0.4)), True)
    yield Mistake("cable of ay loose for a fifth of all files", samples_of(interrupted(AY, 0.2)))
    yield Mistake("cable of fx loose for a fifth of one file", samples_of(interrupted(FX, 0.2), single))
    yield Mistake("charge amplifier of fz drifts", samples_of(drifting(FZ, 0.3)))


def _clocks_and_filters() -> Iterator[Mistake]:
    single = ONE
    yield Mistake("fx behind a low-pass of 30 Hz in all files", samples_of(filtered(FX, 2, 30.0, "low")))
    yield Mistake("ay behind a low-pass of 30 Hz in all files", samples_of(filtered(AY, 2, 30.0, "low")))
    yield Mistake("az AC-coupled at 8 Hz in all files", samples_of(filtered(AZ, 1, 8.0, "high")), True)
    yield Mistake("resonance of the dynamometer at 60 Hz", samples_of(resonant(FORCES, 60, 0.02)), True)
    yield Mistake("every second motion kept without a filter", samples_of(aliased(MOTIONS)))
    yield Mistake("12 forces lost in the middle of one file", samples_of(lost(FORCES, 12), single))
    yield Mistake("12 motions lost in the middle of all files", samples_of(lost(MOTIONS, 12)))
    for factor, word in ((2.0, "twice"), (0.5, "half of"), (1000.0, "1000 times")):
        yield Mistake(f"one file states {word} its rate", stated_rate(factor, "cuts", single))
        yield Mistake(f"all cuts state {word} their rate", stated_rate(factor, "cuts"))
    yield Mistake("all taps state twice their rate", stated_rate(2.0, "taps"), True)
    yield Mistake("all taps state 1024 times a ms", stated_rate(1e-3, "taps"))
    yield Mistake("cuts and taps state 3 % too high a rate", both(stated_rate(1.03, "cuts"), stated_rate(1.03, "taps")))
    yield Mistake("accelerations integrated once in one file", samples_of(summed(MOTIONS), single))


def _set_ups() -> Iterator[Mistake]:
    names = ("ax", "ay", "az")
    yield Mistake("accelerations stated as velocities", stated_as("velocity", "m/s", "cuts", *names), True)
    yield Mistake("accelerations stated as displacements in um", stated_as("displacement", "um", "cuts", *names), True)
    yield Mistake(
        "velocities stated as displacements",
        both(samples_of(summed(MOTIONS)), stated_as("displacement", "m", "cuts", *names)),
        True,
    )
    yield Mistake("ay of all cuts stated as velocity", stated_as("velocity", "m/s", "cuts", "ay"), True)
    yield Mistake("sensor at the housing stated as the tip", renamed("cuts", "HOUSING", "TCP"), True)
    yield Mistake("sensors of the housing in +Y stated as -Y", renamed("cuts", r"HOUSING:\+Y", "HOUSING:-Y"), True)


def _taps() -> Iterator[Mistake]:
    hammer, housing, tip = slice(0, 1), slice(1, 4), slice(4, 7)
    everywhere = slice(1, 7)
    for name, spoil in (
        ("hammer in lbf", tap_samples(scaled(hammer, POUND))),
        ("hammer of 2.25 mV/N called 10 mV/N", tap_samples(scaled(hammer, 4.44))),
        ("hammer in lbf in the file of y", tap_samples(scaled(hammer, POUND), "y")),
        ("hammer 30 % too large in the file of z", tap_samples(scaled(hammer, 1.3), "z")),
        ("hits along -y called +y", tap_samples(scaled(hammer, -1.0), "y")),
        ("hammer reversed", tap_samples(scaled(hammer, -1.0))),
        ("hits 25 degrees oblique", oblique(25)),
        ("hits along y 25 degrees oblique", oblique(25, "y")),
        ("double hits", lambda lab: taps_again(lab, "xyz", twice)),
        ("hit at the housing instead of the tip", tapped_at_housing),
        ("file of x given for y", wrong_file),
        ("y tapped with another tool", tapped_elsewhere("y", tip=0.4)),
        ("z tapped in another pose", tapped_elsewhere("z", frequency=0.93)),
        ("tip's accelerometer of a sensor twice as sensitive", tap_samples(scaled(tip, 2.0))),
        ("tip's y-accelerometer reversed", tap_samples(scaled(slice(5, 6), -1.0))),
        ("tip's y and z exchanged", tap_samples(exchanged(5, 6))),
        ("tip's accelerometers turned by 45 degrees", tap_samples(turned(tip, 45))),
        ("housing's accelerometers turned by 90 degrees", tap_samples(turned(housing, 90))),
        ("tip and housing exchanged", tap_samples(ordered([0, 4, 5, 6, 1, 2, 3]))),
        ("tip's accelerometer clipped at 30 %", tap_samples(clipped(tip, 0.3))),
        ("tip's accelerometer resonant at 90 Hz on wax", tap_samples(resonant(tip, 90, 0.05, TAP_RATE))),
        ("responses AC-coupled at 8 Hz", tap_samples(filtered(everywhere, 1, 16.0, "high"))),
        ("hammer behind a low-pass of 60 Hz", tap_samples(filtered(hammer, 2, 30.0, "low"))),
        ("exponential window of .5 s in the analyser", tap_samples(rung(0.5))),
    ):  # fmt: skip
        yield Mistake(name, spoil, True)


def _frfs() -> Iterator[Mistake]:
    both_sides = ("tip", "sensor")
    for name, change, sides in (
        ("conjugate tip FRF", lambda frf: replace(frf, values=frf.values.conj()), ("tip",)),
        ("conjugate FRFs", lambda frf: replace(frf, values=frf.values.conj()), both_sides),
        ("tip FRF with the sign of its response reversed", lambda frf: replace(frf, values=-frf.values), ("tip",)),
        ("tip FRF transposed", lambda frf: replace(frf, values=frf.values.swapaxes(1, 2)), ("tip",)),
        ("FRFs over rad/s", lambda frf: replace(frf, frequencies=2 * np.pi * frf.frequencies, band=None), both_sides),
        ("tip FRF one line later", lambda frf: replace(frf, values=np.roll(frf.values, 1, axis=0)), ("tip",)),
        ("tip FRF stated in mm/N", lambda frf: replace(frf, values=1e3 * frf.values), ("tip",)),
        ("tip FRF of one-sided over two-sided spectra", lambda frf: replace(frf, values=2 * frf.values), ("tip",)),
    ):
        yield Mistake(name, frf_files(change, *sides), True)
    yield Mistake(
        "tip and sensor FRF exchanged",
        lambda lab: lab.frfs.append(lambda frfs: {"tip": frfs["sensor"], "sensor": frfs["tip"]}),
        True,
    )


def _cutting_data() -> Iterator[Mistake]:
    for name, pattern, text in (
        ("teeth halved", "teeth = 2", "teeth = 1"), ("teeth doubled", "teeth = 2", "teeth = 4"),
        ("ktc in N/mm^2", "119e6", "119.0"), ("ktc in kPa", "119e6", "119e3"),
        ("ktc of another material", "119e6", "700e6"),
        ("ktc with the sum of both teeth", "119e6", "238e6"), ("krc in Pa", "krc = 0.17", "krc = 20e6"),
        ("krc and kac exchanged", "krc = 0.17\nkac = 0.33", "krc = 0.33\nkac = 0.17"),
        ("krc in per cent", "krc = 0.17", "krc = 17"), ("kac with the other sign", "kac = 0.33", "kac = -0.33"),
        ("diameter in mm", "0.0127", "12.7"), ("radius called diameter", "0.0127", "0.00635"),
        ("angles in radians", "= 90.0\nexit_angle_deg = 180.0", "= 1.5708\nexit_angle_deg = 3.1416"),
        ("edge angle as its complement", "edge_angle_deg = 90.0", "edge_angle_deg = 2.0"),
        ("feed in mm", "0.15e-3", "0.15"),
    ):  # fmt: skip
        yield Mistake(f"{name} in the cutting file", cutting(pattern, text))
    yield Mistake(
        "up milling for down in the cutting file",
        cutting("= 90.0\nexit_angle_deg = 180.0", "= 0.0\nexit_angle_deg = 90.0"),
        hidden=True,
    )
    yield Mistake(
        "slot for half of it in the cutting file",
        cutting("start_angle_deg = 90.0", "start_angle_deg = 0.0"),
        hidden=True,
    )
    yield Mistake("all accelerations twice too large", cuts_and_taps(2.0, MOTIONS, slice(1, 7)), hidden=True)
    yield Mistake("all forces 30 % too small", cuts_and_taps(0.7, FORCES, slice(0, 1)), hidden=True)
