"""Streams of an hour's work: idle spindle, entries, stable cuts, and onsets of chatter at known times."""

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from milling_simulator import Real, SimulatedCut, simulate_depths
from random_cuts import depth_with, random_structure

RATE = 10240.0
STEPS = 120
REPEATS = 0.02
"""Share up to which the motion of a stable cut differs from turn to turn, without uneven material."""
ONSET = 0.2
"""Share of the motion that differs from turn to turn, from which a cut chatters."""


@dataclass(frozen=True)
class Stream:
    """Samples (n, 2), and when the cut began to chatter, s; NaN: never."""

    samples: Real
    stated_speed: float  # rad/s
    cut: SimulatedCut
    onset: float


def random_cut_of_a_shop(rng: np.random.Generator) -> tuple[SimulatedCut, float, float]:
    """A cut of 1500 to 20000 rpm, a stable depth, and one that chatters, m."""
    while True:
        cut = random_structure(rng)
        if cut.frequencies.max() > 3000 or not 1500 < cut.rpm < 20000:
            continue
        stable = depth_with(cut, rng.uniform(0.75, 0.95))
        deep = depth_with(cut, 1 + 0.02 * float(np.exp(rng.uniform(0, 2.5))))
        if np.isfinite([stable, deep]).all():
            runout = cut.feed * float(rng.choice([0.0, rng.uniform(0.02, 0.2)]))
            return replace(cut, runout=runout, uneven=float(rng.choice([0.0, 0.01]))), stable, deep


def stream(rng: np.random.Generator, seconds: float, *, chatters: bool) -> Stream:
    """Idle for one to three seconds, enter within .1 to 1 s, mill, and leave; in the middle the depth may rise.

    Drawn again are streams that do not repeat from turn to turn where they are stable: with runout some cuts chatter
    below the limit of equal teeth.
    """
    while True:
        drawn = _drawn(rng, seconds, chatters=chatters)
        if drawn is not None:
            return drawn


def _drawn(rng: np.random.Generator, seconds: float, *, chatters: bool) -> Stream | None:
    cut, stable, deep = random_cut_of_a_shop(rng)
    n = int(seconds * cut.rpm / 60 * cut.teeth) * STEPS
    time = np.arange(n) * 60 / cut.rpm / cut.teeth / STEPS
    begin, end = rng.uniform(1, 3), seconds - rng.uniform(1, 2)
    ramp, middle = rng.uniform(0.1, 1.0), seconds / 2
    depths = stable * np.clip(np.minimum(time - begin, end - time) / ramp, 0, 1)
    if chatters:
        depths += (deep - stable) * np.clip((time - middle) / 0.2, 0, 1) * (time < end - ramp)
    motion = simulate_depths(cut, depths, RATE, steps=STEPS)
    steady = (motion.turn_ends > begin + ramp + 0.5) & (motion.turn_ends < (middle if chatters else end - ramp))
    if motion.unrepeated[steady].max() > REPEATS + 2 * cut.uneven:
        return None
    late = (motion.turn_ends > middle) & (motion.turn_ends < end - ramp - 1) & (motion.unrepeated > ONSET)
    if chatters and late.sum() < 40:  # it chatters by less than a fifth of the motion, or with period doubling
        return None
    onset = float(motion.turn_ends[late][0]) if chatters else np.nan
    inside = slice(int((begin + ramp) * RATE), int(middle * RATE))
    samples = _disturbed(motion.acceleration, motion.acceleration[inside].std(axis=0), cut, rng)
    return Stream(samples, cut.rpm * pi / 30 * (1 + rng.uniform(-0.01, 0.01)), cut, onset)


def _disturbed(clean: Real, size: Real, cut: SimulatedCut, rng: np.random.Generator) -> Real:
    """Add noise of up to a fifth of the stable motion, unbalance, and in half of the streams hum."""
    time = np.arange(len(clean))[:, None] / RATE
    turn = 2 * pi * cut.rpm / 60 * time + rng.uniform(0, 2 * pi, 2)
    samples = clean + size * (rng.uniform(0, 0.2) * rng.standard_normal(clean.shape))
    samples += size * rng.uniform(0.01, 0.05) * np.cos(turn)
    if rng.random() < 0.5:
        samples += size * rng.uniform(0.02, 0.15) * np.cos(2 * pi * 50 * int(rng.integers(1, 4)) * time)
    return samples
