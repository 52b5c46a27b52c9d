"""A law and its twin differ by a linear spring: the one that leaves the lab's modes as they are is found and told."""

from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Real, Rig
from scipy.fft import irfft

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, fit, library, predict_lines
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.screening.joint_starts import twin_laws

LEVELS = (20.0, 40.0)


def _with_play(rig: Rig) -> tuple[list[WindowedSpectrum], Hypothesis]:
    """Two recordings of a rig with soft play, and what made them."""
    lines = [windowed_spectrum(each, band_of(rig.model, each.rate), 1.0) for each in rig.recordings(LEVELS)]
    shape = ModelShape(rig.model, LabError())
    motion = JointMotion(1e-3, 0.06, 1e-2, 0.6, rig.stiffness)
    values = np.array([0.2 * rig.stiffness, 5e-4, 2.5])
    truth = Hypothesis(shape, np.zeros(shape.size)).with_cause(_cause("smooth_backlash", values, motion))
    shown = []
    for seed, each in enumerate(lines):
        n = len(each.recording.force)
        moved = irfft(predict_lines(truth, each).spectrum, n=each.padded, axis=0)[:n]
        moved += 0.01 * moved.std() * np.random.default_rng(seed).normal(size=moved.shape)
        shown.append(windowed_spectrum(replace(each.recording, response=moved), band_of(rig.model, 128.0), 1.0))
    return shown, truth


def _cause(name: str, values: Real, motion: JointMotion) -> Cause:
    return Cause(library()[name], values, "", JointAxis(np.ones(1)), motion)


def test_the_twin_with_the_labs_modes_is_found() -> None:
    rig = Rig()
    lines, truth = _with_play(rig)
    last = truth.causes[-1]
    assert last.motion is not None
    plain = Hypothesis(truth.shape, np.zeros(truth.shape.size))
    base = fit(lines, plain, iterations=15)
    start = plain.with_cause(_cause("saturating_hardening", last.values, last.motion))
    wrong = fit(lines, start, iterations=30)
    proposal = Proposal[Fit]("stiffness_hardening", {}, wrong, base.score - wrong.score)
    (twin,) = twin_laws(lines, base, [proposal], library())
    assert twin.name == "backlash"
    assert twin.evidence > proposal.evidence + 20
    assert twin.fitted.hypothesis.causes[-1].values[0] == pytest.approx(last.values[0], rel=0.1)
    assert twin.fitted.deviation < 0.1 * wrong.deviation
    both = [proposal, twin]
    assert twin_laws(lines, base, both, library()) == []
    assert twin_laws(lines, base, [proposal], {}) == []
