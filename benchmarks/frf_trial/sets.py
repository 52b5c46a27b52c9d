"""`draw_set`: one simulated set from a seed and a number, and the truth about it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .noise import KINDS, TOLD, Noise, draw_noise
from .observable import visibility
from .problem import DERIVATIVES, Problem
from .shapes import Layout, draw_layout, draw_shapes
from .spectrum import MAX_LINES, Spectrum, draw_spectrum
from .structure import Structure, assurance, poles_of

GENERATOR = 3
"""Version of the draw: results of another one are not mixed with these."""
MAX_VALUES = 2_500_000
"""Lines x responses x excitations of a set."""


@dataclass(frozen=True)
class SimulatedSet:
    """What the engine is given, and the truth (JSON) by which it is judged."""

    problem: Problem
    truth: dict[str, Any]


def draw_set(seed: int, number: int) -> SimulatedSet:
    """The same set for the same arguments.

    Quantities and what is told of the noise take turns with ``number``; all else is drawn.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
    layout = draw_layout(rng)
    entries = layout.n_points * len(layout.references)
    spectrum = draw_spectrum(rng, int(rng.integers(2, 16)), min(MAX_LINES, MAX_VALUES // entries))
    structure = _structure(rng, layout, spectrum)
    quantity = ("accelerance", "receptance")[number % 2] if number % 10 != 9 else "mobility"
    frequencies = spectrum.step * np.arange(1, int(spectrum.top / spectrum.step) + 1)
    clean = structure.frf(frequencies, DERIVATIVES[quantity])
    within = np.asarray((frequencies >= spectrum.band[0]) & (frequencies <= spectrum.band[1]))
    level, kind = float(np.exp(rng.uniform(np.log(0.005), np.log(0.05)))), str(rng.choice(KINDS))
    noise = draw_noise(rng, clean, within, level, kind, TOLD[number // 2 % len(TOLD)])
    points, references = layout.labels
    responses, excitations = (references, points) if layout.roving_hammer else (points, references)
    measured = clean + noise.sample(rng)
    coherence, averages = noise.coherence(rng, measured), None
    if noise.averages is not None:
        averages = np.full(clean.shape[1:], 0 if "unknown" in noise.told else noise.averages)
    axes = (frequencies, measured, quantity, spectrum.band, responses, excitations)
    problem = Problem(*axes, noise.response, noise.excitation, coherence, averages)
    setting = {"seed": seed, "number": number, "quantity": quantity, "noise": level, "noise_of": kind}
    return SimulatedSet(problem, {**setting, **_truth(structure, spectrum, problem, noise)})


def _structure(rng: np.random.Generator, layout: Layout, spectrum: Spectrum) -> Structure:
    """Modes with vectors; two sets of five hang free and have a mass line."""
    n_modes = len(spectrum.frequencies)
    points, references = draw_shapes(rng, layout, n_modes, spectrum.n_far)
    right, left = (references, points) if layout.roving_hammer else (points, references)
    rigid = np.zeros((right.shape[1], left.shape[1]))
    if rng.random() < 0.4:
        rigid = np.outer(rng.uniform(0.5, 1.5, len(rigid)), rng.uniform(0.5, 1.5, rigid.shape[1]))
    return Structure(poles_of(spectrum.frequencies, spectrum.dampings), right, left, rigid)


def _truth(structure: Structure, spectrum: Spectrum, problem: Problem, noise: Noise) -> dict[str, Any]:
    """Everything by which an answer is judged, as plain values."""
    modes = []
    close = {index for pair in spectrum.pairs for index in (pair, pair + 1)}
    derivative, inside = DERIVATIVES[problem.quantity], problem.inside()
    for k in range(len(structure.poles)):
        mode: dict[str, Any] = {"frequency_hz": float(structure.frequencies[k])}
        mode |= {"damping_ratio": float(structure.dampings[k]), "in_band": bool(spectrum.inside[k]), "demanded": False}
        if spectrum.inside[k]:
            seen = visibility(structure, k, problem.frequencies, inside, noise.variance, derivative)
            mode |= {"demanded": seen.demanded, "energy": seen.energy, "peak": seen.peak, "in_pair": k in close}
            mode["shape"] = [[float(x.real), float(x.imag)] for x in structure.right[k]]
        modes.append(mode)
    narrowest = float(structure.bandwidths[spectrum.inside].min())
    return {
        "generator": GENERATOR,
        "band": list(spectrum.band),
        "told": noise.told,
        "n_lines": int(inside.sum()),
        "n_responses": len(problem.responses),
        "n_excitations": len(problem.excitations),
        "lines_per_bandwidth": narrowest / spectrum.step,
        "pairs": [_pair(structure, k) for k in spectrum.pairs],
        "modes": modes,
    }


def _pair(structure: Structure, lower: int) -> dict[str, float]:
    """Separation over the mean half-power bandwidth, and assurance of the vectors of a close pair."""
    f, widths = structure.frequencies, structure.bandwidths
    return {
        "frequency_hz": float(f[lower]),
        "separation": float((f[lower + 1] - f[lower]) / (0.5 * (widths[lower] + widths[lower + 1]))),
        "right_assurance": assurance(structure.right[lower], structure.right[lower + 1]),
        "left_assurance": assurance(structure.left[lower], structure.left[lower + 1]),
    }
