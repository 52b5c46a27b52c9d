"""Tool and workpiece that both move."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_cuts import random_case
from independent_floquet import Mill, spectral_radius

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes, depth_errors, with_workpiece
from modal_fit import ModalModel, Residuals, derived_covariance, pack_parameters


def model_of(seed: int, labels: tuple[str, ...] = ("T:+X", "T:+Y", "T:+Z")) -> ModalModel:
    """Two modes with a covariance of small errors."""
    rng = np.random.default_rng(seed)
    natural = 2 * np.pi * rng.uniform(300, 900, 2)
    shape = rng.uniform(-1, 1, (2, len(labels)))
    mass = 0.4
    right = shape / (2j * natural[:, None] * mass)
    model = ModalModel(natural * (-0.02 + 1j), right, shape + 0j, labels, labels)
    return replace(model, covariance=np.diag((0.003 * np.abs(pack_parameters(model))) ** 2))


def test_receptances_add_up_in_any_order_and_sign_of_directions() -> None:
    tool, wall = model_of(1), model_of(2, ("P7:-Y", "P7:+X"))
    both = with_workpiece(tool, wall)
    lines = np.linspace(100, 1000, 50)
    expected = tool.receptance(lines)
    own = wall.receptance(lines)
    expected[:, 0, 0] += own[:, 1, 1]
    expected[:, 1, 1] += own[:, 0, 0]
    expected[:, 0, 1] -= own[:, 1, 0]
    expected[:, 1, 0] -= own[:, 0, 1]
    assert both.responses == tool.responses
    assert np.allclose(both.receptance(lines), expected, rtol=1e-12)


def test_errors_of_both_reach_the_sum() -> None:
    tool, wall = model_of(1), model_of(2, ("P7:-Y", "P7:+X"))
    both = with_workpiece(tool, wall)

    def line(model: ModalModel) -> np.ndarray:
        value = model.receptance(np.array([500.0]))[0]
        return np.array([value[0, 0].real, value[0, 0].imag])

    def line_of_wall(model: ModalModel) -> np.ndarray:
        value = model.receptance(np.array([500.0]))[0]
        return np.array([value[1, 1].real, value[1, 1].imag])

    parts = [derived_covariance(tool, line), derived_covariance(wall, line_of_wall)]
    joined = derived_covariance(both, line)
    assert parts[0] is not None
    assert parts[1] is not None
    assert joined == pytest.approx(parts[0] + parts[1], rel=1e-6)


def test_limits_with_a_workpiece_are_those_of_independent_multipliers() -> None:
    tool, wall = model_of(3), model_of(4)
    cut = MillingProcess(3, 0.012, math.pi / 2, 7e8, 0.3, 0.1, 0.0, math.pi / 2, 1e-4)
    both = replace(with_workpiece(tool, wall), covariance=None)
    speeds = np.array([3000.0, 7000.0]) * np.pi / 30
    limits = certified_lobes(both, cut, speeds, 0.01).depth_limits
    mill = Mill(cut.teeth, cut.edge_angle, cut.ktc, cut.krc, cut.kac, cut.start_angle, cut.exit_angle)
    poles = np.concatenate([tool.poles, wall.poles])
    right, left = np.concatenate([tool.right, wall.right]), np.concatenate([tool.left, wall.left])
    for speed, limit in zip(speeds, limits, strict=True):
        below, above = (spectral_radius(poles, right, left, mill, float(speed), s * limit) for s in (0.99, 1.01))
        assert below < 1 < above


def test_two_halves_of_a_structure_have_the_limits_and_errors_of_the_whole() -> None:
    case = random_case(2)
    model, half = case.model, len(case.model.poles) // 2
    assert model.covariance is not None

    def part(chosen: slice) -> ModalModel:
        return replace(
            model, poles=model.poles[chosen], right=model.right[chosen], left=model.left[chosen], covariance=None
        )

    both = with_workpiece(part(slice(half)), part(slice(half, None)))
    both = replace(both, covariance=model.covariance)
    speeds = case.speeds[::12]
    whole, joined = (certified_lobes(each, case.cut, speeds, case.max_depth) for each in (model, both))
    assert joined.depth_limits == pytest.approx(whole.depth_limits)
    assert depth_errors(both, case.cut, joined) == pytest.approx(depth_errors(model, case.cut, whole), nan_ok=True)


def test_residuals_bands_and_bounds_are_joined() -> None:
    upper = np.diag([1e-8, 2e-8, 3e-8])
    tool = replace(model_of(1), residuals=Residuals(upper, 0 * upper), band=(50.0, 900.0), unmeasured_flexibility=1e-9)
    wall = replace(model_of(2), band=(100.0, 2000.0), unmeasured_flexibility=2e-9)
    both = with_workpiece(tool, wall)
    assert both.band == (100.0, 900.0)
    assert both.unmeasured_flexibility == pytest.approx(3e-9)
    assert both.residuals is not None
    assert np.array_equal(both.residuals.upper, upper)


def test_what_cannot_be_added_is_refused() -> None:
    tool = replace(model_of(1), band=(10.0, 50.0))
    with pytest.raises(InputError, match="do not meet"):
        with_workpiece(tool, replace(model_of(2), band=(100.0, 500.0)))
    with pytest.raises(InputError, match="terms of a diagnosis"):
        with_workpiece(tool, replace(model_of(2), physics=({"name": "gap"},)))
