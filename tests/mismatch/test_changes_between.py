"""A gain or a delay that differs between recordings is described; laws of a joint, which change both, are not."""

from dataclasses import replace

import numpy as np
import pytest
from concealed_recordings import RATE, Concealed, forces, late, linear_acceleration, structure, trial

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, diagnose
from millfrf.mismatch.structure.changes_in_time import changes_between
from modal_fit import ModalModel

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


@pytest.mark.parametrize("other", [0.6, 0.0])
@pytest.mark.parametrize(("frequency", "damping"), [(0.003, 0.0), (0.03, 0.0), (0.0, 0.1), (0.0, 0.3)])
def test_a_mode_that_moves_is_no_change_of_a_channel(other: float, frequency: float, damping: float) -> None:
    """Alone in the band it delays all responses alike; where it moves one response, it changes that one's gain."""

    def rig(move: float) -> ModalModel:
        omega = 2 * np.pi * np.array([9 * (1 + frequency * move), 15.0])
        zeta = np.array([0.04 * (1 + damping * move), 0.04])
        poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
        shapes = np.array([[1.0, other], [0.0, 1.0]]) + 0j
        return replace(structure(), poles=poles, right=shapes, left=shapes / (2j * poles.imag[:, None] * 40.0))

    shape, lines = ModelShape(rig(0.0), LabError()), []
    for number, name in enumerate(NAMES):
        rng = np.random.default_rng(number)
        force = forces(rng, 100.0 * (1 + number), SECONDS) * np.array([1.0, 0.1 if other else 1.0])
        recording = trial(name, force, linear_acceleration(rig(number - 1.0), force), rng)
        lines.append(windowed_spectrum(recording, BAND, 1.0))
    assert changes_between(Hypothesis(shape, np.zeros(shape.size)), lines) == ()


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
