"""Random cutters of all shapes in random cuts of random structures, as a process and as discs of the simulation."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sliced_mill import STEPS, Cut, Discs, Real, Structure, cylinder_discs, grows

from millfrf.cutting import MillingProcess, ProfileElement, bull_nose_profile, straight_profile
from millfrf.stability import certified_numerics
from modal_fit import ModalModel

DIAMETER, DEEPEST = 0.012, 6e-3
LABELS = ("T:+X", "T:+Y", "T:+Z")
KINDS = ("square", "square", "ball", "bull", "serrated", "taper", "damped")


@dataclass(frozen=True)
class RandomCutter:
    """A cut of a random structure at a speed (rad/s), and its discs at a depth."""

    process: MillingProcess
    structure: Structure
    speed: float
    discs: Callable[[float], Discs]


def cut_of(process: MillingProcess) -> Cut:
    """Return the cut of a process for the simulation; the workpiece is far away where it does not end."""
    half = process.diameter / 2
    low = -10 * half if process.exit_angle > math.pi - 1e-9 else half * math.cos(process.exit_angle)
    high = 10 * half if process.start_angle < 1e-9 else half * math.cos(process.start_angle)
    pressures = (process.ktc * np.array([1.0, process.krc, process.kac])).tolist()
    law = process.chip_law
    return Cut(
        *pressures, process.feed_per_tooth * process.teeth, low, high, process.process_damping,
        law.exponents, law.reference, law.edge_radius,
    )  # fmt: skip


def _two_modes() -> Structure:
    poles, right, left = [], [], []
    for frequency, shape in ((410.0, [1.0, 0.15, 0.1]), (530.0, [-0.1, 1.0, 0.2])):
        omega, damping, mass = 2 * math.pi * frequency, 0.03, 0.25
        poles.append(omega * (-damping + 1j * math.sqrt(1 - damping**2)))
        right.append(np.array(shape) / (2j * poles[-1].imag * mass))
        left.append(np.array(shape) + 0j)
    return Structure(np.array(poles), np.array(right), np.array(left))


TWO_MODES = _two_modes()
"""A structure whose modes stand askew to the axes of the cut."""


def modal_model(structure: Structure) -> ModalModel:
    """Return the structure of the simulation as a modal model."""
    return ModalModel(structure.poles, structure.right, structure.left, LABELS, LABELS)


def judge_limit(drawn: RandomCutter, steps: int = STEPS) -> None:
    """Assert that the simulation decays below the limit of a random cut and grows above it."""
    process, structure = drawn.process, drawn.structure
    lobes = certified_numerics(modal_model(structure), process, np.array([drawn.speed]), DEEPEST)
    [limit], [status] = lobes.depth_limits, lobes.status
    assert status in ("verified", "lower-bound")
    depths = np.array([0.33, 0.67, 1.0]) * DEEPEST if np.isinf(limit) else np.array([0.98, 1.02]) * limit
    growth = [grows(drawn.discs(depth), cut_of(process), structure, drawn.speed, steps) for depth in depths]
    if np.isinf(limit):
        assert max(growth) < 0
    else:
        assert growth[0] < 0
        assert status == "lower-bound" or growth[1] > 0, (limit, growth)


def random_cutter(seed: int) -> RandomCutter:
    """Two to eight teeth, 2 to 100 % of the diameter, helix to 50 deg, pitch, runout; 0.12 to 1.5 teeth a period."""
    rng = np.random.default_rng([77, seed])
    structure, lowest = _random_structure(rng)
    teeth, kind = int(rng.integers(2, 9)), str(rng.choice(KINDS))
    corner = {"ball": DIAMETER / 2, "bull": float(rng.uniform(1e-3, 4e-3))}.get(kind, 0.0)
    width = math.acos(1 - 2 * float(np.exp(rng.uniform(np.log(0.02), 0))))
    start = 0.0 if rng.random() < 0.5 else math.pi - width
    helices = np.full(teeth, float(rng.choice([0.0, rng.uniform(0.1, 0.87)])))
    if rng.random() < 0.3:
        helices = helices + np.radians(rng.uniform(0, 4, teeth))
    pitches = np.full(teeth, 2 * math.pi / teeth)
    if rng.random() < 0.3:
        shift = rng.uniform(-0.1, 0.1, teeth) * pitches
        pitches = pitches + shift - shift.mean()
    runout = float(rng.choice([0.0, 0.0, 3e-5, 1e-4])) if kind != "serrated" else 0.0
    wave = (float(rng.uniform(1e-4, 4e-4)), float(rng.uniform(1e-3, 3e-3))) if kind == "serrated" else (0.0, 0.0)
    taper = float(rng.uniform(0.5, 1.2))
    tangential = float(np.exp(rng.uniform(np.log(5e8), np.log(2.5e9))))
    damping = float(rng.uniform(5e3, 5e4)) if kind == "damped" else 0.0
    radial, axial, feed = float(rng.uniform(0.1, 0.6)), float(rng.uniform(0, 0.3)), float(rng.uniform(3e-5, 1.5e-4))
    process = MillingProcess(
        teeth, DIAMETER, math.pi / 2, tangential, radial, axial, start, start + width, feed,
        helix_angles=tuple(helices.tolist()), pitch_angles=tuple(pitches.tolist()), runout=runout,
        profile=_profile(corner, taper, kind), process_damping=damping,
        serration_amplitude=wave[0], serration_wavelength=wave[1],
    )  # fmt: skip
    angles = np.concatenate([[0.0], np.cumsum(pitches)[:-1]])
    shifts = 2 * math.pi * np.arange(teeth)[:, None] / teeth

    def discs(depth: float) -> Discs:
        count = int(64 * max(1, depth / wave[1])) if wave[1] else 240 if corner else 40
        discs = cylinder_discs(depth, DIAMETER, angles, helices, corner=corner, count=count)
        if kind == "taper":
            discs = _tapered(discs, taper, depth)
        if wave[1]:
            discs.offset[:] = wave[0] * np.cos(2 * math.pi * _middles(depth, count) / wave[1] + shifts)
        if process.runout_decides:
            discs.offset[:] += runout * np.cos(shifts)
        return discs

    rpm = 60 * lowest / teeth * float(np.exp(rng.uniform(np.log(0.12), np.log(1.5))))
    return RandomCutter(process, structure, rpm * math.pi / 30, discs)


def _profile(corner: float, edge_angle: float, kind: str) -> tuple[ProfileElement, ...]:
    if kind == "taper":
        return straight_profile(DIAMETER, edge_angle)
    return bull_nose_profile(DIAMETER, corner) if corner else ()


def _middles(depth: float, count: int) -> Real:
    return np.asarray((np.arange(count) + 0.5) * depth / count)


def _tapered(plain: Discs, edge_angle: float, depth: float) -> Discs:
    """Return the discs of straight edges at an angle (rad) to the plane of rotation; their lag is that of the tip."""
    count = len(plain.width)
    radius = DIAMETER / 2 + _middles(depth, count) / math.tan(edge_angle)
    width = plain.width / math.sin(edge_angle)
    return Discs(radius, np.full(count, edge_angle), width, plain.angle, plain.offset)


def _random_structure(rng: np.random.Generator) -> tuple[Structure, float]:
    """One to three modes of any direction, and the lowest frequency (Hz)."""
    count, lowest = int(rng.integers(1, 4)), float(np.exp(rng.uniform(np.log(150), np.log(1200))))
    frequencies = lowest * np.concatenate([[1.0], rng.uniform(1.05, 2.5, count - 1)])
    poles, right, left = [], [], []
    for frequency in frequencies:
        omega, damping, mass = 2 * math.pi * frequency, rng.uniform(0.01, 0.05), 0.25 * np.exp(rng.uniform(-0.7, 0.7))
        shape = rng.normal(size=3) * np.array([1.0, 1.0, 0.4])
        shape /= np.linalg.norm(shape)
        poles.append(omega * (-damping + 1j * math.sqrt(1 - damping**2)))
        right.append(shape / (2j * poles[-1].imag * mass))
        left.append(shape + 0j)
    return Structure(np.array(poles), np.array(right), np.array(left)), lowest
