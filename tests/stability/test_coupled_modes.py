"""Mode coupling against regeneration: cases whose answer is known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.core import TIP
from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes, judge_mode_coupling, mode_coupling_limit, with_static_high_modes
from millfrf.steps.lobes import mode_coupling_line
from modal_fit import ModalModel, Residuals

CUT = MillingProcess(4, 0.02, np.pi / 2, 800e6, 0.3, 0.1, 0.0, np.pi, 1e-4)
SPEED = 6000 * np.pi / 30


def structure(frequencies: list[float], directions: list[float], ratio: float = 0.04, mass: float = 40.0) -> ModalModel:
    """Real modes that move in X and Y at the given angles, rad."""
    natural = 2 * np.pi * np.array(frequencies)
    damped = natural * np.sqrt(1 - ratio**2)
    shapes = np.column_stack([np.cos(directions), np.sin(directions), np.zeros(len(directions))]) / np.sqrt(mass)
    left = shapes / (2j * damped[:, None])
    return ModalModel(-ratio * natural + 1j * damped, shapes.astype(complex), left, TIP, TIP)


def test_one_mode_cannot_couple() -> None:
    result = judge_mode_coupling(structure([20.0], [0.6]), CUT, SPEED / 10, 0.05)
    assert result.alone == result.limit
    assert result.decides == "regeneration"
    assert "regeneration decides" in result.words


def test_two_close_modes_that_are_stable_alone_grow_together() -> None:
    """Perpendicular modes at 18 and 19.5 Hz: each alone is stable to 22 mm, together they grow."""
    down = MillingProcess(4, 0.02, np.pi / 2, 800e6, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
    model = structure([18.0, 19.5], [1.0, 1.0 + np.pi / 2])
    result = judge_mode_coupling(model, down, SPEED / 2, 0.05)
    assert result.decides == "mode coupling"
    assert result.without_regeneration == pytest.approx(mode_coupling_limit(model, down, 0.05).depth)
    assert result.without_regeneration <= 1.1 * result.limit < result.alone
    single = [
        certified_lobes(structure([f], [d]), down, np.array([SPEED / 2]), 0.05).depth_limits[0]
        for f, d in ((18.0, 1.0), (19.5, 1.0 + np.pi / 2))
    ]
    assert result.alone == pytest.approx(min(single), rel=1e-9)
    assert "mode coupling decides" in result.words


def test_no_limit_is_said_to_be_none() -> None:
    stiff = structure([20.0], [0.6], mass=1e6)
    assert judge_mode_coupling(stiff, CUT, SPEED, 0.01).decides == "no limit"


def test_high_modes_left_static_keep_statics_and_limits() -> None:
    model = structure([18.0, 25.0, 900.0], [0.3, 1.4, 0.8])
    small = with_static_high_modes(model, 100.0)
    assert len(small.poles) == 2
    lines = np.array([0.0, 10.0, 30.0])
    assert (
        np.abs(small.receptance(lines) - model.receptance(lines)).max() < 2e-3 * np.abs(model.receptance(lines)).max()
    )
    speeds = np.array([100.0, 300.0])
    limits = [certified_lobes(each, CUT, speeds, 0.05).depth_limits for each in (model, small)]
    assert limits[1] == pytest.approx(limits[0], rel=2e-3)


def growth_of_masses(modes: list[tuple[float, float, float, np.ndarray]], stiffness: np.ndarray) -> float:
    """Largest real part of the eigenvalues of ``q'' + 2 z w q' + w^2 q = shape F``, ``F = stiffness X``, from masses.

    A mode is its frequency (Hz), damping ratio, static flexibility (m/N) and unit shape.
    """
    natural = 2 * np.pi * np.array([mode[0] for mode in modes])
    shapes = np.array([natural[k] * np.sqrt(mode[2]) * mode[3] for k, mode in enumerate(modes)])
    damping = np.diag([2 * mode[1] * w for mode, w in zip(modes, natural, strict=True)])
    spring = np.diag(natural**2) - shapes @ stiffness @ shapes.T
    count = len(modes)
    state = np.block([[np.zeros((count, count)), np.eye(count)], [-spring, -damping]])
    return float(np.linalg.eigvals(state).real.max())


@pytest.mark.parametrize(("flexibility", "kind"), [(1e-7, "hopf"), (4e-5, "fold")])
def test_a_residual_flexibility_acts_as_a_very_stiff_mode(flexibility: float, kind: str) -> None:
    """The larger one, along the direction of the largest negative stiffness, gives way before the modes couple."""
    down = MillingProcess(4, 0.02, np.pi / 2, 800e6, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
    # four teeth, each in the cut for a quarter of the turn: one tooth at any time
    angle = np.linspace(np.pi / 2, np.pi, 4001)
    normal = np.column_stack([np.sin(angle), np.cos(angle), 0 * angle])
    force = np.column_stack([-np.cos(angle), np.sin(angle), 0 * angle]) - 0.3 * normal - 0.1 * np.array([0, 0, 1.0])
    mean = 800e6 * np.trapezoid(force[:, :, None] * normal[:, None, :], angle, axis=0) / (np.pi / 2)
    shape = np.linalg.eigh(mean + mean.T)[1][:, -1]
    frequencies, angles, ratio, mass = [18.0, 19.5], [1.0, 1.0 + np.pi / 2], 0.04, 40.0
    residuals = Residuals(flexibility * np.outer(shape, shape), np.zeros((3, 3)))
    limit = mode_coupling_limit(replace(structure(frequencies, angles), residuals=residuals), down, 0.05)
    modes = [
        (frequency, ratio, 1 / (mass * (2 * np.pi * frequency) ** 2), np.array([np.cos(turn), np.sin(turn), 0.0]))
        for frequency, turn in zip(frequencies, angles, strict=True)
    ]
    modes.append((1e6, 0.5, flexibility, shape))
    assert limit.kind == kind
    # close to the fold the stiff mode of the comparison is soft, and no longer far above the others
    margin = 0.002 if kind == "hopf" else 0.02
    assert growth_of_masses(modes, (1 - margin) * limit.depth * mean) < 0
    assert growth_of_masses(modes, (1 + margin) * limit.depth * mean) > 0


def test_lobes_print_mode_coupling_of_a_model_with_residuals() -> None:
    flexible = Residuals(1e-7 * np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3)))
    down = MillingProcess(4, 0.02, np.pi / 2, 800e6, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
    line = mode_coupling_line(replace(structure([18.0, 19.5], [1.0, 1.0 + np.pi / 2]), residuals=flexible), down, 0.05)
    assert "from" in line
    assert "not computed" not in line
