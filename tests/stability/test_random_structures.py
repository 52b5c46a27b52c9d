"""Certified limits of random structures against Floquet multipliers that share no code with the solvers."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pytest
from independent_floquet import Mill, spectral_radius
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes
from modal_fit import ModalModel

Real = NDArray[np.float64]
LABELS = ("T:+X", "T:+Y", "T:+Z")
ALLOWED = 1e-3
"""Relative error of a limit that counts as right."""


@dataclass(frozen=True)
class Case:
    """One random structure in one random cut, at a random speed and at one near a resonance of the tooth passing."""

    model: ModalModel
    mill: Mill
    speeds: Real
    max_depth: float

    @property
    def process(self) -> MillingProcess:
        """The cut as the tool knows it."""
        m = self.mill
        return MillingProcess(
            m.teeth, 0.0127, m.edge_angle, m.pressure, m.radial, m.axial, m.entry, m.leave, feed_per_tooth=1e-4
        )

    def radius(self, speed: float, depth: float) -> float:
        """Largest modulus of a multiplier, by the independent computation."""
        return spectral_radius(self.model.poles, self.model.right, self.model.left, self.mill, speed, depth)


def _spread(rng: np.random.Generator, low: float, high: float, size: int | None = None) -> Real:
    return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high), size)))


def random_case(seed: int) -> Case:
    """1-8 modes, left vectors unlike right ones, two to six teeth, slot to a/D = 0.01, 200-20000 rpm."""
    rng = np.random.default_rng([15, seed])
    teeth, n_modes = int(rng.integers(2, 7)), int(rng.integers(1, 9))
    rpm = float(_spread(rng, 200, 20000))
    natural = rpm / 60 * teeth * float(_spread(rng, 0.15, 4)) * _spread(rng, 1, 4, n_modes)
    damping = _spread(rng, 0.005, 0.1, n_modes)
    poles = 2 * np.pi * natural * (-damping + 1j * np.sqrt(1 - damping**2))
    shapes, skew = rng.normal(size=(n_modes, 3)), float(rng.choice([0, 0.05, 0.3]))
    noise = rng.normal(size=(4, n_modes, 3))
    left, right = shapes + skew * (noise[0] + 1j * noise[1]), shapes + skew * (noise[2] + 1j * noise[3])
    right = right * (np.abs(poles) ** 2 / _spread(rng, 1e6, 2e7, n_modes) / (2j * poles.imag))[:, None]
    width = np.arccos(1 - 2 * (float(_spread(rng, 0.01, 1)) if rng.random() < 0.75 else 1.0))
    entry, leave = (0.0, width) if rng.random() < 0.5 else (np.pi - width, np.pi)
    mill = Mill(
        teeth,
        float(np.radians(rng.choice([90.0, 90.0, 60.0, 45.0]))),
        float(_spread(rng, 1e8, 2e9)),
        rng.uniform(0.1, 0.6),
        rng.uniform(0, 0.3),
        float(entry),
        float(leave),
    )
    # tooth passing near 2 f / (2 k + 1): where period doublings come in pairs
    resonant = 120 * rng.choice(natural) / (2 * rng.integers(0, 4) + 1) / teeth * rng.uniform(0.99, 1.01)
    speeds = np.array([rpm, resonant * 3 ** max(0.0, np.ceil(np.log(100 / resonant) / np.log(3)))]) * np.pi / 30
    gain = mill.pressure * (np.linalg.norm(right, axis=1) * np.linalg.norm(left, axis=1) / -poles.real).max()
    return Case(ModalModel(poles, right, left, LABELS, LABELS), mill, speeds, float(_spread(rng, 3, 3000)) / gain)


def judged(case: Case, rng: np.random.Generator, *, beneath: int) -> list[str]:
    """For each speed the status of its limit, or ``wrong: ...`` where the independent multipliers say otherwise."""
    lobes = certified_lobes(case.model, case.process, case.speeds, case.max_depth)
    verdicts = []
    for speed, limit, status in zip(case.speeds, lobes.depth_limits, lobes.status, strict=True):
        if status == "unresolved":
            assert np.isnan(limit)
            verdicts.append(status)
            continue
        top = (1 - ALLOWED) * min(float(limit), case.max_depth)
        unstable = [depth for depth in [top, *(top * rng.uniform(0, 1, beneath))] if case.radius(speed, depth) >= 1]
        above = np.linspace(1 + ALLOWED, 1 - ALLOWED, 21) * limit
        verdict = status
        if unstable:
            verdict = f"wrong: unstable at {min(unstable):.5g} m below the limit {limit:.5g} m at {speed:.6g} rad/s"
        elif status == "verified" and np.isfinite(limit) and not any(case.radius(speed, d) >= 1 for d in above):
            verdict = f"wrong: stable about the limit {limit:.5g} m at {speed:.6g} rad/s"
        verdicts.append(verdict)
    return verdicts


def count(seeds: range, beneath: int) -> tuple[Counter[str], list[str]]:
    """How many limits have which status, and what is wrong."""
    result = [
        (seed, verdict)
        for seed in seeds
        for verdict in judged(random_case(seed), np.random.default_rng([16, seed]), beneath=beneath)
    ]
    wrong = [f"structure {seed}: {verdict}" for seed, verdict in result if verdict.startswith("wrong")]
    return Counter(verdict for _, verdict in result), wrong


@pytest.mark.long
def test_limits_of_twenty_random_structures() -> None:
    counts, wrong = count(range(20), beneath=2)
    assert not wrong
    assert counts["verified"] == 40


@pytest.mark.slow
def test_limits_of_five_hundred_random_structures() -> None:
    """No limit is off by more than a thousandth; those that are not verified are fewer than one in a hundred."""
    counts, wrong = count(range(500), beneath=5)
    print(dict(counts))
    assert not wrong
    assert counts["verified"] > 0.99 * 1000


def test_the_independent_multipliers_know_a_free_structure_and_a_known_limit() -> None:
    """Without depth they are those of the poles; 1 at 0.35322 mm, the slot limit at 6000 rpm of the 1-DOF benchmark."""
    turn = 2 * np.pi * 922
    poles = np.array([turn * (-0.011 + 1j * np.sqrt(1 - 0.011**2))])
    right, left = np.array([[1 / (0.03993 * 2j * poles[0].imag), 0, 0]]), np.array([[1.0 + 0j, 0, 0]])
    mill, speed = Mill(2, np.pi / 2, 6e8, 1 / 3, 0.0, 0.0, np.pi), 6000 * np.pi / 30
    free = spectral_radius(poles, right, left, mill, speed, 0.0)
    assert free == pytest.approx(np.exp(poles[0].real * np.pi / speed), rel=1e-9)
    radii = [spectral_radius(poles, right, left, mill, speed, depth) for depth in (0.353215e-3, 0.353225e-3)]
    assert radii[0] < 1 < radii[1]
