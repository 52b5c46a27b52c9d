"""A published prediction of a beam that was not measured: J. Li, Receptance Coupling Substructure Analysis.

Three cantilevers of aluminium 7075 in one clamp (repository leekunhwee/Dynamics, commit 64deac7, ``RCSA/Example``:
dimensions in ``Beam.png``, material in ``TheoreticalFRF.m``, curves in ``Compare*.png``): b, 190 mm long, was tapped at
its end and 50 mm from it, and the end of d, 140 mm of 16 mm and 50 mm of 10 mm diameter, predicted. The measured FRFs
are not in the repository, so that first natural frequencies were read from its figures, to a pixel of 7.5 Hz. The clamp
gives way; with a rotational spring, which the measured frequency of b determines, the taps on b are computed, and the
base and d's end found as ``millfrf tool`` does.

**The prediction of the source and its measurement disagree** by two pixels, and so does millfrf with the measurement.
"""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from estimation import Frf
from millfrf.core import Complex
from modal_fit import Tool, ToolTable, first_clamped_frequency, identify_base, predict_tip, taps_of_blanks
from modal_fit.substructures.assembly import free_tool

# a loss factor is not stated; this one hardly moves the resonances
MATERIAL = {
    "youngs_modulus_pa": 7.2e10, "density_kg_per_m3": 2810.0, "poissons_ratio": 0.33, "loss_factor": 1e-3,
    "youngs_modulus_std_share": 0.0, "density_std_share": 0.0,
}  # fmt: skip
PIXEL = 2950 / 395  # Hz
MEASURED = {"b": 292.7, "c": 520.5, "d": 399.0}
RIGID_B, PREDICTED_D = 307.6, 382.3
AXIS = np.arange(100.0, 700.0, 0.5)


def beam(name: str, *cylinders: tuple[float, float]) -> Tool:
    """A beam of cylinders of length and diameter, m, with the points of taps."""
    segments = [{"material": "7075", "length_m": length, "diameter_m": diameter} for length, diameter in cylinders]
    points = {"TCP": 0.0, "MID": 0.05}
    table = {
        "material": {"7075": MATERIAL}, "segment": segments, "distance_from_tip_m": points, "stickout_std_m": 0.0,
    }  # fmt: skip
    return Tool(name, ToolTable.model_validate(table))


B, C, D = beam("b", (0.19, 0.016)), beam("c", (0.14, 0.016)), beam("d", (0.14, 0.016), (0.05, 0.010))


def receptance(tool: Tool, turning: float) -> Complex:
    """Receptance at tip and second point of a beam in a clamp with a rotational compliance, rad/(N m)."""
    s = 2j * np.pi * AXIS
    clamp = np.zeros((len(s), 2, 2), dtype=complex)
    clamp[:, 1, 1] = turning
    return free_tool(tool, ("TCP", "MID"), s, np.zeros(2, dtype=complex)).on_base(clamp)


def resonance(tip: Complex) -> float:
    """The first natural frequency, Hz: where the reciprocal's real part changes its sign."""
    real = (1 / tip).real
    k = int(np.flatnonzero((real[1:] < 0) & (real[:-1] >= 0))[0])
    return float(AXIS[k] + (AXIS[k + 1] - AXIS[k]) * real[k] / (real[k] - real[k + 1]))


def in_clamp(tool: Tool) -> Callable[[float], float]:
    """First natural frequency over the compliance of the clamp."""
    return lambda turning: resonance(receptance(tool, turning)[:, 0, 0])


TURNING = brentq(lambda turning: in_clamp(B)(turning) - MEASURED["b"], 1e-6, 1e-4, xtol=1e-12)


def test_a_rigid_clamp() -> None:
    """``CompareRCSA.png``: 140 mm and 50 mm of 16 mm, joined, on a rigid clamp."""
    assert first_clamped_frequency(B, 1000.0) == pytest.approx(RIGID_B, abs=PIXEL)


def test_the_clamp_of_b_holds_c() -> None:
    """``CompareIRCSA.png``: 573 Hz in a rigid clamp, 520 Hz measured; b's frequency is known to a pixel, too."""
    assert in_clamp(C)(0.0) > MEASURED["c"] + 6 * PIXEL
    longer = (C.length / B.length) ** -2  # a pixel of b in the frequency of c
    assert in_clamp(C)(TURNING) == pytest.approx(MEASURED["c"], abs=PIXEL * np.hypot(1, longer))


def test_d_is_predicted_as_in_the_source() -> None:
    """``CompareFinalResults.png``, from taps on b alone."""
    places = ("TCP:+X", "MID:+X")
    taps = Frf(AXIS, receptance(B, TURNING), places, places, "receptance", "m/N", AXIS > 0)
    collected = taps_of_blanks([B], [taps])
    tip = predict_tip(identify_base(collected.taps), D, collected.frequencies, collected.time_constant).frf
    peak = resonance(tip.values[:, 0, 0])
    assert peak == pytest.approx(PREDICTED_D, abs=PIXEL)
    assert peak < MEASURED["d"] - PIXEL
