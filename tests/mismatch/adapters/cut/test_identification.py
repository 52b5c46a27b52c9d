"""Force coefficients from cuts of a simulator that shares no code: values, errors, axes, teeth, drift, resonance."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.mismatch import CutCoefficients, CutForces, identify_coefficients
from millfrf.mismatch.cut.identification.coefficient_fit import fit_mean_forces
from millfrf.mismatch.cut.identification.turn_model import FINE, force_basis, step_angles
from millfrf.mismatch.cut.identification.turn_spectra import turn_spectra
from millfrf.mismatch.cut.motion import SpindleLaw

from .loop_forces import COEFFICIENTS, RATE, loop_forces

FEEDS = (25e-6, 75e-6, 125e-6)
NAMES = ("Fx", "Fy", "Fz")


def cutter(
    teeth: int = 2, helix: float = 0.5, feed: float = 1e-4, end: float = math.pi, start: float = 0.0
) -> MillingProcess:
    return MillingProcess(teeth, 0.016, math.pi / 2, 1e9, 0.3, 0.0, start, end, feed, helix_angle=helix)


def orders_of(force: NDArray[np.float64], process: MillingProcess, axes: Sequence[int] = (0, 1, 2)) -> CutForces:
    stated = SpindleLaw(0.0, 0.0, 6000 * math.pi / 30)
    turns = turn_spectra("cut", force, RATE, stated, process.teeth, 4 * process.teeth)
    return CutForces("cut", process, 0.003, turns.mean, turns.error, turns.drift, tuple(axes), turns.turning)


def cuts_of(teeth: int = 2, helix: float = 0.5, **options: object) -> list[CutForces]:
    cuts = []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, teeth=teeth, helix=helix, first_angle=2.0 * number, seed=number, **options)  # type: ignore[arg-type]
        cuts.append(orders_of(force, cutter(teeth, helix, feed)))
    return cuts


def assert_true(result: CutCoefficients, tolerance: float = 0.01) -> None:
    deviation = np.abs(result.coefficients - COEFFICIENTS)
    assert (deviation < 4 * result.errors).all()
    assert (deviation[:3] < tolerance * COEFFICIENTS[0]).all()


@pytest.mark.parametrize(("teeth", "helix"), [(2, 0.0), (2, 0.5), pytest.param(4, 0.5, marks=pytest.mark.long)])
def test_coefficients_and_runout_of_a_slot(teeth: int, helix: float) -> None:
    """Four straight teeth in a slot make a constant force; helix and runout tell them apart."""
    result = identify_coefficients(cuts_of(teeth, helix), NAMES)
    assert result.method == "waveforms"
    assert_true(result)
    shown = 12e-6 * (math.cos(1.0) if teeth == 2 else 1.0)  # two teeth show one component of the offset
    assert result.process.runout == pytest.approx(shown, rel=0.02)
    assert result.process.ktc == pytest.approx(900e6, rel=0.01)
    assert result.process.krc == pytest.approx(1 / 3, abs=4 * result.process.krc_std)
    assert len(str(result).splitlines()) <= 4  # at a prompt
    assert "Ktc (MPa) 90" in str(result) or "Ktc (MPa) 89" in str(result)


def test_down_milling_without_a_force_along_z() -> None:
    cuts = []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, immersion=(math.pi / 2, math.pi), first_angle=float(number), seed=number)
        cuts.append(orders_of(force[:, :2], cutter(feed=feed, start=math.pi / 2), (0, 1)))
    result = identify_coefficients(cuts, NAMES[:2])
    seen = [0, 1, 3, 4]
    assert np.isnan(result.coefficients[[2, 5]]).all()
    assert (np.abs(result.coefficients - COEFFICIENTS)[seen] < 4 * result.errors[seen]).all()


@pytest.mark.parametrize(
    ("order", "signs", "option"),
    [
        ((1, 0, 2), (1, 1, -1), "--axes=+Y,+X,-Z"),
        ((0, 1, 2), (-1, -1, -1), "--axes=-X,-Y,-Z"),  # forces on the workpiece
        ((1, 0, 2), (-1, 1, 1), "--axes=+Y,-X,+Z"),
    ],
)
def test_exchanged_and_turned_axes_are_refused_with_the_right_ones(
    order: tuple[int, ...], signs: tuple[int, ...], option: str
) -> None:
    measured = []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, first_angle=float(number), seed=number)
        measured.append(orders_of(force[:, list(order)] * np.array(signs), cutter(feed=feed)))
    with pytest.raises(InputError, match="do not act along X, Y, Z") as refusal:
        identify_coefficients(measured, NAMES)
    assert option in str(refusal.value)
    assert_true(identify_coefficients(measured, NAMES, option.removeprefix("--axes=").split(",")))


def test_another_number_of_teeth_is_refused() -> None:
    cuts = []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, first_angle=float(number), seed=number)
        cuts.append(orders_of(force, cutter(teeth=4, feed=feed / 2)))
    with pytest.raises(InputError, match="repeat as those of 2 teeth, not of the 4"):
        identify_coefficients(cuts, NAMES)


def test_a_drift_of_zero_is_named_and_air_gives_the_zero() -> None:
    drifting, offset = [], []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, first_angle=float(number), seed=number)
        drift = np.linspace(-30.0, 30.0, len(force))[:, None] * np.array([0.2, 1.0, 0.5])
        drifting.append(orders_of(force + drift, cutter(feed=feed)))
        air = np.random.default_rng(number).standard_normal((2000, 3))
        offset.append(orders_of(np.concatenate([air, force, air]) + np.array([20.0, -40.0, 15.0]), cutter(feed=feed)))
    result = identify_coefficients(drifting, NAMES)
    assert any("the zero of the forces drifts" in doubt for doubt in result.warnings)
    assert_true(result)
    assert_true(identify_coefficients(offset, NAMES))


def test_a_zero_that_drifts_between_air_on_both_sides_is_subtracted() -> None:
    """The drift of the air is as large as the force, so that only its ripple tells it from the cut."""
    cuts, turned = [], []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, first_angle=float(number), seed=number)
        air = np.random.default_rng(number).standard_normal((3000, 3))
        whole = np.concatenate([air, force, air])
        size = np.sqrt(np.mean(force**2))
        drift = np.linspace(0.0, 0.4 * size, len(whole))[:, None] * np.array([0.2, 0.5, 1.0])
        cuts.append(orders_of(whole + drift, cutter(feed=feed)))
        turned.append(orders_of((whole + drift) * np.array([1, 1, -1]), cutter(feed=feed)))
    result = identify_coefficients(cuts, NAMES)
    assert not any("the zero of the forces drifts" in doubt for doubt in result.warnings)
    assert_true(result)
    with pytest.raises(InputError, match=r"--axes=\+X,\+Y,-Z"):
        identify_coefficients(turned, NAMES)


def test_the_waveforms_show_the_sign_of_an_axial_force_whose_zero_drifts() -> None:
    turned = []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, first_angle=float(number), seed=number)
        drift = np.linspace(-1.0, 1.0, len(force)) * 3 * np.abs(force[:, 2]).max()
        turned.append(orders_of(np.column_stack([force[:, :2], drift - force[:, 2]]), cutter(feed=feed)))
    with pytest.raises(InputError, match=r"--axes=\+X,\+Y,-Z"):
        identify_coefficients(turned, NAMES)


@pytest.mark.parametrize("share", [0.83, 0.95, 1.1])
def test_a_wrong_speed_is_named_with_that_of_the_strongest_line(share: float) -> None:
    force = loop_forces(FEEDS[2], first_angle=1.0)
    stated = SpindleLaw(0.0, 0.0, share * 6000 * math.pi / 30)
    with pytest.raises(InputError, match="no lines at orders of") as refusal:
        turn_spectra("cut", force, RATE, stated, 2, 8)
    named = float(str(refusal.value).split("teeth at ")[1].split(" rpm")[0])
    assert named == pytest.approx(6000, rel=0.02)


def test_a_cut_without_a_force_that_others_have_is_named() -> None:
    cuts = cuts_of()
    lacking = orders_of(loop_forces(FEEDS[0])[:, :2], cutter(feed=FEEDS[0]), (0, 1))
    with pytest.raises(InputError, match=r"cut has no force at TCP:\+Z"):
        identify_coefficients([lacking, *cuts[1:]], NAMES)


def test_two_resonances_of_the_dynamometer_leave_the_mean_forces() -> None:
    """The static gain is right, the waveforms are not, and one mode along each axis does not explain them."""
    cuts = []
    w, v = 2 * math.pi * 480, 2 * math.pi * 730
    sections = np.polymul([1.0, 0.04 * w, w**2], [1.0, 0.04 * v, v**2])
    resonance = scipy.signal.bilinear([w**2 * v**2], sections, RATE)
    for number, feed in enumerate(FEEDS):
        force = loop_forces(feed, first_angle=float(number), seed=number, runout=0.0)
        cuts.append(orders_of(scipy.signal.lfilter(*resonance, force, axis=0)[2000:], cutter(feed=feed)))
    result = identify_coefficients(cuts, NAMES)
    assert result.method == "mean forces"
    assert any("of the waveforms is not explained: a resonance" in doubt for doubt in result.warnings)
    assert result.process.runout == 0
    assert any("runout" in doubt and "is not determined (the waveforms" in doubt for doubt in result.warnings)
    assert any("the forces ring at" in doubt and "give --dynamometer" in doubt for doubt in result.warnings)
    assert result.coefficients[:2] == pytest.approx(COEFFICIENTS[:2], rel=0.02)


def test_mean_forces_of_one_feed_do_not_separate_the_edges() -> None:
    with pytest.raises(InputError, match="at three or more feeds"):
        fit_mean_forces(cuts_of()[:1])


def test_one_feed_is_identified_by_its_waveform_with_a_doubt() -> None:
    """Cutting force follows the sine of the immersion, edge force does not."""
    result = identify_coefficients(cuts_of()[1:2], NAMES)
    assert any("axes, signs and teeth are not checked" in doubt for doubt in result.warnings)
    assert_true(result, 0.02)


def test_the_basis_is_the_force_of_the_loops() -> None:
    """Both computed at the same angles; entry and exit differ by half a step."""
    process = cutter(feed=1e-4)
    offsets = 12e-6 * np.cos(np.pi * np.arange(2) - 1.0)
    force = np.tensordot(COEFFICIENTS, force_basis(process, 0.003, offsets), 1)
    rpm = 60 * RATE / FINE  # one revolution in FINE samples
    loops = loop_forces(1e-4, rpm=rpm, seconds=FINE / RATE, first_angle=0.0, noise=0.0)
    assert step_angles(FINE)[1] == pytest.approx(2 * math.pi / FINE)
    assert np.sqrt(np.mean((force - loops) ** 2)) < 0.01 * np.abs(loops).max()


@pytest.mark.parametrize(("runout", "written"), [(0.0, False), (6e-6, True)])
def test_runout_is_written_only_where_it_is_no_chance(runout: float, written: bool) -> None:
    result = identify_coefficients(cuts_of(runout=runout), NAMES)
    assert (result.process.runout > 0) == written
    assert any("is not determined (F-test" in doubt for doubt in result.warnings) != written


def test_the_covariance_is_that_of_the_shares() -> None:
    """Drawn coefficients, divided by the drawn Ktc, have the covariance that the cutting file gets."""
    result = identify_coefficients(cuts_of(), NAMES)
    drawn = np.random.default_rng(0).multivariate_normal(
        result.fit.coefficients, result.fit.covariance[:6, :6], 100_000
    )
    drawn[:, 1:3] /= drawn[:, :1]
    expected = np.cov(drawn.T)
    scale = np.sqrt(np.diag(expected))
    assert np.array(result.process.covariance) / np.outer(scale, scale) == pytest.approx(
        expected / np.outer(scale, scale), abs=0.02
    )
    assert np.abs(expected[0, 1]) > 0.1 * scale[0] * scale[1]  # shares and Ktc are correlated
