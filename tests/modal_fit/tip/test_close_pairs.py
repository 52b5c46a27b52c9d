"""Pairs closer than their widths: a small change between rest and cut turns their shapes in the plane of both."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.core import InputError
from modal_fit import ModalModel, calibrate_to_tip
from modal_fit.settings import SETTINGS
from modal_fit.shapes import modal_assurance
from modal_fit.tip.agreement import sensor_agreement
from modal_fit.tip.close_pairs import with_pairs_as_in_cut
from modal_fit.tip.mistakes import refuse_disagreement

from .random_robots import Robot, draw_robot, first_modes, modes, tapped


def with_turned_pair(rng: np.random.Generator) -> Robot:
    """A robot whose two lowest modes are a close pair that a change of stiffness turns between rest and cut.

    In the modes of the cut the change is a matrix with off-diagonal terms in the pair alone, so that the modes at rest
    are its eigenvectors: real, mass-normalised, with the damping of viscous forces taken as uncoupled.
    """
    robot = draw_robot(rng, (0.03, 0.08))
    natural, rest = robot.cut_at_tip.natural_frequencies.copy(), robot.rest_at_tip.natural_frequencies.copy()
    zeta = robot.cut_at_tip.damping_ratios.copy()
    natural[1] = natural[0] * (1 + rng.uniform(0.3, 0.9) * (zeta[0] + zeta[1]))
    shapes = [np.array(m.right.real) for m in (robot.cut_at_tip, robot.cut_at_sensor)]
    stiffness = np.diag(natural[:2] ** 2) * 1.05**2
    coupling = rng.choice([-1, 1]) * rng.uniform(0.3, 1.0) * (natural[1] ** 2 - natural[0] ** 2)
    stiffness[0, 1] = stiffness[1, 0] = coupling
    values, turn = np.linalg.eigh(stiffness)
    rest[:2] = np.sqrt(values)
    at_rest = [np.vstack([turn.T @ shape[:2], shape[2:]]) for shape in shapes]
    names = (robot.cut_at_tip.responses, robot.cut_at_sensor.responses)
    made = [
        modes(f, zeta, own[k], own[0], names[k]) for f, own in ((natural, shapes), (rest, at_rest)) for k in range(2)
    ]
    return Robot(*made)


def agrees(model: ModalModel, hammer: ModalModel) -> bool:
    """Whether the residues of both tests at the sensor agree."""
    try:
        refuse_disagreement(model, hammer, 3, sensor_agreement(model, hammer, 3))
    except InputError:
        return False
    return True


def test_turned_pairs_agree() -> None:
    """Mode by mode the residues of most of these robots disagree, though cut and taps are of one structure."""
    one_by_one = 0
    for seed in range(30):
        robot = with_turned_pair(np.random.default_rng(seed))
        model, hammer = robot.in_process(), robot.hammer()
        assert agrees(model, with_pairs_as_in_cut(model, hammer, 3))
        one_by_one += agrees(model, hammer)
    assert one_by_one < 15


@pytest.mark.parametrize("seed", range(3))
def test_a_turned_pair_is_carried_to_the_tip(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = with_turned_pair(rng)
    taps = (tapped(model, rng, noise=3e-4) for model in (robot.rest_at_tip, robot.rest_at_sensor))
    at_tip = calibrate_to_tip(robot.in_process(), *taps).model
    lines = np.linspace(9.0, 48.0, 300)
    exact = robot.cut_at_tip.receptance(lines)
    error = np.linalg.norm(at_tip.receptance(lines) - exact, axis=(1, 2))
    assert error.max() < 0.05 * np.linalg.norm(exact, axis=(1, 2)).max()


def test_another_mode_in_a_pair_is_refused() -> None:
    """One mode of the pair is that of another robot, at the same frequency: a basis that makes it this one is rare."""
    tried = accepted = accepted_one_by_one = 0
    for seed in range(150):
        robot = with_turned_pair(np.random.default_rng(seed))
        other = draw_robot(np.random.default_rng(500 + seed), (0.03, 0.08))
        model, hammer = robot.in_process(), robot.hammer()
        k = seed % 2
        right, left = hammer.right.copy(), hammer.left.copy()
        right[k] = np.concatenate([other.rest_at_tip.right[k], other.rest_at_sensor.right[k]])
        left[k] = other.rest_at_tip.right[k] / (2j * hammer.poles[k].imag)
        if modal_assurance(right[k : k + 1], hammer.right[k : k + 1]) > SETTINGS.matched_assurance:
            continue  # the other robot's mode is this one
        wrong = replace(hammer, right=right, left=left)
        tried += 1
        accepted += agrees(model, with_pairs_as_in_cut(model, wrong, 3))
        accepted_one_by_one += agrees(model, wrong)
    assert tried > 100
    assert accepted <= accepted_one_by_one + 0.01 * tried


@pytest.mark.parametrize("gain", [-1.0, 9.80665, 1e-3])
def test_scale_and_sign_of_a_pair_are_compared(gain: float) -> None:
    for seed in range(10):
        robot = with_turned_pair(np.random.default_rng(seed))
        model, hammer = first_modes(robot.in_process(), 2), robot.hammer()
        wrong = replace(model, right=gain * model.right)
        assert not agrees(wrong, with_pairs_as_in_cut(wrong, hammer, 3))
