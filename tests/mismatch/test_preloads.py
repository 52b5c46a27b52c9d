"""Dry friction whose preload differs between recordings of one level: one law, a force for each recording."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_joint import RIG, law_of, with_law
from scipy.fft import irfft

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.gate import check_preloads
from millfrf.mismatch import Hypothesis, Settings, diagnose, fit, improved_model_of, predict_lines
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.models.misfit import jacobian
from millfrf.mismatch.models.model_terms import hypothesis_of, improved_model
from millfrf.mismatch.records.bands import Recordings
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.screening.preloads import are_driven_alike, have_one_level, laws_with_preloads

FRICTION, FACTORS = 6.0, {"level_1": 1.0, "level_2": 1.8, "level_3": 2.9}


def truth(factors: dict[str, float]) -> Hypothesis:
    """Dry friction of 6 N in the first recording."""
    hypothesis = with_law(law_of("coulomb_friction"), np.array([FRICTION, 1e-3]))
    return replace(hypothesis, causes=(replace(hypothesis.causes[0], preloads=factors),))


def recorded(factors: dict[str, float], levels: tuple[float, ...] = (20.0, 20.0, 20.0)) -> list[BandRecording]:
    """Random forces of the stated levels (N) and the motion under friction, 1 % noise."""
    band, result = band_of(RIG.model, RIG.rate), []
    for seed, recording in enumerate(RIG.recordings(levels)):
        lines = windowed_spectrum(recording, band, 1.0)
        moved = irfft(predict_lines(truth(factors), lines).spectrum, n=lines.padded, axis=0)[: len(recording.force)]
        moved += 0.01 * moved.std() * np.random.default_rng(2000 + seed).normal(size=moved.shape)
        result.append(replace(recording, response=moved))
    return result


def compared(recordings: list[BandRecording]) -> list[WindowedSpectrum]:
    return [windowed_spectrum(recording, band_of(RIG.model, RIG.rate), 1.0) for recording in recordings]


@pytest.mark.parametrize(("law", "second"), [("coulomb_friction", 5e-3), ("presliding_friction", 5e-5)])
def test_a_factor_changes_its_own_recording_as_the_force_does(law: str, second: float) -> None:
    """Steps of force and factors are alike; the derivative by the force against simulations."""
    hypothesis = with_law(law_of(law), np.array([FRICTION, second]))
    hypothesis = replace(hypothesis, causes=(replace(hypothesis.causes[0], preloads=FACTORS),))
    for lines in compared(recorded(FACTORS))[:2]:
        slopes = jacobian(hypothesis, lines, predict_lines(hypothesis, lines))[:, :, hypothesis.shape.size :]
        aside = 0.02 * np.eye(4)[0]
        above, below = (
            predict_lines(hypothesis.with_causes(hypothesis.coordinates() + sign * aside), lines).response
            for sign in (1, -1)
        )
        quotient = (above - below) / 0.04
        assert np.linalg.norm(slopes[:, :, 0] - quotient) < 0.2 * np.linalg.norm(quotient)
        own = slopes[:, :, 0] if lines.recording.name == "level_2" else 0 * quotient
        np.testing.assert_allclose(slopes[:, :, 2], own, rtol=5e-3, atol=1e-4 * np.abs(quotient).max())
        np.testing.assert_allclose(slopes[:, :, 3], 0 * quotient, atol=1e-4 * np.abs(quotient).max())


def proposals(recordings: list[BandRecording]) -> list[Proposal]:
    """Proposals with a factor for each recording, from friction of the mean force."""
    lines = compared(recordings)
    current = fit(lines, truth({}).nominal)
    mean = fit(lines, truth({}))
    start = Proposal("coulomb_friction", {}, mean, current.score - mean.score)
    return laws_with_preloads(lines, current, [start], Settings())


def test_forces_of_their_own_are_proposed_where_they_differ() -> None:
    (proposal,) = proposals(recorded(FACTORS))
    cause = proposal.fitted.hypothesis.causes[-1]
    assert cause.values[0] == pytest.approx(FRICTION, rel=0.05)
    assert dict(cause.preloads) == pytest.approx(FACTORS, rel=0.05)


@pytest.mark.parametrize("levels", [(20.0, 20.0, 20.0), (10.0, 20.0, 40.0)])
def test_no_forces_of_their_own_where_one_force_fits(levels: tuple[float, ...]) -> None:
    assert not proposals(recorded({}, levels))


def test_at_different_levels_no_forces_of_their_own_are_tried() -> None:
    """There, a force of its own in each recording cannot be told from a force that follows the level."""
    recordings = recorded(FACTORS, (10.0, 20.0, 40.0))
    assert not are_driven_alike(compared(recordings), Settings())
    assert not proposals(recordings)


def test_at_different_speeds_no_forces_of_their_own_are_tried() -> None:
    """A path at three speeds, as of a robot's joint: friction that depends on the velocity differs between them."""
    time = np.arange(30 * int(RIG.rate)) / RIG.rate
    lines = compared([RIG.recording(f"at_{f:g}_hz", 20 * np.sin(2 * np.pi * f * time)) for f in (5.0, 10.0, 20.0)])
    assert have_one_level(lines, 1.3)
    assert not are_driven_alike(lines, Settings())
    assert are_driven_alike(lines[:1] * 2, Settings())


def test_a_recording_with_a_number_of_its_own_is_held_out_in_part() -> None:
    lines = compared(recorded(FACTORS))
    whole = Recordings(lines, lines)
    parts = replace(whole, own_numbers=True)
    assert len(whole.others(lines)) == 2
    assert len(parts.others(lines)) == 6
    assert set(parts.held_out_elsewhere(lines)) == {0, 2}
    short = [replace(each, band=each.band[:40], frequencies=each.frequencies[:40]) for each in lines]
    assert not replace(parts, repaired=short, measured=short).tested


def test_the_model_file_keeps_the_forces_and_predicts_other_recordings_by_their_mean() -> None:
    model = improved_model(truth(FACTORS))
    read = hypothesis_of(model).causes[0]
    assert dict(read.preloads) == FACTORS
    mean = float(np.prod(list(FACTORS.values()))) ** (1 / 3)
    for name, factor in {**FACTORS, "another": mean}.items():
        recording = BandRecording(name, 100.0, np.zeros((9, 1)), np.zeros((9, 1)), (), ())
        np.testing.assert_allclose(read.law(recording).damping, factor * truth({}).causes[0].law().damping)
    assert not check_preloads(model, "level_2")
    (warning,) = check_preloads(model, "another")
    assert "1 to 2.9 times" in warning


@pytest.mark.long
def test_friction_of_another_preload_in_each_recording_is_named_and_measured() -> None:
    """Before, one force for all recordings was not confirmed on the recording held out, and nothing was named."""
    result = diagnose(RIG.model, recorded(FACTORS))
    assert [cause.name for cause in result.physics] == ["coulomb_friction"]
    numbers = result.physics[0].parameters
    for name, factor in FACTORS.items():
        assert numbers[f"friction_n_in_{name}"] == pytest.approx(factor * FRICTION, rel=0.05)
    assert any("preload" in doubt for doubt in result.doubts)
    assert all(error.after < 0.03 for error in result.held_out)
    assert improved_model_of(result).physics[0]["location"]["preloads"] == pytest.approx(FACTORS, rel=0.05)
