"""Random cells: a robot's tip and spindle housing in the cut and at rest, a cutter, and the cut that a shop asks for.

The spindle is a rigid body that the robot's modes move and turn; force enters and motion is measured at its points. In
modal coordinates q of the undamped robot, with the tip's motion T q and a skew stiffness N and damping G, which make
the robot not reciprocal,

    q'' + (C + G) q' + (K + N) q = T^T F.
"""

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

LEAST_DAMPING = 0.006  # damping ratio that the skew terms leave to every mode


@dataclass(frozen=True)
class Structure:
    """Motion of tip and sensor by forces on the tip: ``x = 2 Re sum_r shape_r s_r``, ``s_r' = pole_r s_r + entry_r F``.

    ``poles`` (n,) are in rad/s; ``tip``, ``sensor`` and ``entry`` have the shape (n, 3).
    """

    poles: Complex
    tip: Complex
    sensor: Complex
    entry: Complex

    def receptance(self, frequencies: Real) -> Complex:
        """Receptance of the tip, m/N, (n_lines, 3, 3)."""
        s = 2j * pi * np.asarray(frequencies, dtype=float)[:, None]
        plain = np.einsum("rp,rq,fr->fpq", self.tip, self.entry, 1 / (s - self.poles))
        mirrored = np.einsum("rp,rq,fr->fpq", self.tip.conj(), self.entry.conj(), 1 / (s - self.poles.conj()))
        return np.asarray(plain + mirrored)


@dataclass(frozen=True)
class Cut:
    """A square cutter with straight edges in its cut: lengths in m, angles in rad from +Y, ``ktc`` in Pa."""

    teeth: int
    diameter: float
    start: float
    leave: float
    ktc: float
    krc: float
    kac: float
    feed: float

    @property
    def pitch(self) -> float:
        """Angle between teeth, rad."""
        return 2 * pi / self.teeth


@dataclass(frozen=True)
class Cell:
    """All of a cell that the trial draws.

    Parameters
    ----------
    in_cut, at_rest
        The robot while it mills, and while it is tapped.
    cut, stated
        The cut with its true coefficients, and as the cutting file states it.
    coefficient_error
        Relative standard error that the file states.
    speeds_rpm, max_depth
        Lowest and highest speed, and the largest depth (m), that the shop asks for.
    sweep
        Tooth passing at begin and end of the identification cuts, Hz.
    widths
        Width of the immersions of the identification cuts, rad.
    uneven
        Relative spread of the coefficients from tooth to tooth in these cuts.
    noise
        Noise of each sensor over the rms of its signal.
    tapped
        Directions in which the tip is tapped.
    about
        Material, engagement, frequencies and further facts, for the table.
    """

    in_cut: Structure
    at_rest: Structure
    cut: Cut
    stated: Cut
    coefficient_error: float
    speeds_rpm: tuple[float, float]
    max_depth: float
    sweep: tuple[float, float]
    widths: float
    uneven: float
    noise: float
    tapped: str
    about: dict[str, object]


def draw_cell(number: int, seed: int) -> Cell:
    """Draw a cell; the same number and seed give the same cell."""
    rng = np.random.default_rng([seed, number])
    in_cut, at_rest, about = _robot(rng)
    cut, speeds, material, kind = _shop(rng)
    off = 1 + 0.07 * rng.choice([-1.0, 1.0], 3)
    stated = replace(cut, ktc=cut.ktc * off[0], krc=cut.krc * off[1], kac=cut.kac * off[2])
    about |= {"material": material, "engagement": kind, "ktc_stated_over_true": float(off[0])}
    return Cell(
        in_cut,
        at_rest,
        cut,
        stated,
        0.05,
        speeds,
        float(rng.uniform(0.5, 1.0)) * cut.diameter,
        (float(rng.uniform(8.5, 10.0)), float(rng.uniform(22.0, 26.0))),
        float(np.radians(rng.uniform(35.0, 60.0))),
        float(rng.uniform(0.0, 0.1)),
        float(rng.uniform(0.005, 0.02)),
        str(rng.choice(["XY", "XYZ"])),
        about,
    )


def _robot(rng: np.random.Generator) -> tuple[Structure, Structure, dict[str, object]]:
    """Structure in the cut and at rest, and its facts."""
    low = _low_frequencies(rng)
    outside = [*rng.uniform(6.5, 10.0, int(rng.random() < 0.35)), *rng.uniform(46.0, 60.0, int(rng.random() < 0.35))]
    hidden = list(rng.uniform(70.0, 140.0, int(rng.integers(0, 3))))
    frequencies = np.array([*low, *outside, *hidden])
    n = len(frequencies)
    damping = np.exp(rng.uniform(np.log(0.015), np.log(0.06), n))
    heavy = rng.random(n) < 0.2
    damping[heavy] = rng.uniform(0.08, 0.14, int(heavy.sum()))
    flexibility = np.exp(rng.uniform(np.log(0.3e-6), np.log(3e-6), n))
    flexibility[len(low) + len(outside) :] *= rng.uniform(0.05, 0.3, len(hidden))
    tip, sensor = _shapes(rng, 2 * pi * frequencies, flexibility)
    skew = [np.triu(rng.standard_normal((n, n)), 1) for _ in range(2)]
    strength = float(rng.uniform(0.005, 0.03))
    # robots are called some per cent stiffer by their stiffness or by their frequencies: both are drawn
    by_frequency = bool(rng.random() < 0.5)
    stiffer = rng.uniform(1.03, 1.08, n) if by_frequency else np.sqrt(rng.uniform(1.03, 1.08, n))
    in_cut = assembled(2 * pi * frequencies, damping, tip, sensor, skew, strength)
    at_rest = assembled(2 * pi * frequencies * stiffer, damping * rng.uniform(0.6, 1.5, n), tip, sensor, skew, strength)
    about: dict[str, object] = {
        "modes_hz": [round(float(f), 2) for f in low],
        "outside_hz": [round(float(f), 2) for f in outside],
        "hidden_hz": [round(float(f), 2) for f in hidden],
        "poles_in_cut_hz": [round(float(f), 2) for f in np.sort(np.abs(in_cut.poles)) / (2 * pi)],
        "poles_at_rest_hz": [round(float(f), 2) for f in np.sort(np.abs(at_rest.poles)) / (2 * pi)],
    }
    return in_cut, at_rest, about


def _low_frequencies(rng: np.random.Generator) -> Real:
    """Three to six frequencies of 11 to 42 Hz, in six of ten robots with a pair 3 to 9 % apart."""
    count, pair = int(rng.integers(3, 7)), rng.random() < 0.6
    while True:
        drawn = np.sort(np.exp(rng.uniform(np.log(11.0), np.log(42.0), count - int(pair))))
        if len(drawn) < 2 or np.min(drawn[1:] / drawn[:-1]) > 1.10:
            break
    if pair:
        drawn = np.append(drawn, rng.choice(drawn) * rng.uniform(1.03, 1.09))
    return np.sort(np.clip(drawn, 11.0, 42.0))


def _shapes(rng: np.random.Generator, omega: Real, flexibility: Real) -> tuple[Real, Real]:
    """Mass-normalised motion of tip and sensor, (n, 3) each, of a rigid spindle that each mode moves and turns."""
    n = len(omega)
    lever = np.array([rng.uniform(-0.08, 0.08), rng.uniform(-0.08, 0.08), -rng.uniform(0.15, 0.30)])
    moved = rng.standard_normal((n, 3)) * [1.0, 1.0, 0.6]
    moved /= np.linalg.norm(moved, axis=1, keepdims=True)
    turned = rng.standard_normal((n, 3))
    turned *= rng.uniform(0.1, 0.8, (n, 1)) / np.linalg.norm(turned, axis=1, keepdims=True) / np.linalg.norm(lever)
    tip = moved + np.cross(turned, lever)
    scale = omega * np.sqrt(flexibility) / np.linalg.norm(tip, axis=1)
    return tip * scale[:, None], moved * scale[:, None]


def assembled(omega: Real, damping: Real, tip: Real, sensor: Real, skew: list[Real], strength: float) -> Structure:
    """Structure of undamped modes with mass-normalised shapes, modal damping and skew coupling of a given strength.

    The strength is halved until no mode is damped by less than LEAST_DAMPING.
    """
    n = len(omega)
    while True:
        circulatory = strength * (skew[0] - skew[0].T) * np.outer(omega, omega)
        gyroscopic = strength * (skew[1] - skew[1].T) * np.sqrt(np.outer(omega, omega))
        stiffness = np.diag(omega**2) + circulatory
        state = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -np.diag(2 * damping * omega) - gyroscopic]])
        values, vectors = np.linalg.eig(state)
        kept = np.flatnonzero(values.imag > 0)
        ratios = -values[kept].real / np.abs(values[kept])
        if len(kept) == n and ratios.min() > min(LEAST_DAMPING, damping.min()):
            break
        strength /= 2
    kept = kept[np.argsort(np.abs(values[kept]))]
    entry, shapes = np.linalg.inv(vectors)[kept, n:], vectors[:n, kept].T
    return Structure(
        values[kept], *(np.asarray(part, complex) for part in (shapes @ tip, shapes @ sensor, entry @ tip))
    )


def _shop(rng: np.random.Generator) -> tuple[Cut, tuple[float, float], str, str]:
    """Cut with true coefficients, range of speeds (rpm), material and kind of engagement."""
    material = str(rng.choice(["aluminium", "steel"]))
    soft = material == "aluminium"
    ktc = rng.uniform(6e8, 9e8) if soft else rng.uniform(1.8e9, 2.6e9)
    krc = rng.uniform(0.2, 0.4) if soft else rng.uniform(0.3, 0.5)
    teeth, diameter = int(rng.choice([2, 3, 4])), float(rng.choice([8, 10, 12, 16, 20, 25])) * 1e-3
    kind = str(rng.choice(["down", "up", "central", "slot"], p=[0.4, 0.25, 0.15, 0.2]))
    start, leave = immersion(kind, float(rng.uniform(0.1, 0.6)))
    cut = Cut(teeth, diameter, start, leave, ktc, krc, rng.uniform(0.05, 0.3), rng.uniform(0.04e-3, 0.12e-3))
    if rng.random() < 1 / 3:  # a slow spindle: the teeth pass at 60 to 130 Hz at most
        top = 60 * rng.uniform(60.0, 130.0) / teeth
    else:
        cutting_speed = rng.uniform(200.0, 500.0) if soft else rng.uniform(80.0, 160.0)  # m/min
        top = min(cutting_speed / (pi * diameter), 60 * 450.0 / teeth)
    return cut, (float(round(top / rng.uniform(2.0, 3.5), -1)), float(round(top, -1))), material, kind


def immersion(kind: str, share: float) -> tuple[float, float]:
    """Angles of entry and exit of a cut of a radial depth of ``share`` diameters, rad."""
    arc = float(np.arccos(1 - 2 * share))
    if kind == "central":
        half = float(np.arcsin(share))
        return pi / 2 - half, pi / 2 + half
    return {"down": (pi - arc, pi), "up": (0.0, arc), "slot": (0.0, pi)}[kind]
