"""A high-pass of one stage or of two: where the recordings cannot tell, the corner's error holds either."""

import numpy as np
import pytest
from concealed_recordings import RATE, forces, linear_acceleration, structure, trial

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, fit, library
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.physics.linear_causes import TWO_STAGES
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.reported_causes import with_form_spread


def recorded(corner: float, stages: int, seed: int) -> list[WindowedSpectrum]:
    """Two recordings behind ``(s / (s + w))^stages``, 2 % noise."""
    model, rng, made = structure(), np.random.default_rng(seed), []
    for level in (20.0, 60.0):
        force = forces(rng, level, 24.0)
        moved = linear_acceleration(model, force)
        s = 2j * np.pi * np.fft.rfftfreq(len(moved), 1 / RATE)
        passed = (s / (s + 2 * np.pi * corner)) ** stages
        high = np.fft.irfft(np.fft.rfft(moved, axis=0) * passed[:, None], n=len(moved), axis=0)
        made.append(trial(f"{level:g} N", force, high, rng))
    decay = float((-model.poles.real).min())
    return [windowed_spectrum(each, band_of(model, RATE), decay) for each in made]


def named(lines: list[WindowedSpectrum], corner: float, place: str) -> Fit:
    """The high-pass fitted with one form."""
    cause = Cause(library()["ac_coupling"], np.array([corner]), place)
    shape = ModelShape(structure(), LabError(), 0)
    return fit(lines, Hypothesis(shape, np.zeros(shape.size), (cause,)))


def corner_and_error(found: Fit) -> tuple[float, float]:
    """Hz; the coordinate is ``ln f_c`` in steps of its unit."""
    [cause] = found.hypothesis.causes
    corner = float(cause.values[0])
    return corner, corner * cause.physics.parameters[0].unit_step * float(np.sqrt(found.covariance[-1, -1]))


@pytest.mark.parametrize(("stages", "place"), [(1, TWO_STAGES), (2, ""), (1, ""), (2, TWO_STAGES)])
def test_the_error_of_a_corner_holds_the_other_number_of_stages(stages: int, place: str) -> None:
    """Before: 0.311 ± 0.003 Hz of two stages for 0.614 Hz of one, which leads the phase by as much."""
    truth = 0.3
    lines = recorded(truth, stages, 3)
    start = truth * stages / (2 if place == TWO_STAGES else 1)
    result = named(lines, start, place)
    held = with_form_spread(result, lines)
    (corner, alone), (_, error) = corner_and_error(result), corner_and_error(held)
    assert error >= alone
    assert abs(corner - truth) < 1.96 * error
    if place == (TWO_STAGES if stages == 2 else ""):
        assert abs(corner - truth) < 3 * alone
    else:
        assert abs(corner - truth) > 5 * alone


def test_a_form_that_does_not_fit_widens_nothing() -> None:
    """At 6 Hz, inside the band, the two forms differ in magnitude: the right one is known, and its number too."""
    lines = recorded(6.0, 1, 4)
    result = named(lines, 6.0, "")
    (corner, alone), (_, error) = corner_and_error(result), corner_and_error(with_form_spread(result, lines))
    assert corner == pytest.approx(6.0, abs=3 * error)
    assert error < 2 * alone
