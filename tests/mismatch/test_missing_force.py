"""The missing force of a joint whose law an independent integration conceals: where it acts, its course, its law."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from concealed_recordings import RATE, Concealed, forces, linear_acceleration, structure, trial
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.mismatch import (
    Hypothesis,
    JointPhysics,
    LabError,
    ModelShape,
    Settings,
    StructureDiagnosis,
    fit,
    library,
    missing_force_law,
)
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.physics.protocol import reported_name
from millfrf.mismatch.records.bands import compared_band, compared_lines
from millfrf.mismatch.screening.missing_force import MissingForce, missing_force
from millfrf.reports.diagnoses.answers import missing_force_in_words
from millfrf.reports.diagnoses.structure_page import missing_force_section
from modal_fit import ModalModel

Real = NDArray[np.float64]
DIRECTION = np.array([0.8, 0.6])
LAWS = [cause for cause in library().values() if isinstance(cause, JointPhysics)]

CONCEALED: dict[str, Callable[[float, float], float]] = {
    "stiffness_hardening": lambda x, v: 1.5e9 * x**3,
    "coulomb_friction": lambda x, v: 12.0 * float(np.tanh(v / 1e-3)),
    "backlash": lambda x, v: -3e4 * float(np.clip(x, -5e-4, 5e-4)),
}


def _nominal() -> ModalModel:
    """The structure as a laboratory would believe it: a frequency 1 % off, a damping ratio 10 %."""
    model = structure()
    return replace(model, poles=model.poles * np.array([1.01, 0.99]) + np.array([0.1, -0.2]) * model.poles.real)


def _lines(model: ModalModel, accelerations: list[Real], driven: list[Real]) -> list[WindowedSpectrum]:
    rng = np.random.default_rng(11)
    decay = float((-model.poles.real).min())
    recordings = [
        trial(f"level {k}", force, seen, rng) for k, (force, seen) in enumerate(zip(driven, accelerations, strict=True))
    ]
    return [compared_lines(each, compared_band(model, RATE, None), decay)[0] for each in recordings]


def _driven() -> list[Real]:
    rng = np.random.default_rng(5)
    return [forces(rng, level, 24.0) for level in (15.0, 40.0)]


def _found(lines: list[WindowedSpectrum]) -> tuple[MissingForce, Fit]:
    shape = ModelShape(_nominal(), LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=30)
    result = missing_force(lines, base, LAWS, Settings().screening)
    assert result is not None
    return result, base


def _beyond_linear(signal: Real, x: Real, v: Real) -> Real:
    linear = np.column_stack([x / x.std(), v / v.std()])
    return np.asarray(signal - linear @ np.linalg.lstsq(linear, signal, rcond=None)[0])


def _in_band(signal: Real, lines: WindowedSpectrum, integrals: int = 0) -> Real:
    """The signal in the compared band, integrated over time."""
    axis = np.fft.rfftfreq(len(signal), 1 / RATE)
    inside = (axis >= lines.frequencies[0]) & (axis <= lines.frequencies[-1])
    factor = np.divide(1.0, (2j * np.pi * axis) ** integrals, out=np.zeros(len(axis), complex), where=inside)
    return np.asarray(np.fft.irfft(np.fft.rfft(signal) * factor, n=len(signal)))


@pytest.fixture(scope="module", params=list(CONCEALED))
def concealed(request: pytest.FixtureRequest) -> tuple[str, MissingForce, Fit, list[WindowedSpectrum], list[Real]]:
    driven, law = _driven(), Concealed(CONCEALED[request.param], DIRECTION)
    accelerations = [law.acceleration(structure(), force) for force in driven]
    lines = _lines(_nominal(), accelerations, driven)
    return request.param, *_found(lines), lines, accelerations


def test_place_and_law_are_found_before_any_law_is_fitted(
    concealed: tuple[str, MissingForce, Fit, list[WindowedSpectrum], list[Real]],
) -> None:
    name, result, base, _, _ = concealed
    assert result.significant
    direction, errors, off_tip = result.refit.direction()
    assert abs(direction @ DIRECTION) > np.cos(np.radians(3.0))
    assert np.linalg.norm(errors) < np.radians(3.0)
    assert off_tip < 0.05
    assert reported_name(result.screened[0].causes[0].physics) == name
    assert result.law_known
    assert result.refit.rest < 1.3
    # an ordinary refit bends the modes to describe a part of the force
    assert result.refit.moved < base.deviation


def test_force_is_that_of_the_concealed_law(
    concealed: tuple[str, MissingForce, Fit, list[WindowedSpectrum], list[Real]],
) -> None:
    """Its course in the band is that of the law under the true motion, up to a spring and a damper."""
    name, result, _, lines, accelerations = concealed
    recording, motion, seen = lines[-1], result.motions[-1], accelerations[-1] @ DIRECTION
    x, v = _in_band(seen, recording, 2), _in_band(seen, recording, 1)
    true = np.array([CONCEALED[name](float(a), float(b)) for a, b in zip(x, v, strict=True)])
    middle = slice(len(x) // 5, -len(x) // 10)
    true, estimated = (
        _beyond_linear(_in_band(force, recording)[middle], x[middle], v[middle]) for force in (true, motion.force)
    )
    # deflection and force of the joint have an arbitrary common factor, which leaves their power unchanged
    scale = float(motion.deflection[middle] @ x[middle]) / float(x[middle] @ x[middle])
    estimated = estimated * scale
    assert np.corrcoef(estimated, true)[0, 1] > 0.85
    assert 0.8 < np.std(estimated) / np.std(true) < 1.2
    assert np.std(estimated - true) < 0.5 * np.std(true)


def test_force_follows_what_the_law_depends_on(
    concealed: tuple[str, MissingForce, Fit, list[WindowedSpectrum], list[Real]],
) -> None:
    name, result, _, _, _ = concealed
    families = {kind: share for kind, share in result.followed.items() if kind != "all"}
    expected = {"stiffness_hardening": "deflection", "coulomb_friction": "velocity", "backlash": "deflection"}[name]
    assert max(families, key=lambda kind: families[kind]) == expected


def _diagnosed(found: MissingForce, hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> StructureDiagnosis:
    """The parts of a diagnosis from which the force is drawn and described."""
    details = SimpleNamespace(missing=found, final=SimpleNamespace(hypothesis=hypothesis), recordings=lines)
    return cast(StructureDiagnosis, SimpleNamespace(details=details, content={"missing_force": found.content()}))


def test_drawn_force_is_passed_by_the_law(
    concealed: tuple[str, MissingForce, Fit, list[WindowedSpectrum], list[Real]],
) -> None:
    name, result, _, lines, _ = concealed
    law = replace(result.screened[0].causes[0], seen=None)
    diagnosis = _diagnosed(result, result.refit.hypothesis.with_cause(law), lines)
    drawn = missing_force_law(diagnosis)
    assert drawn is not None
    assert drawn.name == name
    assert drawn.explained > 0.8
    for bins in (drawn.forward, drawn.backward):
        assert np.std(bins.force - bins.law) < 0.4 * np.std(bins.force)
    rising, falling = (np.interp(0.0, bins.at, bins.force) for bins in (drawn.forward, drawn.backward))
    spread = np.hypot(drawn.forward.error.max(), drawn.backward.error.max())
    assert (rising - falling > 2 * spread) == (name == "coulomb_friction")
    assert len(missing_force_section(diagnosis).pictures) == 1
    assert "Before any law: one joint, nearly along +0." in missing_force_in_words(diagnosis)[0]


def test_force_is_drawn_without_a_law(
    concealed: tuple[str, MissingForce, Fit, list[WindowedSpectrum], list[Real]],
) -> None:
    _, result, base, lines, _ = concealed
    diagnosis = _diagnosed(result, base.hypothesis, lines)
    drawn = missing_force_law(diagnosis)
    assert drawn is not None
    assert drawn.name == ""
    assert np.isfinite(drawn.forward.force).all()
    assert not np.isfinite(drawn.forward.law).any()
    assert "Lines" not in missing_force_section(diagnosis).pictures[0].caption


def test_without_a_force_none_is_found() -> None:
    driven = _driven()
    lines = _lines(_nominal(), [linear_acceleration(structure(), force) for force in driven], driven)
    result, base = _found(lines)
    assert not result.significant
    assert not result.law_known
    diagnosis = _diagnosed(result, base.hypothesis, lines)
    assert missing_force_law(diagnosis) is None
    assert missing_force_section(diagnosis).empty
    assert missing_force_in_words(diagnosis) == ("Before any law: refitted modes leave no force of a joint.",)


def test_force_without_a_law_of_the_library_is_shown_but_not_explained() -> None:
    """A force that alternates over every 0.1 mm, as of cogging, follows no function that the library has."""
    driven, law = _driven(), Concealed(lambda x, v: 15.0 * float(np.sin(x / 3e-5)), DIRECTION)
    result, _ = _found(_lines(_nominal(), [law.acceleration(structure(), force) for force in driven], driven))
    assert result.significant
    assert abs(result.refit.direction()[0] @ DIRECTION) > np.cos(np.radians(6.0))
    assert not result.law_known


def test_a_single_response_leaves_nothing_to_fit() -> None:
    driven = _driven()
    lines = _lines(_nominal(), [linear_acceleration(structure(), force) for force in driven], driven)
    shape = ModelShape(_nominal(), LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=2)
    single = [replace(each, measured=each.measured[:, :1]) for each in lines]
    assert missing_force(single, base, LAWS, Settings().screening) is None
