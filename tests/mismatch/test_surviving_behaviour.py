"""A change of a mode with the level is stated only if it depends neither on the band nor on the other modes."""

from dataclasses import replace

import numpy as np
from concealed_recordings import RATE, linear_acceleration, structure, trial
from one_mode_rig import Rig

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Behaviour, Hypothesis, LabError, ModelShape, behaviour_of, fit
from modal_fit import ModalModel


def recorded(name: str, level: float, edges: tuple[float, float], seed: int) -> BandRecording:
    """The linear structure with modes at 9 and 14 Hz under random forces, which are strongest between two edges."""
    rng, n = np.random.default_rng(seed), int(30 * RATE)
    frequencies = np.fft.rfftfreq(n, 1 / RATE)
    inside = (frequencies > edges[0]) & (frequencies < edges[1])
    colour = np.where(inside, 1.0, 0.08) * (frequencies < 40)
    spectrum = np.fft.rfft(rng.normal(size=(n, 2)), axis=0) * colour[:, None]
    force = level * np.fft.irfft(spectrum, n=n, axis=0)
    return trial(name, force, linear_acceleration(structure(), force), rng, 0.01)


def behaviour(model: ModalModel, recordings: list[BandRecording], band: tuple[float, float]) -> Behaviour:
    shape, decay = ModelShape(model, LabError()), float((-model.poles.real).min())
    lines = [windowed_spectrum(recording, band, decay) for recording in recordings]
    return behaviour_of(fit(lines, Hypothesis(shape, np.zeros(shape.size))).hypothesis, lines)


def test_a_refit_that_finds_another_mode_at_the_high_level_is_no_stiffening() -> None:
    """A nominal model with one of two modes; weak forces drive the lower mode, strong forces the upper one.

    Over the whole band the refitted mode rises by half, with an error below 1 %: it was stated as hardening.
    """
    two = structure()
    single = replace(two, poles=two.poles[:1], right=two.right[:1], left=two.left[:1])
    recordings = [recorded("low", 20.0, (7.0, 11.0), 1), recorded("high", 60.0, (11.0, 17.0), 2)]
    result = behaviour(single, recordings, (5.0, 20.0))
    assert result.family == "uncertain"
    assert "stiffens" not in result.sentence
    assert "how is uncertain: over the whole band its frequency changes by +5" in result.sentence
    assert behaviour(two, recordings, (5.0, 20.0)).family == "none"


def test_a_spring_that_stiffens_is_stated() -> None:
    """Half of the band and the other modes fixed (there are none) show the same rise of the frequency."""
    rig = Rig().stiffened(0.05, 60.0)
    model = replace(rig.model, band=(4.0, 22.0))
    result = behaviour(model, rig.recordings((20.0, 40.0, 60.0), 60.0), (4.0, 22.0))
    assert result.family == "hardening"
    assert "stiffens by" in result.sentence
