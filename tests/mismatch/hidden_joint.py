"""One mode with a joint whose law is hidden, simulated by the tool itself: only forms of laws are judged on it."""

from dataclasses import replace

import numpy as np
from one_mode_rig import Real, Rig
from scipy.fft import irfft

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, JointPhysics, LabError, ModelShape, library, predict_lines
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.records.reading import band_of

RIG = Rig()
MOTION = JointMotion(1e-3, 0.06, 1e-2, 0.6, RIG.stiffness)


def law_of(name: str) -> JointPhysics:
    """A joint's law of the library."""
    result = library()[name]
    assert isinstance(result, JointPhysics)
    return result


def at_the_joint(physics: JointPhysics, values: Real) -> Cause:
    """A law with its numbers, at the only axis of the rig."""
    return Cause(physics, values, "", JointAxis(np.ones(1)), MOTION)


def with_law(physics: JointPhysics, values: Real) -> Hypothesis:
    """The rig with a law, its modes as the lab believes them."""
    shape = ModelShape(RIG.model, LabError())
    return Hypothesis(shape, np.zeros(shape.size)).with_cause(at_the_joint(physics, values))


def recorded(hidden: JointPhysics, levels: tuple[float, ...]) -> list[WindowedSpectrum]:
    """One recording a level of the rig with a hidden law, 1 % noise."""
    return moved_by(with_law(hidden, np.zeros(0)), levels)


def moved_by(truth: Hypothesis, levels: tuple[float, ...]) -> list[WindowedSpectrum]:
    """One recording a level of the rig as a hypothesis moves it, 1 % noise."""
    band, shown = band_of(RIG.model, RIG.rate), []
    for seed, each in enumerate(RIG.recordings(levels)):
        lines = windowed_spectrum(each, band, 1.0)
        moved = irfft(predict_lines(truth, lines).spectrum, n=lines.padded, axis=0)[: len(each.force)]
        moved += 0.01 * moved.std() * np.random.default_rng(2000 + seed).normal(size=moved.shape)
        shown.append(windowed_spectrum(replace(each, response=moved), band, 1.0))
    return shown
