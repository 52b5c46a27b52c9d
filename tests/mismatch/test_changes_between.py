"""A gain or a delay that differs between recordings is described; laws of a joint, which change both, are not."""

from dataclasses import replace

import numpy as np
import pytest
from concealed_recordings import RATE, Concealed, forces, late, linear_acceleration, structure, trial

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, diagnose
from millfrf.mismatch.structure.changes_in_time import changes_between

BAND, SECONDS = (3.0, 40.0), 24.0
NAMES = ("low", "mid", "high")
GAINS, DELAYS = (1.0, 1.1, 0.92), (0.0, 0.8e-3, 2e-3)


def recordings(law: Concealed | None = None) -> list[BandRecording]:
    made = []
    for number, name in enumerate(NAMES):
        rng = np.random.default_rng(number)
        force = forces(rng, 100.0 * (1 + number), SECONDS)
        motion = linear_acceleration(structure(), force) if law is None else law.acceleration(structure(), force)
        made.append(trial(name, force, motion, rng))
    return made


def with_gains(given: list[BandRecording]) -> list[BandRecording]:
    """Another range of the second channel in each recording."""
    return [
        replace(each, response=each.response * np.array([1.0, gain])) for each, gain in zip(given, GAINS, strict=True)
    ]


def with_delays(given: list[BandRecording]) -> list[BandRecording]:
    return [replace(each, response=late(each.response, RATE, delay)) for each, delay in zip(given, DELAYS, strict=True)]


def changes(given: list[BandRecording]) -> tuple[tuple[str, list[float]], ...]:
    """Changes against the true linear structure."""
    shape = ModelShape(structure(), LabError())
    lines = [windowed_spectrum(each, BAND, 1.0) for each in given]
    stated = changes_between(Hypothesis(shape, np.zeros(shape.size)), lines)
    return tuple((change.response, [number for _, number in change.changes]) for change in stated)


def test_a_gain_of_one_channel_is_stated_with_its_size() -> None:
    [(response, gains)] = changes(with_gains(recordings()))
    assert response == "ay"
    assert gains == pytest.approx([gain - 1 for gain in GAINS], abs=0.01)


def test_a_delay_of_all_channels_is_stated_with_its_size() -> None:
    [(response, delays)] = changes(with_delays(recordings()))
    assert not response
    assert delays == pytest.approx(list(DELAYS), abs=1e-4)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3])
def test_dry_friction_is_no_change_of_a_channel(share: float) -> None:
    """It damps weak recordings more than strong ones, in all channels and by another law than a gain."""
    moment = share * 200.0
    law = Concealed(lambda x, v: moment * np.tanh(v / 1e-4), np.array([0.8, 0.6]))
    assert changes(recordings(law)) == ()


def test_recordings_that_are_alike_have_no_changes() -> None:
    assert changes(recordings()) == ()


@pytest.mark.long
@pytest.mark.parametrize("change", [with_gains, with_delays])
def test_a_diagnosis_names_no_physics_and_states_the_change(change: object) -> None:
    assert callable(change)
    diagnosis = diagnose(structure(), change(recordings()))
    assert diagnosis.verdict == "unexplained"
    assert any("differs between the recordings" in doubt for doubt in diagnosis.doubts)
    assert not any("friction" in doubt for doubt in diagnosis.doubts)
