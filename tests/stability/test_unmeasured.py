"""Modes that no measurement shows: the bound from the band, and the depth that they cannot destabilise.

The judge is `independent_floquet`, which shares no code with the solvers. Added modes are reciprocal, lie outside the
band, have at least 1 % damping and together at most the stated flexibility.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from independent_floquet import Mill, spectral_radius
from numpy.typing import ArrayLike

from millfrf.core import TIP
from millfrf.cutting import MillingProcess
from millfrf.stability import (
    RobustCut,
    UnmeasuredDynamics,
    certified_cut,
    certified_lobes,
    depth_errors,
    largest_unmeasured_part,
    multipliers,
    unmeasured_dynamics,
    unmeasured_flexibility,
)
from modal_fit import ModalModel, Residuals

RPM = np.pi / 30
NOTHING = np.zeros(0)
DEEPEST = 0.02


def structure(frequencies: ArrayLike, flexibilities: ArrayLike, damping: ArrayLike, shapes: ArrayLike) -> ModalModel:
    """Reciprocal modes: natural frequency (Hz), static flexibility (m/N) along the unit vector of ``shapes``."""
    natural = 2 * np.pi * np.asarray(frequencies, dtype=float)
    zeta, direction = np.asarray(damping, dtype=float), np.asarray(shapes, dtype=float)
    poles = natural * (-zeta + 1j * np.sqrt(1 - zeta**2))
    direction = direction / np.linalg.norm(direction, axis=1)[:, None]
    size = np.asarray(flexibilities) * natural**2 / (2j * poles.imag)
    return ModalModel(poles, size[:, None] * direction, direction + 0j, TIP, TIP)


def joined(*models: ModalModel) -> ModalModel:
    return replace(
        models[0],
        poles=np.concatenate([model.poles for model in models]),
        right=np.concatenate([model.right for model in models]),
        left=np.concatenate([model.left for model in models]),
        residuals=None,
    )


@dataclass(frozen=True)
class Cell:
    """A robot with one to three low modes, a cut, the upper edge of the measured band and the bound beyond it."""

    model: ModalModel
    cut: MillingProcess
    edge: float
    flexibility: float
    speed: float

    def radius(self, added: ModalModel, depth: float) -> float:
        whole, cut = joined(self.model, added), self.cut
        mill = Mill(cut.teeth, cut.edge_angle, cut.ktc, cut.krc, cut.kac, cut.start_angle, cut.exit_angle)
        return spectral_radius(whole.poles, whole.right, whole.left, mill, self.speed, depth)


def random_cell(rng: np.random.Generator) -> Cell:
    count, teeth = int(rng.integers(1, 4)), int(rng.integers(2, 5))
    model = structure(
        np.sort(rng.uniform(11, 42, count)),
        rng.uniform(2e-7, 1.5e-6, count),
        rng.uniform(0.015, 0.05, count),
        rng.normal(size=(count, 3)),
    )
    width = float(rng.choice([0.25, 0.5, 1.0])) * np.pi
    start = 0.0 if rng.random() < 0.5 else np.pi - width
    cut = MillingProcess(teeth, 0.016, np.pi / 2, float(rng.choice([6e8, 2e9])), 0.3, 0.1, start, start + width, 1e-4)
    flexibility = float(np.exp(rng.uniform(np.log(1e-9), np.log(1e-7))))
    passing = float(rng.uniform(60, 450))
    return Cell(model, cut, float(rng.choice([48.0, 100.0, 200.0])), flexibility, passing * 2 * np.pi / teeth)


def added_modes(rng: np.random.Generator, cell: Cell, line: float) -> ModalModel:
    """One to three orthogonal modes of the whole flexibility each; half of them near the line of the largest gain."""
    count = int(rng.integers(1, 4))
    near = max(line, cell.edge) * (1 + 0.02 * rng.normal(size=count))
    far = cell.edge * np.exp(rng.uniform(0, np.log(8), count))
    frequencies = np.maximum(np.where(rng.random(count) < 0.5, near, far), cell.edge)
    damping = 0.01 * (1 + rng.exponential(0.5, count) * (rng.random(count) < 0.3))
    shapes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:, :count].T
    return structure(frequencies, np.full(count, cell.flexibility), damping, shapes)


def attacked(seed: int, tries: int) -> tuple[float, float]:
    """Largest spectral radius of ``tries`` structures at the robust depth, and share of them unstable at twice it."""
    rng = np.random.default_rng(seed)
    cell = random_cell(rng)
    [limit] = certified_lobes(cell.model, cell.cut, np.array([cell.speed]), DEEPEST).depth_limits
    bound = UnmeasuredDynamics((5.0, cell.edge), cell.flexibility, 0.0, NOTHING, NOTHING, 0.01)
    robust = RobustCut(cell.model, cell.cut, bound)
    depth = robust.depth(cell.speed, min(float(limit), DEEPEST))
    assert 0 < depth <= min(limit, robust.highest_depth)
    line = robust.gain(cell.speed, depth).frequency
    added = [added_modes(rng, cell, line) for _ in range(tries)]
    broken = [cell.radius(modes, 2 * depth) > 1 for modes in added]
    return max(cell.radius(modes, depth) for modes in added), float(np.mean(broken))


@pytest.mark.parametrize("damping", [0.003, 0.01, 0.03, 0.1])
def test_all_modes_lie_in_the_disc(damping: float) -> None:
    bound = UnmeasuredDynamics((10.0, 100.0), 1.0, 0.0, NOTHING, NOTHING, damping)
    [centre], [radius] = bound.discs(np.array([150.0]))
    ratio = np.concatenate([np.linspace(0, 3, 30001), [10.0, 100.0]])
    for factor in (1.0, 1.5, 4.0):
        added = 1 / (1 - ratio**2 + 2j * factor * damping * ratio)
        assert np.abs(added - centre).max() <= radius
    assert abs(centre) <= radius < 1.2 * abs(centre) + 1


@pytest.mark.parametrize("lowest", [2.0, 6.0])
def test_modes_above_the_lowest_lie_in_the_disc_below_the_band(lowest: float) -> None:
    """Modes between the lowest one and the band, whose inertia line in the band is bounded, at frequencies below."""
    bound = UnmeasuredDynamics((10.0, 100.0), 0.0, 1e-5, NOTHING, NOTHING, 0.02, lowest_mode=lowest)
    frequencies = np.array([0.5, 1.9, 4.0, 9.0])
    centres, radii = bound.discs(frequencies)
    for natural in np.linspace(lowest, 10.0, 200):
        flexibility = 1e-5 / (2 * np.pi * natural) ** 2
        ratio = frequencies / natural
        added = flexibility / (1 - ratio**2 + 2j * 0.02 * ratio)
        assert (np.abs(added - centres) <= radii * (1 + 1e-12)).all()
    everything = UnmeasuredDynamics((10.0, 100.0), 0.0, 1e-5, NOTHING, NOTHING, 0.02)
    assert (radii <= everything.discs(frequencies)[1]).all()
    assert radii[0] < 0.9 * everything.discs(frequencies)[1][0]


def test_with_a_stated_lowest_mode_the_fitted_inertia_line_is_noise() -> None:
    model = structure([60, 90], [1e-7, 5e-8], [0.02, 0.03], np.eye(3)[:2])
    noise = Residuals(np.diag([1e-9, 1e-9, 0.0]), 1e-4 * np.diag([1.0, 1.0, 0.0]))
    model = replace(model, residuals=noise, band=(20.0, 200.0))
    stated = unmeasured_dynamics(replace(model, lowest_mode=30.0))
    unstated = unmeasured_dynamics(model)
    assert stated is not None
    assert unstated is not None
    assert unstated.inertance == pytest.approx(1e-4, rel=1e-6)
    assert stated.inertance == 0
    assert stated.in_band.max() < 1e-6 * unstated.in_band.max()


def test_the_imaginary_part_in_the_band_tells_what_lies_above_it() -> None:
    low = structure([12, 18, 25], [5e-7, 1e-6, 8e-7], [0.03, 0.03, 0.04], np.eye(3) + 0.5)
    hidden = structure([80], [1e-7], [0.02], [[1, 2, 0]])
    narrow, wide = (joined(low, hidden).frf(np.arange(6.0, high, 0.1)) for high in (48.0, 200.0))
    bounds = [unmeasured_flexibility(frf) or np.nan for frf in (narrow, wide)]
    assert 1e-7 < bounds[0] < 1.6e-7
    assert bounds[1] < 1e-9
    # a mode below the band shows its inertia line there
    above = unmeasured_dynamics(joined(low, hidden).frf(np.arange(15.0, 48.0, 0.1)))
    assert above is not None
    assert above.inertance == pytest.approx(5e-7 * (2 * np.pi * 12) ** 2, rel=2.0)


def test_a_model_without_a_band_holds_everywhere() -> None:
    model = structure([18], [1e-6], [0.03], [[1, 0, 0]])
    assert unmeasured_dynamics(model) is None
    stated = replace(model, band=(5.0, 200.0), unmeasured_flexibility=3e-9)
    assert unmeasured_flexibility(stated) == 3e-9


def test_out_of_band_terms_bound_modes_above_and_below() -> None:
    """Terms at the true poles outside the band: the bound holds them, within the amplification at the band's edge."""
    inside = structure([20, 30], [1e-6, 8e-7], [0.03, 0.04], [[1, 0.4, 0], [-0.3, 1, 0]])
    outside = structure([9, 90], [5e-7, 1e-7], [0.03, 0.02], [[1, 1, 0], [1, -2, 0]])
    terms = np.einsum("rp,rq->rpq", outside.right, outside.left)
    nothing = np.zeros((3, 3))
    model = replace(inside, residuals=Residuals(nothing, nothing, outside.poles, terms), band=(15.0, 48.0))
    bound = unmeasured_dynamics(model)
    assert bound is not None
    assert 1e-7 <= bound.flexibility < 1.7e-7
    assert 5e-7 * (2 * np.pi * 9) ** 2 <= bound.inertance < 3 * 5e-7 * (2 * np.pi * 9) ** 2


@pytest.mark.parametrize("seed", range(4))
def test_no_added_mode_destabilises_the_robust_depth(seed: int) -> None:
    worst, _ = attacked(seed, 12)
    assert worst < 1


@pytest.mark.slow
def test_no_added_mode_destabilises_the_robust_depth_in_thousands() -> None:
    results = [attacked(seed, 100) for seed in range(30)]
    assert max(worst for worst, _ in results) < 1
    # the bound is useful: at twice the depth added modes do destabilise most cells
    assert np.mean([broken > 0 for _, broken in results]) > 0.5


def below_the_band() -> tuple[ModalModel, ModalModel]:
    """A structure whose weak modes lie just below the fitted band, and its model from 16 to 60 Hz."""
    weak = structure([12.5, 14.0], [1e-6, 8e-7], [0.03, 0.03], [[1, 0.3, 0], [-0.3, 1, 0]])
    stiff = structure([30.0], [2e-8], [0.04], [[1, 1, 0]])
    terms = np.einsum("rp,rq->rpq", weak.right, weak.left)
    residuals = Residuals(np.zeros((3, 3)), np.zeros((3, 3)), weak.poles, terms)
    return joined(weak, stiff), replace(stiff, residuals=residuals, band=(16.0, 60.0))


def test_no_limit_is_not_verified_where_modes_lie_just_below_the_band() -> None:
    """It said "inf, verified" where the truth is finite."""
    truth, model = below_the_band()
    cut = MillingProcess(2, 0.016, np.pi / 2, 2e8, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
    speeds = np.linspace(300, 700, 9) * RPM
    true, lobes = (certified_lobes(structure, cut, speeds, DEEPEST) for structure in (truth, model))
    free = np.isinf(lobes.depth_limits)
    assert (free & np.isfinite(true.depth_limits)).any()
    for limit, actual, status in zip(lobes.depth_limits, true.depth_limits, lobes.status, strict=True):
        assert status == "unmeasured" or abs(min(limit, DEEPEST) / min(actual, DEEPEST) - 1) < 0.07


@pytest.mark.parametrize("helix", [0.0, 30.0])
def test_a_model_without_out_of_band_terms_is_not_taken_to_exclude_modes_below_its_band(helix: float) -> None:
    """It counted them as absent: limits five times too high were verified; with a helix modes below never counted."""
    whole = structure([13, 22], [1e-6, 1e-6], [0.03, 0.03], [[1, 0.3, 0], [-0.4, 1, 0]])
    model = replace(whole, poles=whole.poles[1:], right=whole.right[1:], left=whole.left[1:], band=(15.0, 300.0))
    cut = MillingProcess(2, 0.016, np.pi / 2, 1e9, 0.3, 0.0, 0.0, np.pi / 2, 1e-4, helix_angle=np.radians(helix))
    speeds = np.linspace(600, 2000, 5 if helix else 8) * RPM
    true, lobes = (certified_lobes(each, cut, speeds, 0.004) for each in (whole, model))
    off = np.abs(lobes.depth_limits / true.depth_limits - 1)
    assert off.max() > 1
    assert "verified" not in np.array(lobes.status)[off > 0.07]
    # from a tenth of its lowest mode on, a model that holds leaves no room for one that matters
    wide = certified_lobes(replace(whole, band=(0.3, 3000.0)), cut, speeds, 0.004)
    assert wide.band == ("measured",) * len(speeds)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_modes_within_the_bound_leave_a_helical_cut_stable_at_its_robust_depth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain = random_cell(rng)
    cell = replace(plain, cut=replace(plain.cut, helix_angle=float(rng.uniform(0.3, 0.9))))
    [limit] = certified_lobes(cell.model, cell.cut, np.array([cell.speed]), DEEPEST).depth_limits
    bound = UnmeasuredDynamics((5.0, cell.edge), cell.flexibility, 0.0, NOTHING, NOTHING, 0.01)
    robust = RobustCut(cell.model, cell.cut, bound)
    depth = robust.depth(cell.speed, min(float(limit), DEEPEST))
    assert 0 < depth <= min(limit, robust.highest_depth)
    line = robust.gain(cell.speed, depth).frequency
    wholes = [joined(cell.model, added_modes(rng, cell, line)) for _ in range(12)]
    radii = [multipliers(whole, cell.cut, cell.speed, depth).spectral_radius for whole in wholes]
    assert max(radii) < 1


def test_the_gain_of_a_helix_that_vanishes_is_that_of_straight_edges() -> None:
    cell = random_cell(np.random.default_rng(4))
    bound = UnmeasuredDynamics((5.0, cell.edge), cell.flexibility, 0.0, NOTHING, NOTHING, 0.01)
    straight, helical = (
        RobustCut(cell.model, replace(cell.cut, helix_angle=helix), bound).gain(cell.speed, 1e-4).gain
        for helix in (0.0, 1e-6)
    )
    assert helical == pytest.approx(straight, rel=1e-3)


def direct_terms(model: ModalModel) -> ModalModel:
    """The modes of X and of Y that two taps with one accelerometer show: each direction on its own."""
    parts = [replace(model, right=model.right * axis, left=model.left * axis) for axis in np.eye(3, dtype=complex)[:2]]
    direct = joined(*parts)
    names, measured = TIP[:2], np.eye(2, dtype=bool)
    right, left = direct.right[:, :2], direct.left[:, :2]
    return replace(
        direct, right=right, left=left, responses=names, excitations=names, measured=measured, band=(0.1, 5000.0)
    )


def test_cross_terms_that_were_not_measured_leave_the_robust_depth_stable() -> None:
    """Reciprocal modes at any angle: they were taken as absent, and limits of direct terms alone were verified."""
    rng = np.random.default_rng(0)
    fooled = 0
    for _ in range(12):
        angles = rng.uniform(0, np.pi, 3)
        shapes = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
        flexibility, damping = rng.uniform(3e-7, 1e-6, 3), rng.uniform(0.02, 0.05, 3)
        whole = structure(17 * (1 + 0.3 * rng.random(3)), flexibility, damping, shapes)
        cut = MillingProcess(3, 0.016, np.pi / 2, 6e8, 0.3, 0.0, 0.0, rng.choice([0.5, 1.0]) * np.pi, 1e-4)
        cell = Cell(whole, cut, 5000.0, 0.0, rng.uniform(17, 120) * 2 * np.pi / cut.teeth)
        model = direct_terms(whole)
        lobes = certified_lobes(model, cut, np.array([cell.speed]), DEEPEST)
        limit = min(float(lobes.depth_limits[0]), DEEPEST)
        assert lobes.status == lobes.band == ("unmeasured",)
        bound = unmeasured_dynamics(model)
        assert bound is not None
        depth = RobustCut(model, cut, bound).depth(cell.speed, limit)
        assert 0.02 * limit < depth < limit
        nothing = replace(whole, poles=whole.poles[:0], right=whole.right[:0], left=whole.left[:0])
        assert cell.radius(nothing, depth) < 1
        fooled += cell.radius(nothing, 0.93 * limit) > 1
    assert fooled > 0


@pytest.mark.parametrize("seed", range(5))
def test_direct_frfs_bound_the_cross_terms_at_antiresonances_too(seed: int) -> None:
    """Where direct terms of two modes cancel, ``sqrt(H_xx H_yy)`` was a tenth of cross terms that do not cancel."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    angles = rng.uniform(0, np.pi, count)
    shapes = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    whole = structure(
        rng.uniform(10, 80, count), rng.uniform(1e-7, 1e-6, count), rng.uniform(0.01, 0.05, count), shapes
    )
    frf = whole.frf(np.arange(3.0, 200.0, 0.1))
    direct = replace(frf, values=frf.values[:, :2, :2] * np.eye(2), responses=TIP[:2], excitations=TIP[:2])
    bound = unmeasured_dynamics(replace(direct, measured=np.eye(2, dtype=bool)))
    assert bound is not None
    assert bound.cross_terms is not None
    lines = frf.frequencies[(frf.frequencies > 5) & (frf.frequencies < 150)]
    terms = whole.receptance(lines)
    size, allowed = np.abs(terms[:, 0, 1]), bound.cross_terms(lines)
    assert (size < allowed).all()
    # a drive point in each direction is at its resonance as large as the bound, within a factor
    peaks = np.sqrt(np.abs(terms[:, 0, 0] * terms[:, 1, 1]))
    assert np.median(allowed / peaks) < 2


def test_a_recommended_cut_holds_for_whatever_lies_beyond_the_band() -> None:
    """Measured to 48 Hz, with a mode at 80 Hz: 15 mm were recommended where 12 mm are stable."""
    low = structure([14, 21, 30], [1e-6, 8e-7, 5e-7], [0.03, 0.03, 0.04], [[1, 0.3, 0], [-0.4, 1, 0], [0.5, 0.8, 0]])
    hidden = structure([80], [2e-8], [0.02], [[1, 1, 0]])
    terms = Residuals(hidden.receptance(np.linspace(8, 48, 50)).real.mean(axis=0), np.zeros((3, 3)))
    model = replace(low, residuals=terms, band=(8.0, 48.0))
    cut = MillingProcess(3, 0.016, np.pi / 2, 2e8, 0.3, 0.1, np.pi / 2, np.pi, 1e-4, ktc_std=4e6)
    speeds = np.linspace(30, 200, 40) * 2 * np.pi / cut.teeth
    lobes = certified_lobes(model, cut, speeds, DEEPEST)
    errors = depth_errors(model, cut, lobes)
    advised = certified_cut(model, cut, lobes, errors, max_depth=DEEPEST)
    unaware = certified_cut(replace(model, band=None), cut, lobes, errors, max_depth=DEEPEST)
    assert advised.unmeasured_share < 0.9
    bound = unmeasured_flexibility(model)
    assert bound is not None
    rng = np.random.default_rng(3)
    fooled = 0
    for others in (hidden, *(added_modes(rng, Cell(low, cut, 48.0, bound, 0.0), 90.0) for _ in range(40))):
        for chosen, drift in ((advised, -0.02), (advised, 0.0), (advised, 0.02), (unaware, 0.0)):
            cell = Cell(low, cut, 48.0, bound, chosen.spindle_speed * (1 + drift))
            stable = cell.radius(others, chosen.depth) < 1
            assert stable or chosen is unaware
            fooled += not stable
    assert fooled


def test_an_accelerance_and_its_receptance_have_the_same_band() -> None:
    frf = structure([12, 18, 25], [5e-7, 1e-6, 8e-7], [0.03, 0.03, 0.04], np.eye(3) + 0.5).frf(
        np.arange(6.0, 90.0, 0.1)
    )
    squared = (2j * np.pi * frf.frequencies[:, None, None]) ** 2
    measured = replace(frf, values=frf.values * squared, quantity="accelerance", unit="m/s^2/N")
    cut = MillingProcess(3, 0.016, np.pi / 2, 6e8, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
    first, second = (certified_lobes(dynamics, cut, np.array([60.0]), 0.002) for dynamics in (frf, measured))
    assert first.band == second.band != ("not-stated",)


@pytest.mark.parametrize("part", ["below", "above", "inside", "cross", "several"])
def test_the_part_that_takes_most_of_the_depth_is_named(part: str) -> None:
    model = structure([600.0, 750.0], [2e-7, 2e-7], [0.03, 0.03], [[1, 0, 0], [0, 1, 0]])
    cut, speed = MillingProcess(3, 0.016, np.pi / 2, 8e8, 0.3, 0.0, np.pi / 2, np.pi, 1e-4), 9000 * RPM
    lines = np.linspace(100.0, 3000.0, 50)
    small = UnmeasuredDynamics((100.0, 3000.0), 1e-12, 1e-6, lines, np.full(50, 1e-12), 0.01, lambda f: 1e-12 + 0 * f)
    large: dict[str, dict[str, Any]] = {
        "below": {"inertance": 0.3},
        "above": {"flexibility": 2e-7},
        "inside": {"in_band": np.full(50, 2e-7)},
        "cross": {"cross_terms": lambda frequencies: 2e-7 + 0 * frequencies},
    }
    # two parts, each of which alone leaves little
    both = {"in_band": np.full(50, 1e-5), "cross_terms": lambda frequencies: 1e-5 + 0 * frequencies}
    chosen: dict[str, dict[str, Any]] = {part: both if part == "several" else large[part]}
    unmeasured = replace(small, **{name: value for change in chosen.values() for name, value in change.items()})
    named, frequency = largest_unmeasured_part(model, cut, unmeasured, speed, 1.5e-3)
    assert named == part
    assert frequency > 0
