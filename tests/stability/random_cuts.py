"""Random cuts on a known side of the boundary, disturbed as a laboratory's recordings are."""

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from milling_simulator import SimulatedCut, simulate

from millfrf.stability import multipliers

LEAST_CHATTER = 0.05
"""Share of the motion below which the chatter of an unstable cut counts as none."""
FAR_FROM_ONE = 0.02
"""Stable cuts have a largest multiplier of at most 1 less this, unstable ones of at least 1 plus this."""


@dataclass(frozen=True)
class DisturbedCut:
    """What is judged, and the truth: samples (n, 2), rate (Hz), stated speed (rad/s), largest multiplier, the cut."""

    samples: np.ndarray
    rate: float
    stated_speed: float
    multiplier: complex
    cut: SimulatedCut
    noise: float
    tone: float


def largest_multiplier(cut: SimulatedCut, depth: float) -> complex:
    """Of the cut with equal teeth at this depth (m)."""
    equal = replace(cut, runout=0.0).process
    return complex(multipliers(cut.model, equal, cut.rpm * pi / 30, depth).values[0])


def random_structure(rng: np.random.Generator) -> SimulatedCut:
    """One to three modes of any direction, one to four teeth, any side and width of cut, 0.4 to 2.5 modes a tooth."""
    modes = int(rng.integers(1, 4))
    base = float(np.exp(rng.uniform(np.log(15), np.log(900))))
    angles = rng.uniform(0, pi, modes)
    teeth = int(rng.integers(1, 5))
    width = float(rng.choice([rng.uniform(0.15, 1.0), 1.0, 2.0])) * pi / 2
    start = 0.0 if rng.random() < 0.5 else pi - width
    rpm = base / rng.uniform(0.4, 2.5) * 60 / teeth
    return SimulatedCut(
        base * np.concatenate([[1.0], rng.uniform(1.1, 2.5, modes - 1)]),
        rng.uniform(0.01, 0.05, modes),
        1e6 * np.exp(rng.uniform(0, 2, modes)),
        np.column_stack([np.cos(angles), np.sin(angles)]),
        teeth,
        start,
        start + width,
        rpm,
        krc=float(rng.uniform(0.1, 0.5)),
    )


def depth_with(cut: SimulatedCut, size: float) -> float:
    """Least depth (m) at which the largest multiplier has this modulus; NaN where none has below 0.1 m."""
    low = 1e-5
    if abs(largest_multiplier(cut, low)) >= size:
        return float("nan")
    for high in np.geomspace(1e-5, 0.1, 41)[1:]:
        if abs(largest_multiplier(cut, float(high))) >= size:
            break
        low = float(high)
    else:
        return float("nan")
    for _ in range(14):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if abs(largest_multiplier(cut, middle)) >= size else (middle, high)
    return float(np.sqrt(low * high))


def random_cut(rng: np.random.Generator, *, stable: bool) -> DisturbedCut:
    """A simulated cut of 300 to 600 tooth periods with noise, runout, tones, speed error and drift.

    The multiplier is that of equal teeth that stay in the cut. Drawn again are stable cuts whose twin without noise
    does not repeat from turn to turn (runout makes teeth leave the cut), and unstable ones whose twin chatters by less
    than 5 % of the motion (teeth that leave the thin end of the chip hold the chatter, or runout does).
    """
    while True:
        cut = random_structure(rng)
        size = rng.uniform(0.75, 1 - FAR_FROM_ONE) if stable else 1 + FAR_FROM_ONE * np.exp(rng.uniform(0, 3.2))
        depth = depth_with(cut, size)
        runout = cut.feed * float(rng.choice([0.0, rng.uniform(0.02, 0.3)]))
        cut = replace(cut, depth=depth, runout=runout, uneven=float(rng.choice([0.0, 0.01, 0.03])))
        cut = replace(cut, drift=float(rng.uniform(-3e-3, 3e-3)), seed=int(rng.integers(1 << 30)))
        if not np.isfinite(depth):
            continue
        rate = float(cut.frequencies.max()) * rng.uniform(8, 25)
        periods = int(rng.integers(300, 600))
        multiplier = largest_multiplier(cut, depth)
        doubles = abs(multiplier.imag) < 1e-6 * abs(multiplier)
        skip = int(rng.integers(0, 100))
        motion = simulate(cut, periods + skip, rate, skip=skip)
        twin = simulate(replace(cut, uneven=0.0), periods + skip, rate) if cut.uneven else motion
        if stable and twin.unrepeated > 0.01:
            continue
        if not stable and max(twin.unrepeated, twin.alternating * doubles) < LEAST_CHATTER:
            continue
        return disturbed(cut, motion.acceleration, rate, multiplier, rng)


def disturbed(
    cut: SimulatedCut, clean: np.ndarray, rate: float, multiplier: complex, rng: np.random.Generator
) -> DisturbedCut:
    """Add noise of 0 to 20 % (white or coloured), in half of the cuts one or two foreign tones, and a speed error."""
    size = clean.std(axis=0)
    noise = float(rng.choice([0.0, rng.uniform(0, 0.2), 0.2]))
    white = rng.standard_normal(clean.shape)
    if rng.random() < 0.5:
        white = _coloured(white)
    samples = clean + noise * size * white
    time = np.arange(len(clean)) / rate
    tone = 0.0
    if rng.random() < 0.5:
        for _ in range(int(rng.integers(1, 3))):
            tone = float(rng.uniform(0.02, 0.15))
            mains = 50.0 * float(rng.integers(1, 4))
            frequency = mains if rng.random() < 0.5 and mains < 0.4 * rate else float(rng.uniform(0.01, 0.3)) * rate
            wave = np.cos(2 * pi * frequency * time[:, None] + rng.uniform(0, 2 * pi, 2))
            samples = samples + tone * size * np.sqrt(2) * wave * rng.uniform(0.3, 1.0, 2)
    stated = cut.rpm * pi / 30 * (1 + rng.uniform(-0.01, 0.01))
    return DisturbedCut(samples, rate, float(stated), multiplier, cut, noise, tone)


def seen_from_afar(cut: DisturbedCut, rng: np.random.Generator) -> DisturbedCut:
    """The cut at one or two sensors away from the tool, with an idle spindle before and after it.

    Two to four modes of the machine lie between tool and sensor, and add to what comes directly; the size of the
    motion swells by up to a fifth. The idle spindle has noise and unbalance of 1 to 5 % of the cut.
    """
    channels = int(rng.integers(1, 3))
    direct = rng.uniform(0.2, 1.0, (2, channels)) * rng.choice([-1.0, 1.0], (2, channels))
    heard = cut.samples @ direct
    spectrum = np.fft.rfft(cut.samples @ rng.standard_normal((2, channels)), axis=0)
    frequencies = np.fft.rfftfreq(len(cut.samples), 1 / cut.rate)
    for _ in range(int(rng.integers(2, 5))):
        mode, damping = rng.uniform(0.02, 0.3) * cut.rate, rng.uniform(0.02, 0.08)
        ratio = frequencies / mode
        gain = 0.2 * rng.uniform(0.2, 1.0, channels) / (1 - ratio**2 + 2j * damping * ratio)[:, None]
        heard = heard + np.fft.irfft(spectrum * gain, len(cut.samples), axis=0)
    time = np.arange(len(heard)) / cut.rate
    heard = heard * (1 + 0.2 * rng.random() * np.cos(2 * pi * time / time[-1] + rng.uniform(0, 2 * pi)))[:, None]
    before, after = (int(share * len(heard)) for share in rng.uniform(0.0, 0.6, 2))
    padded = np.pad(heard, ((before, after), (0, 0)))
    time = np.arange(len(padded)) / cut.rate
    idle = rng.uniform(0.01, 0.05) * heard.std(axis=0)
    unbalance = np.cos(2 * pi * cut.cut.rpm / 60 * time)[:, None] * np.sqrt(2)
    padded = padded + idle * (rng.standard_normal(padded.shape) + unbalance)
    return replace(cut, samples=padded)


def fitted(cut: SimulatedCut, rng: np.random.Generator) -> SimulatedCut:
    """The cut as a laboratory knows it: modes as far off as fits are, and the radial coefficient.

    Standard errors: frequencies 0.2 %, damping 5 %, stiffnesses 3 %, k_rc 3 %.
    """
    count = len(cut.frequencies)
    errors = [1 + size * rng.standard_normal(count) for size in (0.002, 0.05, 0.03)]
    return replace(
        cut,
        frequencies=cut.frequencies * errors[0],
        damping=cut.damping * errors[1],
        stiffnesses=cut.stiffnesses * errors[2],
        krc=cut.krc * float(1 + 0.03 * rng.standard_normal()),
    )


def _coloured(white: np.ndarray) -> np.ndarray:
    """First-order noise of unit size."""
    from scipy.signal import lfilter

    filtered = lfilter([1.0], [1.0, -0.9], white, axis=0)
    return np.asarray(filtered / filtered.std(axis=0))
