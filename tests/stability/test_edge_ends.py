"""Edge forces whose ends a vibration moves: against mean forces, and against simulations in time."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.core import TIP
from millfrf.cutting import MillingProcess, edge_end_harmonics, thin_ends
from millfrf.gate import edge_end_warnings
from millfrf.stability import (
    EdgeEndEffect,
    ProductionCut,
    StabilityLobes,
    edge_end_effect,
    multi_frequency,
    simulate_cut,
    uncertain_by_edge_ends,
    with_edge_ends,
)
from millfrf.stability.learning.production_cuts import predicted
from modal_fit import ModalModel

HALF = MillingProcess(
    3, 0.012, np.pi / 2, 850e6, 0.3, 0.2, np.pi / 2, np.pi, 8e-5, kte=22e3, kre=25e3, kae=3e3
)  # down milling: the chip ends at zero
SLOT = replace(HALF, start_angle=0.0)
SPEED = 6000 * np.pi / 30


def _tip() -> ModalModel:
    poles, right, left = [], [], []
    for axis, frequency, damping, stiffness in ((0, 780.0, 0.03, 1.8e7), (1, 720.0, 0.035, 1.6e7)):
        omega = 2 * np.pi * frequency
        pole = omega * (-damping + 1j * np.sqrt(1 - damping**2))
        shape = np.eye(3)[axis]
        poles.append(pole)
        right.append(shape + 0j)
        left.append(shape * omega**2 / stiffness / (2j * pole.imag))
    return ModalModel(np.array(poles), np.array(right), np.array(left), TIP, TIP)


def _mean_force(process: MillingProcess, moved: np.ndarray) -> np.ndarray:
    """Return the mean force per depth while the chip is thicker by ``n . moved``; a tooth beyond its ends cuts too."""
    wide = 0.2 * (np.array([process.start_angle, process.exit_angle]) == [0.0, np.pi])
    phi = np.linspace(process.start_angle - wide[0], process.exit_angle + wide[1], 400_001)
    normal = np.array([np.sin(phi), np.cos(phi), 0 * phi])
    chip = process.feed_per_tooth * np.sin(phi) + moved @ normal
    tangential, radial, axial = (
        np.where(chip > 0, process.ktc * share * chip + edge, 0.0)
        for share, edge in ((1.0, process.kte), (process.krc, process.kre), (process.kac, process.kae))
    )
    on_tool = [
        -tangential * np.cos(phi) - radial * np.sin(phi),
        tangential * np.sin(phi) - radial * np.cos(phi),
        -axial,
    ]
    return process.teeth / (2 * np.pi) * np.trapezoid(np.array(on_tool), phi, axis=1)


@pytest.mark.parametrize("process", [HALF, SLOT])
def test_the_mean_of_the_impulse_is_the_slope_of_the_mean_edge_force(process: MillingProcess) -> None:
    edges, step = replace(process, ktc=1e-3), 1e-6
    slopes = [(_mean_force(edges, step * unit) - _mean_force(edges, -step * unit)) / (2 * step) for unit in np.eye(3)]
    mean = edge_end_harmonics(process, np.array([0]))[0]
    assert mean.real == pytest.approx(np.transpose(slopes), rel=2e-2, abs=1e-3 * np.abs(mean).max())
    assert mean.imag == pytest.approx(0)


def test_only_ends_without_a_chip_are_moved() -> None:
    assert list(thin_ends(HALF)) == [np.pi]
    inner = replace(HALF, exit_angle=2.5)
    assert len(thin_ends(inner)) == 0
    assert edge_end_effect(_tip(), inner, np.array([SPEED]), 0.01) is None
    assert edge_end_effect(_tip(), replace(HALF, kte=0.0, kre=0.0, kae=0.0), np.array([SPEED]), 0.01) is None
    assert edge_end_warnings(inner, None) == []


def test_an_effect_that_is_not_known_is_stated() -> None:
    unequal = replace(HALF, pitch_angles=(2.0, 2.1, 2 * np.pi - 4.1))
    assert edge_end_effect(_tip(), unequal, np.array([SPEED]), 0.01) is None
    (warning,) = edge_end_warnings(unequal, None)
    assert "is not known at unequal pitch" in warning


def test_limits_that_edge_forces_lower_by_more_than_a_certain_one_allows_are_uncertain() -> None:
    speeds = np.array([300.0, 400.0, 500.0, 600.0, 700.0])
    lobes = StabilityLobes(
        speeds,
        np.array([1e-3, 2e-3, np.nan, 1e-3, np.inf]),
        np.full(5, np.nan),
        ("none",) * 5,
        "certified",
        status=("verified", "unmeasured", "unresolved", "verified", "verified"),
        model=("certain",) * 5,
    )
    effect = EdgeEndEffect(np.array([300.0, 500.0, 600.0]), np.array([0.02, 0.2, 0.05]))
    marked = uncertain_by_edge_ends(lobes, effect)
    assert marked.status == ("verified", "unmeasured", "unresolved", "verified", "verified")
    assert marked.model == ("certain", "uncertain", "certain", "certain", "certain")
    everywhere = uncertain_by_edge_ends(lobes, EdgeEndEffect(np.array([450.0]), np.array([0.2])))
    assert everywhere.status == ("uncertain", "unmeasured", "unresolved", "uncertain", "uncertain")


def test_a_cut_in_production_between_both_limits_is_expected_to_chatter() -> None:
    effect = edge_end_effect(_tip(), HALF, np.array([SPEED]), 0.01)
    assert effect is not None
    limit = multi_frequency(_tip(), HALF, np.array([SPEED]), 0.01).depth_limits[0]
    cut = ProductionCut("cut", SPEED, (1 - effect.lowered / 2) * limit, "hopf")
    [moved] = with_edge_ends(_tip(), HALF, [cut], 0.01)
    assert moved.left_by_edges == pytest.approx(1 - effect.lowered)
    growth = predicted([(_tip(), HALF)], [cut, moved]).growth[0]
    assert growth[0] < 0 < growth[1]


@pytest.mark.long
def test_simulations_in_time_find_the_lowered_limit() -> None:
    limits = [
        multi_frequency(_tip(), HALF, np.array([SPEED]), 0.01, edge_ends=ends).depth_limits[0] for ends in (False, True)
    ]
    effect = edge_end_effect(_tip(), HALF, np.array([SPEED]), 0.01)
    assert effect is not None
    assert effect.lowered == pytest.approx(1 - limits[1] / limits[0])
    assert effect.lowered == pytest.approx(0.2, abs=0.02)
    assert f"{100 * effect.lowered:.0f} % lower" in edge_end_warnings(HALF, effect)[0]
    # discs switch an edge in steps of a degree, which keeps a motion of some per cent up from 5 % below the limit on
    below, between = (
        simulate_cut(_tip(), HALF, SPEED, depth, turns=600) for depth in (0.9 * limits[1], 0.5 * sum(limits))
    )
    assert below.repeats
    assert between.unsteadiness > 0.5  # lobes without the effect call it stable
    smooth = replace(HALF, kte=0.0, kre=0.0, kae=0.0)
    assert simulate_cut(_tip(), smooth, SPEED, 0.5 * sum(limits), turns=600).repeats
