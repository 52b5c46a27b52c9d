"""A model can be given one more mode, and be left without it again; one that took its place gives it back."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, Settings, fit, library
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.inference.settings import ScreeningSettings
from millfrf.mismatch.models.fitting import Fit, modes_are_implausible
from millfrf.mismatch.physics.linear_causes import MissingMode
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.screening.linear_causes_fitted import find_mode, linear_candidates
from millfrf.mismatch.screening.whitened_residual import noise_floor
from millfrf.mismatch.structure.acceptance import impossible, is_significant, lost_mode, modes_outside_band
from millfrf.mismatch.structure.reported_causes import reported_causes_of
from modal_fit import ModalModel, ModeErrors

from .one_mode_rig import Rig


def test_a_further_mode_beside_a_model_that_states_its_errors() -> None:
    single = np.full((1, 2), 1e-3)
    model = replace(Rig().model, errors=ModeErrors(single, single, single, single))
    more = ModelShape(model, Settings().lab).with_mode(-1 + 90j, np.ones(1, complex), np.ones(1, complex))
    assert len(more.nominal.poles) == 2
    again, _ = more.without_mode(0, np.zeros(more.size))
    assert len(again.nominal.poles) == 1
    assert len(more.bare.nominal.poles) == 1


def test_a_mode_whose_place_a_labs_mode_has_taken_is_found_there(
    small_model: ModalModel, trial_of: Callable[[ModalModel, str, float, int], BandRecording]
) -> None:
    """The lab's mode at 14 Hz is refitted to a resonance at 17 Hz that it lacks: what is left then lies at 14 Hz."""
    pole = 2 * np.pi * 17.0 * (-0.02 + 1j)
    right, left = 3.0 * np.array([-0.3, 1.0]) / (2j * pole.imag * 40.0), np.array([-0.3, 1.0]) + 0j
    truth = ModelShape(small_model, LabError()).with_mode(pole, right, left).nominal
    trials = [trial_of(truth, name, level, k) for k, (name, level) in enumerate((("low", 20.0), ("high", 60.0)))]
    lines = [windowed_spectrum(each, band_of(truth, each.rate), 1.0) for each in trials]
    shape = ModelShape(small_model, LabError())
    u = np.zeros(shape.size)
    u[shape.per_mode] = (17.0 / 14.0 - 1) / LabError().frequency
    taken = fit(lines, Hypothesis(shape, u), iterations=30)
    assert taken.hypothesis.model.natural_frequencies[1] == pytest.approx(17.0, abs=0.2)
    assert modes_are_implausible(taken)
    physics = library()["missing_mode"]
    assert isinstance(physics, MissingMode)
    sighted = find_mode(noise_floor(taken, lines), taken.hypothesis, physics)
    assert abs(sighted.pole) / (2 * np.pi) == pytest.approx(14.0, abs=0.3)
    (result,) = linear_candidates(lines, taken, [], sighted, ScreeningSettings(), 20.0)
    np.testing.assert_allclose(result.fitted.hypothesis.model.natural_frequencies, [6.0, 14.0, 17.0], rtol=2e-3)
    assert not modes_are_implausible(result.fitted)


def with_further_mode(frequency: float, damping: float, lab_damped: float = 0.0) -> Hypothesis:
    """The lab's mode of the rig, its damping off by some lab errors, and a further one."""
    physics, shape = library()["missing_mode"], ModelShape(Rig().model, LabError())
    assert isinstance(physics, MissingMode)
    u = np.zeros(shape.size)
    u[1] = lab_damped
    omega = 2 * np.pi * frequency
    pole = -damping * omega + 1j * omega * np.sqrt(1 - damping**2)
    return Hypothesis(shape, u).with_mode(pole, np.ones(1, complex), np.ones(1, complex), physics)


@pytest.mark.parametrize(("damping", "said"), [(0.05, ""), (0.25, ""), (0.77, "a mode damped by 77 % is no resonance")])
def test_a_pole_without_a_peak_cannot_be_a_missing_mode(damping: float, said: str) -> None:
    """What has a slope and no peak mends the form of a law; the candidate is told with the reason."""
    proposal: Any = Proposal("missing_mode", {}, SimpleNamespace(hypothesis=with_further_mode(5.9, damping)), 2691.0)
    assert impossible(proposal, Settings().evidence) == said


@pytest.mark.parametrize(("errors", "lost"), [(0.0, False), (5.0, False), (25.0, True)])
def test_a_further_mode_may_not_stand_for_one_of_the_labs(errors: float, lost: bool) -> None:
    """The lab's mode then follows something else: a high-pass of a sensor made one of 72 % in the blind trial."""
    hypothesis = with_further_mode(10.2, 0.03, errors)
    assert (hypothesis.model.damping_ratios[0] > 0.3) == lost
    said = lost_mode(hypothesis)
    proposal: Any = Proposal("missing_mode", {}, SimpleNamespace(hypothesis=hypothesis), 2691.0)
    assert impossible(proposal, Settings().evidence) == said
    assert said.startswith("the mode at 10 Hz would have to be damped by") if lost else not said


@pytest.mark.parametrize(
    ("frequency", "damping", "lost"),
    [(15.0, 0.02, []), (32.0, 0.02, []), (36.0, 0.02, [1]), (2.0, 0.02, [1]), (15.0, 0.8, [1])],
)
def test_a_mode_that_other_causes_have_moved_away_is_seen_no_more(
    frequency: float, damping: float, lost: list[int]
) -> None:
    """Compared from 3.3 to 30 Hz: beyond, and where it is damped like a slope, the mode is no resonance."""
    physics, rig = library()["missing_mode"], Rig()
    assert isinstance(physics, MissingMode)
    lines = [windowed_spectrum(each, band_of(rig.model, rig.rate), 1.0) for each in rig.recordings((1.0,))]
    shape = ModelShape(rig.model, LabError())
    hypothesis = Hypothesis(shape, np.zeros(shape.size))
    for at, ratio in ((20.0, 0.02), (frequency, damping)):
        pole = 2 * np.pi * at * complex(-ratio, np.sqrt(1 - ratio**2))
        hypothesis = hypothesis.with_mode(pole, np.ones(1, complex), np.ones(1, complex), physics)
    assert modes_outside_band(hypothesis, lines) == lost


@pytest.mark.parametrize(("share", "expected"), [(0.4, False), (0.6, True)])
def test_a_resonance_stands_out_of_the_noise(share: float, expected: bool) -> None:
    """In 45 draws all true modes gained 2.7 or more a number in their half-power band, and the false ones 0.2 at most.

    20 Hz and 5 % are 2 Hz: 40 lines of a recording of 20 s, less its run-in, two numbers each.
    """
    physics, rig = library()["missing_mode"], Rig()
    assert isinstance(physics, MissingMode)
    lines = [windowed_spectrum(each, band_of(rig.model, rig.rate), 1.0) for each in rig.recordings((1.0,), 20.0)]
    inside = np.abs(lines[0].frequencies - 20.0) <= 1.0
    base = Hypothesis(ModelShape(rig.model, LabError()), np.zeros(ModelShape(rig.model, LabError()).size))
    pole = 2 * np.pi * 20.0 * complex(-0.05, np.sqrt(1 - 0.05**2))
    more = base.with_mode(pole, np.ones(1, complex), np.ones(1, complex), physics)
    evidence = share * 2 * float(inside.sum())
    without = Fit(base, (), 1000.0, 0.0, 1000.0, 1e-6 * np.eye(base.size))
    fitted = Fit(more, (), 1000.0 - evidence, 0.0, 1000.0 - evidence, 1e-6 * np.eye(more.size))
    proposal = Proposal("missing_mode", {}, fitted, evidence)
    assert is_significant(proposal, without, without, lines, Settings().evidence) == expected


def test_each_of_several_modes_is_told_with_its_own_numbers() -> None:
    physics = library()["missing_mode"]
    assert isinstance(physics, MissingMode)
    shape = ModelShape(Rig().model, LabError())
    hypothesis = Hypothesis(shape, np.zeros(shape.size))
    for frequency in (15.0, 22.0):
        pole = 2 * np.pi * frequency * (-0.02 + 1j)
        hypothesis = hypothesis.with_mode(pole, np.ones(1, complex), np.ones(1, complex), physics)
    size = hypothesis.size
    fitted = Fit(hypothesis, (), 0.0, 0.0, 0.0, np.diag(np.arange(1.0, size + 1)))
    accepted = [Proposal("missing_mode", {}, fitted, 30.0 + k) for k in range(2)]
    reported = reported_causes_of(fitted, accepted)
    assert [cause.parameters["frequency_hz"] for cause in reported] == pytest.approx([15.0, 22.0], rel=1e-3)
    assert [cause.evidence for cause in reported] == [30.0, 31.0]
    first, second = (cause.standard_errors["damping_ratio"] for cause in reported)
    # variances stand in the order of the numbers: those of the mode added last are larger
    assert second > first
