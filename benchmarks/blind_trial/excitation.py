"""Forces of the trial: speed sweeps in three immersions, porous material, both, one constant speed, or multisines.

A tooth at angle phi that is engaged cuts the chip ``h = feed sin(phi) + runout`` times the material's state;
tangential, radial and axial forces are ``K a h (1, kr, ka)`` (Altintas, Manufacturing Automation, 2nd ed., section
2.6). The force is given: the cut does not react to the vibration.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin, lfilter, upfirdn

RATE = 512
"""Of the recordings, Hz."""
BEFORE, DURATION, AFTER = 3, 48, 1
"""Run-in that is not recorded, recording, and run-out that is not recorded, s."""
KEPT = slice(BEFORE * RATE, (BEFORE + DURATION) * RATE)
LEVELS = {"low": 1.0, "mid": 2.2, "high": 3.6, "unseen": 2.8}
EXCITATIONS = ("sweeps", "porous", "mixed", "constant", "multisine")
PERIOD, LOWEST, HIGHEST = 4, 2.0, 110.0
"""Of the multisine: period, s, and its lines, Hz."""

_FINE = 4096
_IMMERSIONS = (
    (0.0, np.pi),
    (0.5 * np.pi, np.pi),
    (0.7 * np.pi, np.pi),
    (0.0, 0.5 * np.pi),
    (0.25 * np.pi, 0.75 * np.pi),
)


@dataclass(frozen=True)
class Cut:
    """One stretch of a test.

    Parameters
    ----------
    speeds
        Spindle speed at its beginning and end, rev/s.
    immersion
        Start and exit angle, rad.
    turn : rad
        Angle of the feed direction in the XY plane.
    roughness
        Standard deviation of the material's state: about 0.1 for solid, 0.6 and more for porous.
    """

    speeds: tuple[float, float]
    immersion: tuple[float, float]
    turn: float
    roughness: float


@dataclass(frozen=True)
class Test:
    """Force (n, 3) in N at 512 Hz with run-in and run-out, and the spindle angle (n,) in rad."""

    __test__ = False

    force: NDArray[np.float64]
    angle: NDArray[np.float64]


def milling_test(kind: str, level: str, force_scale: float, plan_seed: int, rng: np.random.Generator) -> Test:
    """Draw one test of a kind in :data:`EXCITATIONS`; ``force_scale`` is the RMS of all three forces at ``low``, N.

    Tool, speeds and immersions follow from ``plan_seed``: a lab repeats its plan at several depths.
    """
    if kind == "multisine":
        return _multisine(LEVELS[level] * force_scale, np.random.default_rng(plan_seed))
    total = BEFORE + DURATION + AFTER
    planned = np.random.default_rng(plan_seed)
    cuts = _plan(kind, planned)
    edges = np.round(np.array([0, BEFORE + 16, BEFORE + 32, total]) * _FINE).astype(int)
    speed, pieces = np.empty(edges[-1]), []
    for cut, begin, end in zip(cuts, edges[:-1], edges[1:], strict=True):
        speed[begin:end] = np.linspace(*cut.speeds, end - begin)
    angle = 2 * np.pi * (np.cumsum(speed) / _FINE + rng.random())
    teeth = int(planned.choice([2, 3, 4]))
    runout = planned.uniform(0.02, 0.25, teeth) * np.sign(planned.standard_normal(teeth))
    ratios = (planned.uniform(0.2, 0.5), planned.uniform(0.2, 0.6))
    for cut, begin, end in zip(cuts, edges[:-1], edges[1:], strict=True):
        state = _material(cut.roughness, end - begin, rng)
        pieces.append(_forces(cut, angle[begin:end], state, runout, ratios))
    force = _band_limited(np.vstack(pieces))
    force *= LEVELS[level] * force_scale / np.sqrt(np.mean(force[KEPT] ** 2))
    return Test(force * _taper(len(force))[:, None], angle[:: _FINE // RATE])


def _multisine(size: float, rng: np.random.Generator) -> Test:
    """Periodic forces of equal amplitudes and random phases on three shakers, drawn anew every 16 s.

    Three draws make the three inputs independent (Pintelon & Schoukens, System Identification, 2nd ed., section
    2.7). ``size`` is the RMS of all three forces, N.
    """
    total, period = (BEFORE + DURATION + AFTER) * RATE, PERIOD * RATE
    lines = np.arange(int(LOWEST * PERIOD), int(HIGHEST * PERIOD))
    force, edges = np.empty((total, 3)), [0, (BEFORE + 16) * RATE, (BEFORE + 32) * RATE, total]
    for begin, end in pairwise(edges):
        spectrum = np.zeros((period // 2 + 1, 3), dtype=complex)
        spectrum[lines] = np.exp(2j * np.pi * rng.random((len(lines), 3)))
        single = np.fft.irfft(spectrum, period, axis=0)
        force[begin:end] = np.resize(single, (end - begin, 3))
    force *= size / np.sqrt(np.mean(force[KEPT] ** 2))
    angle = 2 * np.pi * rng.uniform(5, 18) * np.arange(total) / RATE
    return Test(force * _taper(total)[:, None], angle)


def _plan(kind: str, rng: np.random.Generator) -> list[Cut]:
    picked = rng.permutation(len(_IMMERSIONS))[:3]
    low, high = rng.uniform(5, 8), rng.uniform(12, 18)
    solid, porous = rng.uniform(0.05, 0.2, 3), rng.uniform(0.5, 0.9, 3)
    still = float(rng.uniform(low, high))
    cuts = []
    for k, chosen in enumerate(picked):
        swept = kind == "sweeps" or (kind == "mixed" and k != 1)
        speeds = (low, high) if swept else (still, still)
        roughness = float(solid[k] if swept or kind == "constant" else porous[k])
        which = picked[0] if kind == "constant" else chosen
        turn = 0.0 if kind == "constant" else float(rng.uniform(0, 2 * np.pi))
        cuts.append(Cut(speeds if k % 2 == 0 else speeds[::-1], _IMMERSIONS[which], turn, roughness))
    return cuts


def _material(roughness: float, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """``max(0, 1 + roughness n(t))`` with n a first-order Gauss-Markov process of 3 ms."""
    keep = np.exp(-1 / (0.003 * _FINE))
    noise = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(n))
    return np.asarray(np.maximum(0.0, 1 + roughness * noise))


def _forces(
    cut: Cut,
    angle: NDArray[np.float64],
    state: NDArray[np.float64],
    runout: NDArray[np.float64],
    ratios: tuple[float, float],
) -> NDArray[np.float64]:
    """Sum over teeth and three slices along a helix, shape (n, 3)."""
    radial, axial = ratios
    total = np.zeros((len(angle), 3))
    for tooth, extra in enumerate(runout):
        for lag in (0.0, 0.12, 0.24):
            phi = np.mod(angle + 2 * np.pi * tooth / len(runout) - lag, 2 * np.pi)
            sine, cosine = np.sin(phi), np.cos(phi)
            engaged = (phi > cut.immersion[0]) & (phi < cut.immersion[1])
            push = engaged * np.maximum(0.0, sine + extra) * state
            total[:, 0] += push * (-cosine - radial * sine)
            total[:, 1] += push * (sine - radial * cosine)
            total[:, 2] += push * axial
    turn = np.array([[np.cos(cut.turn), -np.sin(cut.turn)], [np.sin(cut.turn), np.cos(cut.turn)]])
    total[:, :2] = total[:, :2] @ turn.T
    return total


def _band_limited(force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Low-pass at 180 Hz without phase and take every eighth sample."""
    taps = firwin(513, 180, fs=_FINE, window=("kaiser", 8.0))
    down = _FINE // RATE
    filtered = upfirdn(taps, force, up=1, down=down, axis=0)
    first = (len(taps) - 1) // 2 // down
    return np.asarray(filtered[first : first + len(force) // down])


def _taper(n: int) -> NDArray[np.float64]:
    """Rise over the first second, fall over the last half."""
    window = np.ones(n)
    window[:RATE] = np.sin(np.linspace(0, np.pi / 2, RATE)) ** 2
    window[-RATE // 2 :] = np.cos(np.linspace(0, np.pi / 2, RATE // 2)) ** 2
    return window
