"""Forces through a dynamometer that rings: with its tap the coefficients are right, without it the ringing is named."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import TIP, InputError
from millfrf.cutting import MillingProcess
from millfrf.mismatch import CutForces, identify_coefficients
from millfrf.mismatch.cut.identification.dynamometer import dynamometer_of
from millfrf.mismatch.cut.identification.recorded_cuts import through_dynamometer
from millfrf.mismatch.cut.identification.turn_spectra import turn_spectra
from millfrf.mismatch.cut.motion import SpindleLaw

from .loop_forces import COEFFICIENTS, RATE, loop_forces

FEEDS = (25e-6, 75e-6, 125e-6)
NAMES = ("Fx", "Fy", "Fz")
MODES = ((800.0, 0.03), (950.0, 0.04), (1500.0, 0.03))
"""Frequency (Hz) and damping ratio of the dynamometer along X, Y, Z."""
CROSS = 0.05
"""Share of the resonant part that each axis passes on to the next."""


def transfer(frequencies: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return measured over applied force, (n, 3, 3), of the bilinear filters of :func:`measured`."""
    w = 2 * RATE * np.tan(np.pi * frequencies / RATE)
    values = np.zeros((len(w), 3, 3), complex)
    for axis, (f0, zeta) in enumerate(MODES):
        w0 = 2 * math.pi * f0
        values[:, axis, axis] = w0**2 / (w0**2 - w**2 + 2j * zeta * w0 * w)
        values[:, (axis + 1) % 3, axis] = CROSS * (values[:, axis, axis] - 1)
    return values


def measured(force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what the dynamometer shows of forces (n, 3), after its run-in."""
    shown = np.zeros_like(force)
    for axis, (f0, zeta) in enumerate(MODES):
        w0 = 2 * math.pi * f0
        filtered = scipy.signal.lfilter(
            *scipy.signal.bilinear([w0**2], [1.0, 2 * zeta * w0, w0**2], RATE), force[:, axis]
        )
        shown[:, axis] += filtered
        shown[:, (axis + 1) % 3] += CROSS * (filtered - force[:, axis])
    return shown[2000:]


def tapped(excitations: tuple[str, ...] = TIP, gain: float = 1.0) -> Frf:
    """Return the FRF of taps with a hammer whose calibration is off by ``1 / gain``."""
    f = np.arange(0.0, 1300.0, 2.0)
    columns = [TIP.index(label) for label in excitations]
    values = gain * transfer(f)[:, :, columns]
    return Frf(f, values, TIP, excitations, "transfer", "N/N", np.ones(len(f), dtype=bool))


def cuts_shown(**options: float) -> list[CutForces]:
    cuts = []
    for number, feed in enumerate(FEEDS):
        process = MillingProcess(2, 0.016, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, feed, helix_angle=0.5)
        force = loop_forces(feed, first_angle=float(number), noise=0.0, **options)  # type: ignore[arg-type]
        rng = np.random.default_rng(number)
        shown = measured(force)
        shown += 0.02 * np.abs(force).max() * rng.standard_normal(shown.shape)
        turns = turn_spectra("cut", shown, RATE, SpindleLaw(0.0, 0.0, 6000 * math.pi / 30), 2, 12)
        cuts.append(CutForces("cut", process, 0.003, turns.mean, turns.error, turns.drift, (0, 1, 2), turns.turning))
    return cuts


@pytest.mark.parametrize("gain", [1.0, -1.07])
def test_a_tap_gives_the_coefficients_behind_the_resonance(gain: float) -> None:
    """A hammer that is off by 7 %, and forces counted on the workpiece, change nothing."""
    dynamometer = dynamometer_of(tapped(gain=gain), "tap.h5")
    result = identify_coefficients([through_dynamometer(cut, dynamometer) for cut in cuts_shown()], NAMES)
    assert result.method == "waveforms"
    assert result.fit.misfit < 0.02
    assert (np.abs(result.coefficients - COEFFICIENTS) < 4 * result.errors).all()
    assert result.coefficients[:3] == pytest.approx(COEFFICIENTS[:3], rel=0.02)


def test_exchanged_axes_are_exchanged_in_the_transfer() -> None:
    dynamometer = dynamometer_of(tapped(), "tap.h5")
    # the channels are named after the wrong axes, in the cuts as in the taps
    named = [1, 0, 2]
    cuts = [through_dynamometer(cut, dynamometer) for cut in cuts_shown()]
    exchanged = [
        replace(
            cut,
            mean=cut.mean[:, named] * [1, -1, 1],
            error=cut.error[:, named],
            transfer=cut.transfer[:, named][:, :, named] * np.outer([1, -1, 1], [1, -1, 1]),  # type: ignore[index]
        )
        for cut in cuts
    ]
    with pytest.raises(InputError, match=r"--axes=-Y,\+X,\+Z"):
        identify_coefficients(exchanged, NAMES)
    result = identify_coefficients(exchanged, NAMES, ("-Y", "+X", "+Z"))
    assert result.fit.misfit < 0.02


def test_directions_without_a_tap_are_named() -> None:
    dynamometer = dynamometer_of(tapped(TIP[:2]), "tap.h5")
    assert dynamometer.warnings == ("tap.h5 was not tapped along TCP:+Z: taken as rigid there",)
    assert (dynamometer.values[:, 2, 2] == 1).all()


@pytest.mark.parametrize(("gain", "message"), [(1000.0, "shows 1e+03 N for 1 N"), (0.01, "check units")])
def test_a_gain_of_another_unit_is_refused(gain: float, message: str) -> None:
    with pytest.raises(InputError) as refusal:
        dynamometer_of(tapped(gain=gain), "tap.h5")
    assert message in str(refusal.value)


def test_a_hammer_that_disagrees_with_the_dynamometer_is_named() -> None:
    dynamometer = dynamometer_of(tapped(gain=1.2), "tap.h5")
    assert "1.2 N for 1 N of the hammer along TCP:+X" in dynamometer.warnings[0]


def test_without_a_tap_the_modes_are_inferred_and_proven_on_left_out_cuts() -> None:
    result = identify_coefficients(cuts_shown(), NAMES)
    assert result.ringing is not None
    # the bilinear filter rings at the warped frequency
    rings = [RATE / math.pi * math.atan(math.pi * f0 / RATE) for f0, _ in MODES[:2]]
    assert result.ringing.modes[:2, 0] == pytest.approx(rings, rel=0.01)
    assert result.ringing.held_out.max() < 0.05
    assert result.method == "waveforms"
    assert result.coefficients[:2] == pytest.approx(COEFFICIENTS[:2], rel=0.03)
    assert any(
        "783 Hz along X" in doubt and "inferred from the cuts, not measured" in doubt for doubt in result.warnings
    )
