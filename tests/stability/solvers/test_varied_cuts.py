"""Helical edges, unequal pitch, process damping: against exact special cases and independent solvers."""

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, average_directional_matrix, damping_harmonics
from millfrf.stability import (
    collocation_limits,
    delay_system,
    multipliers,
    nyquist_limits,
    semi_discretisation,
    zero_order,
)
from millfrf.stability.depth_search import Point, limit_between
from millfrf.stability.solvers.collocation import varied_limits
from millfrf.stability.solvers.multi_frequency import multi_frequency_limits
from modal_fit import ModalModel

RPM = np.pi / 30
LABELS = ("T:+X", "T:+Y", "T:+Z")


def _structure() -> ModalModel:
    poles, right, left = [], [], []
    for frequency, damping, mass, shape, push in [
        (60.0, 0.03, 2.0, [1.0, 0.2, 0.1], [1.0, 0.1, 0.1]),
        (80.0, 0.04, 1.5, [-0.1, 1.0, 0.3], [-0.1, 1.0, 0.2]),
    ]:
        omega = 2 * np.pi * frequency
        pole = omega * (-damping + 1j * np.sqrt(1 - damping**2))
        poles.append(pole)
        right.append(np.array(shape) / (2j * pole.imag * mass))
        left.append(np.array(push) + 0j)
    return ModalModel(np.array(poles), np.array(right), np.array(left), LABELS, LABELS)


def _cutter(**changes: object) -> MillingProcess:
    values: dict[str, object] = {
        "teeth": 3,
        "diameter": 0.01,
        "edge_angle": np.pi / 2,
        "ktc": 2e8,
        "krc": 0.3,
        "kac": 0.1,
        "start_angle": np.pi / 2,
        "exit_angle": np.pi,
        "feed_per_tooth": 1e-4,
    }
    return MillingProcess(**(values | changes))  # type: ignore[arg-type]


MODEL = _structure()


def test_general_collocation_equals_the_split_one_for_straight_edges() -> None:
    speeds = np.array([900.0, 1500.0, 2600.0]) * RPM
    known = collocation_limits(MODEL, _cutter(), speeds, 5e-3)
    general = varied_limits(delay_system(MODEL, _cutter()), speeds, 5e-3, tolerance=1e-9)
    np.testing.assert_allclose(general.depth, known.depth, rtol=1e-7)
    assert general.bifurcation == known.bifurcation
    np.testing.assert_array_equal(general.change, known.change)
    np.testing.assert_allclose(general.frequency, known.frequency, rtol=1e-4)


def test_a_turn_with_all_but_equal_pitch_gives_the_limits_of_equal_pitch() -> None:
    third = 2 * np.pi / 3
    almost = _cutter(pitch_angles=(third + 1e-6, third, third - 1e-6))
    known = collocation_limits(MODEL, _cutter(), np.array([1500 * RPM]), 5e-3)
    turned = collocation_limits(MODEL, almost, np.array([1500 * RPM]), 5e-3)
    np.testing.assert_allclose(turned.depth, known.depth, rtol=1e-4)


@pytest.mark.parametrize("damping", [0.0, 3e4])
@pytest.mark.parametrize("speed", [700.0, 1200.0, 2600.0])
def test_a_helix_that_lags_by_one_pitch_cuts_with_the_average_force(damping: float, speed: float) -> None:
    """Then alpha is constant in time, and the multiplier solves ``det[I - a L(s)] = 0`` exactly at s = ln(mu) / tau."""
    depth, pitch = 1.2e-3, 2 * np.pi / 3
    helix = np.arctan(pitch * 0.01 / (2 * depth))
    process = _cutter(helix_angle=float(helix), process_damping=damping)
    values = multipliers(MODEL, process, speed * RPM, depth)
    flank = damping / (speed * RPM * process.diameter / 2) * damping_harmonics(process, np.array([0]))[0].real
    regained = process.ktc * (1 - 1 / values.values[0]) * average_directional_matrix(process)
    smallest = np.inf
    for turn in range(-12, 13):
        s = (np.log(values.values[0]) + 2j * np.pi * turn) / values.tooth_period
        receptance = sum(
            np.outer(r, q) / (s - p) + np.outer(r.conj(), q.conj()) / (s - p.conjugate())
            for p, r, q in zip(MODEL.poles, MODEL.right, MODEL.left, strict=True)
        )
        loop = depth * (regained - s * flank) @ receptance
        smallest = min(smallest, abs(np.linalg.det(np.eye(3) - loop)))
    assert smallest < 1e-9


def test_unequal_pitch_agrees_with_the_multi_frequency_solution() -> None:
    process = _cutter(pitch_angles=tuple(np.radians([100.0, 120.0, 140.0])))
    speeds = np.array([930.0, 1510.0]) * RPM
    here, there = (solve(MODEL, process, speeds, 3e-3) for solve in (collocation_limits, multi_frequency_limits))
    assert here.bifurcation == there.bifurcation
    np.testing.assert_array_equal(here.change, there.change)
    assert (np.abs(here.depth - there.depth) < 4 * there.error + 2e-3 * here.depth).all()


def test_unequal_pitch_breaks_the_regeneration_that_an_equal_pitch_suffers_from() -> None:
    """Pitches chosen for the speed: the waves of neighbouring teeth cancel, so the limit rises (Slavicek 1965)."""
    speed = 600 * RPM
    equal = collocation_limits(MODEL, _cutter(), np.array([speed]), 2e-3).depth[0]
    varied = _cutter(pitch_angles=tuple(np.radians([110.0, 120.0, 130.0])))
    assert collocation_limits(MODEL, varied, np.array([speed]), 2e-3).depth[0] > 1.5 * equal


def test_process_damping_raises_limits_more_the_slower_the_cut() -> None:
    speeds = np.array([300.0, 4800.0]) * RPM
    plain = collocation_limits(MODEL, _cutter(), speeds, 1e-2).lowest().depth_limits
    damped = collocation_limits(MODEL, _cutter(process_damping=3e4), speeds, 1e-2).lowest().depth_limits
    gain = damped / plain
    assert gain[0] > 1.5 * gain[1]
    assert (gain > 1).all()


def test_process_damping_agrees_between_collocation_and_multi_frequency() -> None:
    process, speeds = _cutter(process_damping=3e4), np.array([930.0, 1510.0]) * RPM
    here = collocation_limits(MODEL, process, speeds, 3e-3).lowest()
    there = multi_frequency_limits(MODEL, process, speeds, 3e-3).lowest()
    np.testing.assert_allclose(here.depth_limits, there.depth_limits, rtol=0.01)
    assert here.bifurcations == there.bifurcations


def test_nyquist_takes_the_mean_over_unequal_delays() -> None:
    """At pitches of all but the same size it is the zero-order solution."""
    third = 2 * np.pi / 3
    speeds = np.array([700.0, 1100.0]) * RPM
    near = nyquist_limits(MODEL, _cutter(pitch_angles=(third + 1e-7, third, third - 1e-7)), speeds, 5e-3)
    np.testing.assert_allclose(
        near.depth_limits, zero_order(MODEL, _cutter(), speeds, 5e-3).depth_limits, rtol=2e-3, atol=2e-8
    )


def test_what_a_solver_does_not_take_is_refused_with_the_one_that_does() -> None:
    speeds = np.array([1000 * RPM])
    with pytest.raises(InputError, match=r"zero-order.*unequal pitch.*collocation"):
        zero_order(MODEL, _cutter(pitch_angles=tuple(np.radians([100.0, 120.0, 140.0]))), speeds, 1e-3)
    with pytest.raises(InputError, match=r"multi-frequency.*helical.*collocation"):
        multi_frequency_limits(MODEL, _cutter(helix_angle=0.5), speeds, 1e-3)
    with pytest.raises(InputError, match=r"semi-discretisation.*process damping.*collocation"):
        semi_discretisation(MODEL, _cutter(process_damping=1e4), speeds, 1e-3)


@pytest.mark.parametrize(("zero", "limit"), [(1.0, 1.0), (0.8, 0.9), (1.2, 1.1)])
def test_a_limit_at_the_end_of_its_bracket_is_that_end(zero: float, limit: float) -> None:
    """The coarse growth has another sign than the exact one there; the search ended with an exception."""
    assert limit_between(lambda depth: depth - zero, Point(0.9, -0.1), Point(1.1, 0.1)) == pytest.approx(limit)
