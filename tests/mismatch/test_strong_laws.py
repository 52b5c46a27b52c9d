"""One mode with a cubic spring of 4 to 78 % of its stiffness: an honest answer, and never an internal exception."""

from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Real, Rig

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, diagnose, fit, library
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.records.reading import band_of

LEVELS = (20.0, 40.0, 60.0)


def swept(rig: Rig, level: float, phase: float) -> Real:
    """A sine that sweeps from 4 to 20 Hz in 30 s."""
    time = np.arange(int(30 * rig.rate)) / rig.rate
    return np.asarray(level * np.sin(2 * np.pi * (4 * time + 16 / 30 * time**2 / 2) + phase))


def test_the_rig_is_what_it_says() -> None:
    """Without its cubic term, against the receptance."""
    rig = Rig(response="displacement")
    force = rig.forces(40.0, 20.0, 3)
    n = 2 * len(force)
    spectrum = rig.model.receptance(np.fft.rfftfreq(n, 1 / rig.rate))[:, 0, 0] * np.fft.rfft(force, n=n)
    wanted = np.fft.irfft(spectrum, n=n)[: len(force)]
    assert np.std(rig.motion(force)[0] - wanted) < 0.01 * np.std(wanted)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["random", "swept"])
@pytest.mark.parametrize("share", [0.04, 0.1, 0.3, 0.78])
def test_hardening_is_named_or_nothing_is(share: float, kind: str) -> None:
    rig = Rig(damping=0.05 if kind == "swept" else 0.03).stiffened(share, LEVELS[-1])
    if kind == "random":
        recordings = rig.recordings(LEVELS)
    else:
        recordings = [
            rig.recording(f"sweep_{k + 1}", swept(rig, level, float(k)), seed=k) for k, level in enumerate(LEVELS)
        ]
    diagnosis = diagnose(rig.model, recordings)
    assert {cause.name for cause in diagnosis.physics} <= {"stiffness_hardening"}
    assert diagnosis.verdict != "none"
    if share < 0.5:
        assert diagnosis.verdict == "explained"
        assert diagnosis.improvement.after < 0.1 * diagnosis.improvement.before


@pytest.mark.long
def test_lightly_damped_and_very_strong() -> None:
    """Free simulations run away here from some starts; whatever is said has the right name."""
    rig = Rig(damping=0.01, response="displacement").stiffened(0.78, LEVELS[-1])
    diagnosis = diagnose(rig.model, rig.recordings(LEVELS))
    assert {cause.name for cause in diagnosis.physics} <= {"stiffness_hardening"}


@pytest.fixture(scope="module")
def linear() -> BandRecording:
    return Rig().recordings((40.0,))[0]


def test_a_start_that_runs_away_is_a_hypothesis_that_is_not_taken(linear: BandRecording) -> None:
    """A spring that takes off three times the stiffness: the structure is unstable."""
    rig, physics = Rig(), library()["pose_drift"]
    lines = [windowed_spectrum(linear, band_of(rig.model, linear.rate), 1.0)]
    shape = ModelShape(rig.model, LabError())
    plain = Hypothesis(shape, np.zeros(shape.size))
    motion = JointMotion(1e-3, 0.06, 1e-2, 0.6, rig.stiffness)
    cause = Cause(physics, np.array([-6 * rig.stiffness, -1.0, 0.0]), "", JointAxis(np.ones(1)), motion)
    with np.errstate(all="ignore"):
        gone = fit(lines, plain.with_cause(cause), iterations=2)
    assert gone.score == np.inf
    assert fit(lines, plain, iterations=2).score < gone.score
    calm = replace(cause, values=np.array([1e-3, 0.0, 0.0]))
    assert np.isfinite(fit(lines, plain.with_cause(calm), iterations=2).score)
