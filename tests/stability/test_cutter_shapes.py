"""Limits of cutters of all shapes against a simulation in time that shares no code with them."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_cutters import DEEPEST, LABELS, TWO_MODES, cut_of, judge_limit, modal_model, random_cutter
from sliced_mill import Discs, cylinder_discs, grows

from estimation import Frf
from millfrf.core import InputError
from millfrf.cutting import MillingProcess, ball_profile, bull_nose_profile, straight_profile
from millfrf.stability import certified_numerics, delay_system, depth_search
from millfrf.stability.floquet.cut_period import collocated_cut
from millfrf.stability.floquet.growth import leading_multipliers, monodromy
from millfrf.stability.settings import SETTINGS

RPM = math.pi / 30
DIAMETER, KTC, KRC, KAC, FEED = 0.012, 8e8, 0.35, 0.15, 1e-4


def _agrees(
    process: MillingProcess, discs_at: Callable[[float], Discs], rpm: float, max_depth: float, share: float = 0.02
) -> float:
    """Check that the simulation decays below the limit and grows above it; return the limit."""
    structure = TWO_MODES
    lobes = certified_numerics(modal_model(structure), process, np.array([rpm * RPM]), max_depth)
    assert lobes.status == ("verified",)
    limit = float(lobes.depth_limits[0])
    assert np.isfinite(limit)
    cut = cut_of(process)
    below, above = (grows(discs_at((1 + sign * share) * limit), cut, structure, rpm * RPM) for sign in (-1, 1))
    assert below < 0 < above, (limit, below, above)
    return limit


def _process(teeth: int, start: float, leave: float, **changes: Any) -> MillingProcess:
    return MillingProcess(teeth, DIAMETER, math.pi / 2, KTC, KRC, KAC, start, leave, FEED, **changes)


def _even(teeth: int) -> np.ndarray:
    return 2 * math.pi * np.arange(teeth) / teeth


@pytest.mark.parametrize(
    ("rpm", "start", "leave"), [(4000.0, 0.0, math.pi), (6300.0, 2.2, math.pi), (9000.0, 0.0, 1.0)]
)
def test_ball_end_mill(rpm: float, start: float, leave: float) -> None:
    process = _process(2, start, leave, helix_angle=0.5, profile=ball_profile(DIAMETER))
    helices = np.full(2, 0.5)
    _agrees(process, lambda a: cylinder_discs(a, DIAMETER, _even(2), helices, corner=DIAMETER / 2), rpm, 0.01)


@pytest.mark.parametrize("rpm", [3500.0, 7200.0])
def test_bull_nose_end_mill(rpm: float) -> None:
    process = _process(3, 1.9, math.pi, helix_angle=0.6, profile=bull_nose_profile(DIAMETER, 2e-3))
    helices = np.full(3, 0.6)
    _agrees(process, lambda a: cylinder_discs(a, DIAMETER, _even(3), helices, corner=2e-3), rpm, 0.01)


@pytest.mark.parametrize("rpm", [3100.0, 5200.0])
def test_helix_angles_that_differ(rpm: float) -> None:
    helices = np.radians([35.0, 38.0, 35.0, 38.0])
    process = _process(4, 0.0, math.pi, helix_angles=tuple(helices.tolist()))
    _agrees(process, lambda a: cylinder_discs(a, DIAMETER, _even(4), helices), rpm, 0.01)


@pytest.mark.parametrize("rpm", [3100.0, 5200.0])
def test_pitch_and_helix_that_differ(rpm: float) -> None:
    helices, pitches = np.radians([30.0, 35.0, 30.0]), np.radians([115.0, 120.0, 125.0])
    process = _process(3, 0.0, 1.4, helix_angles=tuple(helices.tolist()), pitch_angles=tuple(pitches.tolist()))
    angles = np.concatenate([[0.0], np.cumsum(pitches)[:-1]])
    _agrees(process, lambda a: cylinder_discs(a, DIAMETER, angles, helices), rpm, 0.01)


@pytest.mark.parametrize("rpm", [4100.0, 6000.0])
def test_runout_that_takes_teeth_out_of_the_cut(rpm: float) -> None:
    process = _process(3, 1.6, math.pi, helix_angle=0.5, runout=6e-5)
    assert process.runout_decides

    def discs(depth: float) -> Discs:
        plain = cylinder_discs(depth, DIAMETER, _even(3), np.full(3, 0.5))
        plain.offset[:] = 6e-5 * np.cos(_even(3))[:, None]
        return plain

    _agrees(process, discs, rpm, 0.012)


@pytest.mark.parametrize("rpm", [4100.0, 6000.0])
def test_serrated_edges(rpm: float) -> None:
    process = _process(3, 0.0, math.pi, serration_amplitude=2e-4, serration_wavelength=1.5e-3)

    def discs(depth: float) -> Discs:
        count = int(64 * max(1.0, depth / 1.5e-3))
        plain = cylinder_discs(depth, DIAMETER, _even(3), np.zeros(3), count=count)
        heights = (np.arange(count) + 0.5) * depth / count
        plain.offset[:] = 2e-4 * np.cos(2 * math.pi * heights / 1.5e-3 + _even(3)[:, None])
        return plain

    _agrees(process, discs, rpm, 0.012)


def test_a_lead_angle_thins_the_chip_and_pushes_along_the_axis() -> None:
    angle = math.radians(45.0)
    process = _process(4, 1.0, 2.2, profile=straight_profile(DIAMETER, angle))

    def discs(depth: float) -> Discs:
        plain = cylinder_discs(depth, DIAMETER, _even(4), np.zeros(4))
        middle = (np.arange(40) + 0.5) * depth / 40
        return Discs(
            DIAMETER / 2 + middle, np.full(40, angle), plain.width / math.sin(angle), plain.angle, plain.offset
        )

    _agrees(process, discs, 5100.0, 0.01)


def test_process_damping_with_a_helix() -> None:
    process = _process(2, 0.0, math.pi, helix_angle=0.5, process_damping=2e4)
    _agrees(process, lambda a: cylinder_discs(a, DIAMETER, _even(2), np.full(2, 0.5)), 2500.0, 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_cutters(seed: int) -> None:
    judge_limit(random_cutter(seed))


@pytest.mark.parametrize("seed", [seed for seed in range(300, 340) if not random_cutter(seed).process.has_offsets])
def test_few_nodes_confuse_no_stable_cut_with_an_unstable_one(seed: int) -> None:
    """Against all eigenvalues of the dense map of a period with all nodes; edges whose offsets decide need all."""
    drawn = random_cutter(seed)
    system = delay_system(modal_model(drawn.structure), drawn.process)
    for depth in np.geomspace(DEEPEST / 50, DEEPEST, 3).tolist():
        exact = np.abs(np.linalg.eigvals(monodromy(collocated_cut(system, drawn.speed, depth)))).max()
        coarse = collocated_cut(system, drawn.speed, depth, coarse=True)
        radius = leading_multipliers(coarse, tolerance=1e-5).radius
        if exact > 1.02:
            assert radius > 1, (depth, exact)
        else:  # how fast the growth changes here decides how far the next depth may be
            assert abs(max(radius, 0.02) - max(exact, 0.02)) < 0.02 * max(exact, 0.02), (depth, exact)


@pytest.mark.parametrize("seed", [0, 5, 23, 59, 81, 118, 202, 247, 301])
def test_depths_that_double_far_below_a_limit_miss_none(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Steps of 30 % throughout lead to the same limit, within the thickness of islands that either may miss."""
    drawn = random_cutter(seed)
    arguments = modal_model(drawn.structure), drawn.process, np.array([drawn.speed]), DEEPEST
    [limit] = certified_numerics(*arguments).depth_limits
    monkeypatch.setattr(depth_search, "SETTINGS", replace(SETTINGS, largest_ratio=SETTINGS.ladder_ratio))
    [expected] = certified_numerics(*arguments).depth_limits
    assert limit == pytest.approx(expected, rel=SETTINGS.thinnest_island)


def test_the_lowest_of_several_limits_between_two_depths_is_found() -> None:
    """Unequal teeth have an island of instability just below their limit, 7 % thick: judged by the simulation."""
    drawn = random_cutter(23)
    [limit] = certified_numerics(
        modal_model(drawn.structure), drawn.process, np.array([drawn.speed]), DEEPEST
    ).depth_limits
    assert limit == pytest.approx(1.274e-3, rel=0.01)
    growth = [
        grows(drawn.discs(share * limit), cut_of(drawn.process), drawn.structure, drawn.speed)
        for share in (0.98, 1.03, 1.075)
    ]
    assert growth[0] < 0 < growth[1]
    assert growth[2] < 0  # stable again above the island


def test_a_taper_that_widens_the_engagement_is_sliced() -> None:
    """Edges of 37 deg enter at 162 deg at their tip and 25 deg earlier at 3 mm: a single slice is 7 % too deep."""
    drawn = random_cutter(18)
    [limit] = certified_numerics(
        modal_model(drawn.structure), drawn.process, np.array([drawn.speed]), DEEPEST
    ).depth_limits
    below, above = (
        grows(drawn.discs(share * limit), cut_of(drawn.process), drawn.structure, drawn.speed) for share in (0.98, 1.02)
    )
    assert below < 0 < above


def test_a_corner_radius_that_vanishes_leaves_a_square_end_mill() -> None:
    speeds = np.array([3500.0, 7200.0]) * RPM
    square = certified_numerics(modal_model(TWO_MODES), _process(3, 1.9, math.pi, helix_angle=0.6), speeds, 0.01)
    process = _process(3, 1.9, math.pi, helix_angle=0.6, profile=bull_nose_profile(DIAMETER, 1e-7))
    np.testing.assert_allclose(
        certified_numerics(modal_model(TWO_MODES), process, speeds, 0.01).depth_limits,
        square.depth_limits,
        rtol=1e-3,
    )


def test_equal_helix_angles_by_tooth_give_the_limits_of_one_helix() -> None:
    speeds = np.array([3500.0, 7200.0]) * RPM
    single, first = (
        certified_numerics(modal_model(TWO_MODES), _process(3, 1.9, math.pi, **shape), speeds, 0.01).depth_limits
        for shape in ({"helix_angle": 0.6}, {"helix_angles": (0.6, 0.6 + 1e-7, 0.6)})
    )
    np.testing.assert_allclose(single, first, rtol=1e-5)


def test_a_depth_below_which_two_edges_meet_is_refused_with_its_reason() -> None:
    """All speeds were unresolved without a word on the cutter."""
    process = _process(4, 0.0, math.pi, helix_angles=(0.3, 0.8, 0.3, 0.8))
    with pytest.raises(InputError, match="two edges come within"):
        certified_numerics(modal_model(TWO_MODES), process, np.array([4000 * RPM]), 0.02)


@pytest.mark.parametrize("rpm", [1500.0, 4000.0])
def test_process_damping_of_a_taper_counts_the_fastest_part_of_the_edge(rpm: float) -> None:
    """Damping falls with the cutting speed: with that of the tip a wide taper would have too high a limit."""
    angle = math.radians(30.0)
    process = _process(2, 0.0, math.pi, profile=straight_profile(DIAMETER, angle), process_damping=2e4)
    structure = TWO_MODES
    [limit] = certified_numerics(modal_model(structure), process, np.array([rpm * RPM]), 0.02).depth_limits
    assert np.isfinite(limit)
    middle = (np.arange(40) + 0.5) * 0.98 * limit / 40
    even = cylinder_discs(0.98 * limit, DIAMETER, _even(2), np.zeros(2))
    radius, width = DIAMETER / 2 + middle / math.tan(angle), even.width / math.sin(angle)
    discs = Discs(radius, np.full(40, angle), width, even.angle, even.offset)
    assert grows(discs, cut_of(process), structure, rpm * RPM) < 0


def test_an_frf_with_a_cutter_that_needs_a_model_is_refused_with_a_remedy_that_works() -> None:
    """The message said "use collocation", which takes no FRF."""
    model = modal_model(TWO_MODES)
    frequencies = np.linspace(1.0, 1000.0, 400)
    values = model.receptance(frequencies)
    frf = Frf(frequencies, values, LABELS, LABELS, "receptance", "m/N", frequencies > 0)
    process = _process(2, 0.0, math.pi, profile=ball_profile(DIAMETER))
    with pytest.raises(InputError, match="fit it, and give the model"):
        certified_numerics(frf, process, np.array([4000 * RPM]), 0.01)
