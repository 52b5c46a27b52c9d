"""Cuts simulated straight from the force equations, with teeth that leave the cut: shares no code with `replay_data`.

The spindle advances by equal angles. The material keeps, at every angle of the immersion, how far out its surface
stands; a tooth that reaches deeper takes the difference as its chip, a tooth that does not leaves the surface as it
was, one feed nearer (Insperger & Stepan, Semi-Discretization for Time-Delay Systems, section 5.3, with several delays
where teeth leave the cut). Modes are advanced exactly for a force held over a step.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from numba import njit
from scipy.signal import decimate

from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

Real = np.ndarray


@dataclass(frozen=True)
class SimulatedCut:
    """A cut in the plane of feed (x) and normal (y): modes, cutter, engagement, speed.

    ``frequencies`` (Hz), ``damping`` ratios, ``stiffnesses`` (N/m), unit ``directions`` (n_modes, 2) of the modes;
    ``depth`` and ``runout`` in m, ``feed`` in m a tooth, ``rpm`` at the middle of the cut, ``drift`` the change of
    speed from begin to end over its mean, ``uneven`` the spread of the cutting coefficient from pass to pass.
    """

    frequencies: Real
    damping: Real
    stiffnesses: Real
    directions: Real
    teeth: int
    start: float
    leave: float
    rpm: float
    depth: float = 1e-3
    ktc: float = 600e6
    krc: float = 0.3
    feed: float = 0.1e-3
    runout: float = 0.0
    drift: float = 0.0
    uneven: float = 0.0
    seed: int = 0

    @property
    def process(self) -> MillingProcess:
        """The same cut in the project's words."""
        return MillingProcess(
            self.teeth, 0.02, pi / 2, self.ktc, self.krc, 0.0, self.start, self.leave, self.feed, runout=self.runout
        )

    @property
    def model(self) -> ModalModel:
        """The same structure in the project's words."""
        natural = 2 * pi * self.frequencies
        damped = natural * np.sqrt(1 - self.damping**2)
        residues = natural**2 / self.stiffnesses / (2j * damped)
        names = ("TCP:+X", "TCP:+Y")
        poles = -self.damping * natural + 1j * damped
        return ModalModel(poles, self.directions * residues[:, None], self.directions + 0j, names, names)


@dataclass(frozen=True)
class Motion:
    """Samples of acceleration (m/s^2) in x and y, and what the last 20 turns say without any filter or noise.

    ``unrepeated`` is the size of what differs from turn to turn, ``alternating`` of what changes its sign from tooth to
    tooth (even numbers of teeth), both over the size of the motion.
    """

    acceleration: Real
    unrepeated: float
    alternating: float


def simulate(cut: SimulatedCut, tooth_periods: int, rate: float, *, steps: int = 500, skip: int = 0) -> Motion:
    """Mill from rest for a number of tooth periods; record behind an anti-aliasing filter from ``skip`` periods on."""
    n = tooth_periods * steps
    entry = np.minimum(1.0, np.arange(n) / (12 * steps))
    history, times = _marched(cut, entry * cut.depth, steps)
    samples = _sampled(history, times, times[skip * steps], rate)
    return Motion(samples, *_repeats(history, cut.teeth, steps))


@dataclass(frozen=True)
class StreamedMotion:
    """Acceleration (m/s^2) in x and y at a varying depth, and from turn to turn the share of it that differs."""

    acceleration: Real
    turn_ends: Real  # s
    unrepeated: Real


def simulate_depths(cut: SimulatedCut, depths: Real, rate: float, *, steps: int) -> StreamedMotion:
    """Mill with a depth (m) that is given at each of ``steps`` a tooth period."""
    history, times = _marched(cut, depths, steps)
    turn = cut.teeth * steps
    turns = history[: len(history) // turn * turn].reshape(-1, turn, 2)
    size = np.sqrt((turns**2).mean(axis=(1, 2)))
    change = np.sqrt((np.diff(turns, axis=0) ** 2).mean(axis=(1, 2)) / 2)
    ends = times[turn - 1 :: turn][1 : len(turns)]
    return StreamedMotion(_sampled(history, times, 0.0, rate), ends, change / np.maximum(size[1:], 1e-300))


def _marched(cut: SimulatedCut, depths: Real, steps: int) -> tuple[Real, Real]:
    """Return the acceleration at each step, (n, 2), and the times."""
    n = len(depths)
    tooth_periods = n // steps
    pitch = 2 * pi / cut.teeth
    along = (np.arange(n) + 0.5) / n
    times = np.cumsum(pitch / steps / (cut.rpm * pi / 30 * (1 + cut.drift * (along - 0.5))))
    factors = 1 + cut.uneven * np.random.default_rng([cut.seed, 7]).standard_normal((tooth_periods + 1) * cut.teeth)
    history = _march(
        np.diff(times, prepend=0.0),
        depths,
        2 * pi * cut.frequencies,
        cut.damping,
        cut.stiffnesses,
        np.ascontiguousarray(cut.directions),
        (cut.start, cut.leave, cut.ktc, cut.krc, cut.feed),
        cut.runout * np.cos(pitch * np.arange(cut.teeth)),
        factors,
        steps,
    )
    return history, times


def _sampled(history: Real, times: Real, begin: float, rate: float) -> Real:
    """Record behind an anti-aliasing filter from the time ``begin`` on."""
    fold = max(1, int(1 / rate / np.diff(times).max()))
    even = np.arange(begin, times[-1], 1 / (rate * fold))
    fine = np.column_stack([np.interp(even, times, history[:, column]) for column in range(2)])
    return np.asarray(decimate(fine, fold, ftype="fir", axis=0) if fold > 1 else fine)


def _repeats(history: Real, teeth: int, steps: int) -> tuple[float, float]:
    turns = history[-20 * teeth * steps :].reshape(20, teeth, steps, 2)
    mean = turns.mean(axis=0)
    size = (turns - turns.mean(axis=(0, 1, 2))).std()
    signs = np.where(np.arange(teeth) % 2, -1.0, 1.0)[:, None, None] if teeth % 2 == 0 else np.zeros((teeth, 1, 1))
    return float((turns - mean).std() / size), float(np.sqrt(((mean * signs).mean(axis=0) ** 2).mean()) / size)


@njit(cache=False)
def _march(steps, depths, natural, damping, stiffness, directions, law, offsets, factors, per_tooth):  # type: ignore
    n, modes = len(steps), len(natural)
    surface = np.zeros(len(offsets) * per_tooth)  # by angle of the immersion, all of the turn
    q, v = np.zeros(modes), np.zeros(modes)
    history = np.zeros((n, 2))
    force_x = force_y = last_x = last_y = 0.0
    for i in range(n):
        push_x, push_y = 1.5 * force_x - 0.5 * last_x, 1.5 * force_y - 0.5 * last_y
        last_x, last_y = force_x, force_y
        x = y = 0.0
        for r in range(modes):
            w, z = natural[r], damping[r]
            d = w * np.sqrt(1 - z * z)
            rest = (directions[r, 0] * push_x + directions[r, 1] * push_y) / stiffness[r]
            turned = np.exp((1j * d - z * w) * steps[i])
            c, s = turned.real, turned.imag
            a = q[r] - rest
            b = (v[r] + z * w * a) / d
            q[r] = rest + a * c + b * s
            v[r] = (b * d - z * w * a) * c - (a * d + z * w * b) * s
            x += directions[r, 0] * q[r]
            y += directions[r, 1] * q[r]
        force_x, force_y = _cut(i, x, y, depths[i], law, offsets, factors, surface)
        for r in range(modes):
            w = natural[r]
            along = directions[r, 0] * force_x + directions[r, 1] * force_y
            change = w * w * (along / stiffness[r] - q[r]) - 2 * damping[r] * w * v[r]
            history[i, 0] += directions[r, 0] * change
            history[i, 1] += directions[r, 1] * change
    return history


@njit(cache=False)
def _cut(i, x, y, depth, law, offsets, factors, surface):  # type: ignore
    start, leave, ktc, krc, feed = law
    teeth, places = len(offsets), len(surface)
    force_x = force_y = 0.0
    for j in range(teeth):
        passed = i + j * (places // teeth)
        place = passed % places
        phi = 2 * np.pi * (place + 0.5) / places
        if phi < start or phi > leave:
            surface[place] = 0.0
            continue
        reach = x * np.sin(phi) + y * np.cos(phi) + offsets[j]
        chip = reach - surface[place] + feed * np.sin(phi)
        if chip > 0:
            surface[place] = reach
            tangential = factors[(passed // places * teeth + j) % len(factors)] * ktc * depth * chip
            force_x -= tangential * (np.cos(phi) + krc * np.sin(phi))
            force_y -= tangential * (krc * np.cos(phi) - np.sin(phi))
        else:
            surface[place] -= feed * np.sin(phi)
    return force_x, force_y
