"""Cases: rig, hidden effect and strength, simulated and written as files."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from acquisition import Channel, RecordingWriter, StreamDescription
from modal_fit import write_modal_model

from .effects import DRIVES, EFFECTS, NOTHING, RIGS, Effect
from .laws import integrated
from .rigs import FINE, LEAD, RATE, SECONDS, Real, Rig, draw_rig, excitation, nominal_model

UNITS = {"force": "N", "acceleration": "m/s^2", "displacement": "m"}


@dataclass(frozen=True)
class Case:
    """One case: rig, hidden effect with its strength ``dial``, and what the linear rig does at the middle level."""

    index: int
    seed: int
    effect: Effect
    rig: Rig
    drive: str
    target: float  # size that is asked for
    noise_share: float
    force_noise: float
    off: float
    u: tuple[float, float]
    level: float
    steady_noise: bool
    run: int = 1
    dial: float = 0.0
    scales: tuple[float, ...] = (1.0, 1.0)  # a third of the joint's largest deflection and velocity
    rms: float = 1.0
    peak: float = 1.0
    steepest: float = 1.0

    @property
    def generator(self) -> np.random.Generator:
        """The same random numbers at every strength."""
        return np.random.default_rng([self.seed, self.index, self.run])

    def noise(self, count: int) -> Real:
        """White noise of unit size."""
        return self.generator.standard_normal(count)

    def force(self) -> tuple[Real, Real]:
        """Forces of this recording, (n_samples, n_excitations), and the course of the spindle speed."""
        rng = np.random.default_rng([self.seed, self.index, 9, self.run])
        force, course = excitation(self.drive, self.rig, self.run, rng)
        return self.level * 2.0 ** (self.run - 1) * force, course

    def course(self, speed: Real) -> Real:
        """What the stiffness or the mass follows, at all half steps."""
        t = np.arange(2 * FINE * len(speed) + 1) / (2 * FINE * RATE) - LEAD
        if self.effect.course == "recovery":
            turn, lag = SECONDS * (0.3 + 0.3 * self.u[0]), 2.0 + 4 * self.u[1]
            heated = 1 - np.exp(-np.clip(t, 0, turn) / lag)
            return -heated * np.exp(-np.clip(t - turn, 0, None) / lag) * (-1 if self.effect.code == 2 else 1)
        if self.effect.course == "speed":
            return np.asarray(np.interp(t, np.arange(len(speed)) / RATE - LEAD, speed / np.abs(speed).max()))
        if self.effect.course == "run":
            return np.full(len(t), 0.5 * self.run)
        hz = 0.5 + 5 * self.u[0] if self.effect.course == "sine" else 0.05 + 0.1 * self.u[0]
        return np.cos(2 * np.pi * (hz * t + self.u[1]))

    def motion(self, code: int) -> tuple[Real, Real, Real]:
        """Forces, modal deflections, velocities and accelerations (n_samples, 3, n_modes) with their run-in."""
        rig, (force, speed) = self.rig, self.force()
        pushed = scipy.signal.resample(force, 2 * FINE * len(force)) @ rig.push
        mass = 1 / np.sum(rig.joint[0] ** 2)
        low, high = rig.omega.min(), rig.omega.max()
        k2 = low + (high - low) * self.u[1] if code == 11 else rig.stiffness(1)
        a = np.array([self.dial, rig.stiffness(0), *self.scales, self.u[0], k2, mass])
        delay = int((0.1 + 0.5 * self.u[0]) / (low / 2 / np.pi) * FINE * RATE)
        numbers = code, a, rig.omega, rig.zeta, rig.joint, np.vstack([pushed, pushed[-1:]]), self.course(speed)
        return force, speed, integrated(*numbers, FINE, 1 / (FINE * RATE), delay)

    def signals(self, hidden: bool = True) -> tuple[Real, Real]:
        """Forces and responses of this recording without noise, with or without the hidden effect."""
        force, _, q = self.motion(self.effect.code if hidden else 0)
        shown = q[:, 2 if self.rig.response == "acceleration" else 0] @ self.rig.shown.T
        first, t = int(LEAD * RATE), np.arange(int(SECONDS * RATE)) / RATE
        force, shown = force[first:], shown[first:]
        if hidden and self.effect.change is not None:
            return self.effect.change(force, shown, t, self)
        return force, shown

    def in_band(self, signal: Real) -> Real:
        """Spectrum in the band of the modes, so scaled that its squares sum up to the mean square."""
        axis = np.fft.rfftfreq(len(signal), 1 / RATE)
        inside = (axis >= self.rig.band[0]) & (axis <= self.rig.band[1])
        return np.asarray(np.fft.rfft(signal, axis=0)[inside] * np.sqrt(2) / len(signal))


def power(spectrum: Real) -> Real:
    """Mean square of each channel."""
    return np.asarray(np.sum(np.abs(spectrum) ** 2, axis=0))


def noise_at(case: Case, shown: Real, noise: Real) -> Real:
    """Noise of each response in the band: that of the middle level, or the same share of each recording."""
    return noise if case.steady_noise else case.noise_share * np.sqrt(power(case.in_band(shown)))


def prepared(case: Case) -> tuple[Case, Real]:
    """Return the case with its scales and its strength, and the noise of each response at the middle level."""
    _, _, q = case.motion(0)
    q = q[int(LEAD * RATE) :]
    z, v = q[:, 0] @ case.rig.joint[0], q[:, 1] @ case.rig.joint[0]
    _, shown = case.signals(hidden=False)
    noise = case.noise_share * np.sqrt(power(case.in_band(shown)))
    first, scales = shown[:, 0], (float(np.abs(z).max() / 3), float(np.abs(v).max() / 3))
    peak, steepest = np.abs(first).max(), np.abs(np.diff(first)).max()
    case = replace(case, scales=scales, rms=first.std(), peak=peak, steepest=steepest)
    low, high = 1e-5 * case.effect.most, case.effect.most
    for _ in range(9 if case.effect != NOTHING else 0):
        middle = replace(case, dial=math.sqrt(low * high), run=2 if case.effect.course == "run" else 1)
        size = np.sqrt(np.mean(power(middle.in_band(middle.signals()[1] - middle.signals(False)[1])) / noise**2))
        low, high = (low, middle.dial) if not size <= case.target else (middle.dial, high)
    return replace(case, dial=low), noise


def beyond_linear(case: Case, noise: Real) -> float:
    """Return what the best linear model of as many modes leaves of all recordings, over the noise.

    Poles and all residues are free (variable projection), so that this is a lower bound of what a refit leaves.
    """
    runs = [replace(case, run=run) for run in range(3)]
    data = [run.signals() for run in runs]
    shown = [case.in_band(signals[1]) / noise_at(case, signals[1], noise) for signals in data]
    weights = np.vstack(
        [1 / noise_at(case, signals[1], noise) + 0 * part for signals, part in zip(data, shown, strict=True)]
    )
    values, direct = np.vstack(shown), np.vstack([case.in_band(signals[0]) for signals in data])
    cut, padded = slice(int(LEAD * RATE), int((LEAD + SECONDS) * RATE)), 2**16
    s = 2j * np.pi * np.fft.rfftfreq(padded, 1 / RATE)[:, None]
    forces = [np.fft.rfft(run.force()[0], padded, axis=0) for run in runs]

    def left(numbers: Real) -> Real:
        columns = [direct]
        for w, c in np.exp(numbers).reshape(2, -1).T:
            for top in (1.0, s):
                filtered = [np.fft.irfft(f * top / (s**2 + 2 * c * w * s + w * w), axis=0)[cut] for f in forces]
                columns.append(np.vstack([case.in_band(x) for x in filtered]))
        matrix = np.hstack(columns)
        matrix = matrix / np.linalg.norm(matrix, axis=0)
        return np.hstack([_rest(matrix * w[:, None], y) for w, y in zip(weights.T, values.T, strict=True)])

    start, scale = np.r_[case.rig.omega, case.rig.zeta], np.r_[case.rig.zeta, np.full_like(case.rig.zeta, 0.3)]
    refit = scipy.optimize.least_squares(left, np.log(start), x_scale=scale, max_nfev=8)
    return float(np.sqrt(np.sum(refit.fun**2) / 3 / values.shape[1]))


def _rest(matrix: Real, values: Real) -> Real:
    """What a combination of columns with real weights leaves of complex values, real and imaginary parts."""
    columns, right = np.vstack([matrix.real, matrix.imag]), np.r_[values.real, values.imag]
    return np.asarray(right - columns @ np.linalg.lstsq(columns, right, rcond=1e-12)[0])


def written(case: Case, noise: Real, folder: Path) -> dict[str, Any]:
    """Write nominal model and recordings; return the sizes of the effect, over all recordings and by recording."""
    rig, sizes = case.rig, []
    rng = np.random.default_rng([case.seed, case.index, 5])
    write_modal_model(folder / "nominal.json", nominal_model(rig, case.off, rng, case.u[0] < 0.5))
    for run in range(3):
        here = replace(case, run=run)
        (force, shown), clean = here.signals(), here.signals(hidden=False)[1]
        sigma = noise_at(case, shown, noise)
        sizes.append(float(np.sqrt(np.mean(power(case.in_band(shown - clean)) / sigma**2))))
        white = sigma * np.sqrt(RATE / 2 / (rig.band[1] - rig.band[0]))
        shown = shown + white * rng.standard_normal(shown.shape)
        force = force + case.force_noise * force.std(axis=0) * rng.standard_normal(force.shape)
        channels = [
            Channel(f"{letter}{k}", quantity, UNITS[quantity], label[:-3], label[-2:])
            for letter, quantity, labels in (("f", rig.drive, rig.excitations), ("y", rig.response, rig.responses))
            for k, label in enumerate(labels)
        ]
        with RecordingWriter(folder / f"run_{run}.h5", [StreamDescription("main", RATE, 0.0, tuple(channels))]) as file:
            file.append("main", np.hstack([force, shown]))
    return {"size": float(np.sqrt(np.mean(np.square(sizes)))), "sizes": sizes}


def drawn(seed: int, count: int) -> list[Case]:
    """Draw the cases: a quarter hides nothing, the others take effects in random order."""
    order = np.random.default_rng(seed).permutation(len(EFFECTS))
    cases = []
    for index in range(count):
        rng, place = np.random.default_rng([seed, index]), index - index // 4
        effect = NOTHING if index % 4 == 3 else EFFECTS[order[place % len(EFFECTS)]]
        kind, drive, two = (*effect.needs, "", "", "")[:3]
        kind = kind or ("arm" if drive else str(rng.choice(RIGS)))
        rig, drive = draw_rig(rng, kind), drive or str(rng.choice(DRIVES[kind]))
        while two and len(rig.responses) < 2:
            rig = draw_rig(rng, kind)
        numbers = math.exp(rng.uniform(0, math.log(30))), math.exp(rng.uniform(math.log(0.003), math.log(0.03)))
        weak = 0.0 if rng.random() < 0.7 else rng.uniform(0.001, 0.01)
        level = 0.1 if rig.drive == "acceleration" else 20.0
        off, u = float(rng.choice([0.0, 0.5, 1.0])), (rng.random(), rng.random())
        steady_noise = bool(rng.random() < 0.5)
        cases.append(Case(index, seed, effect, rig, drive, *numbers, weak, off, u, level, steady_noise))
    return cases
