"""A short cut of known truth: spectra of the computed force with white noise."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.mismatch.cut.hypothesis import Belief, CutHypothesis, MeasuredCut
from millfrf.mismatch.cut.motion import SpindleLaw, TipMotion
from millfrf.mismatch.cut.physics import cut_library
from millfrf.mismatch.cut.recordings import CutRecording, force_spectra

Real = NDArray[np.float64]

PROCESS = MillingProcess(2, 12e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
RATE, SECONDS = 2000.0, 3.25


def tip_motion(size: float = 5e-6) -> TipMotion:
    """Motion of the tip in X and Y that is no multiple of the spindle's turn."""
    times = np.arange(round(RATE * SECONDS))[:, None] / RATE
    waves, phases = 2 * np.pi * np.array([17.3, 23.9, 41.0]), np.array([0.3, 1.9, 4.0])
    weights = size * np.array([1.0, 0.7, 0.0])
    turned = waves * times + phases
    return TipMotion(weights * np.sin(turned), weights * waves * np.cos(turned), "measured")


def stated(deviations: Real | None = None, laws: int = 1, **numbers: list[float]) -> CutHypothesis:
    """The cutting file's numbers, or others of the causes that are named."""
    acting = tuple(
        (cause, np.array(numbers[name]) if name in numbers else cause.stated(PROCESS))
        for name, cause in cut_library().items()
    )
    law = SpindleLaw(SECONDS / 2, 0.4, 84.0)
    return CutHypothesis(np.zeros(6) if deviations is None else deviations, acting, (law,) * laws)


def small_cut(truth: CutHypothesis, noise: float = 0.5, seed: int = 0, error: float = 1e-6) -> MeasuredCut:
    """Recordings of a truth, with white noise of this standard deviation (N) in every spectral line."""
    rng, spectra = np.random.default_rng(seed), []
    for k, law in enumerate(truth.laws):
        force = np.zeros((round(RATE * SECONDS), 3))
        recording = CutRecording(f"cut{k}", RATE, force, (0, 1, 2), tip_motion(), law, 0.1)
        spectra.append(force_spectra(recording, PROCESS.teeth))
    silent = MeasuredCut(Belief(PROCESS), 1e-3, tuple(spectra), error)
    noisy = []
    for k, each in enumerate(spectra):
        both = rng.standard_normal((2, *each.measured.shape))
        drawn = noise / np.sqrt(2) * (both[0] + 1j * both[1])
        noisy.append(replace(each, measured=silent.predicted(k, truth) + drawn))
    return replace(silent, spectra=tuple(noisy)).with_noise_of(truth)
