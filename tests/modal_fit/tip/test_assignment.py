"""Which hammer mode is which in-process mode: random robots that are stiffer or softer at rest, against the truth."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.core import InputError
from modal_fit import calibrate_to_tip
from modal_fit.shapes import modal_assurance
from modal_fit.tip.agreement import sensor_agreement
from modal_fit.tip.matching import assign

from .random_robots import draw_robot, first_modes, tapped


@pytest.mark.parametrize("shifts", [(0.03, 0.08), (-0.08, -0.03), (0.05, 0.15), (-0.15, -0.05)])
def test_no_mode_is_assigned_wrongly(shifts: tuple[float, float]) -> None:
    """A hammer fit that is perfect and has hidden modes, too; the nearest mode is often another one."""
    wrong = nearest_is_wrong = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        robot = draw_robot(rng, shifts)
        model, hammer = robot.in_process(), robot.hammer()
        order = rng.permutation(len(hammer.poles))
        shuffled = replace(hammer, poles=hammer.poles[order], right=hammer.right[order], left=hammer.left[order])
        agreement = sensor_agreement(model, shuffled, 3)
        wrong += int((order[agreement.hammer_modes] != np.arange(robot.n_low)).any())
        np.testing.assert_allclose(agreement.factors, 1, atol=1e-9)  # the residues per mass are those of the cut
        distance = np.abs(np.log(model.natural_frequencies[:, None] / hammer.natural_frequencies))
        nearest = np.argmin(distance / 0.1 + 1 - modal_assurance(model.right, hammer.right[:, 3:]), axis=1)
        nearest_is_wrong += int((nearest != np.arange(robot.n_low)).any())
    assert wrong == 0
    assert nearest_is_wrong > 15  # the robots are difficult


@pytest.mark.parametrize("seed", range(4))
def test_taps_of_a_stiffer_robot_carry_its_modes_to_the_tip(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = draw_robot(rng, (0.03, 0.08))
    at_tip = calibrate_to_tip(
        robot.in_process(), tapped(robot.rest_at_tip, rng), tapped(robot.rest_at_sensor, rng)
    ).model
    true, n = robot.cut_at_tip, robot.n_low
    largest = np.abs(true.right[:n]).max(axis=1, keepdims=True)
    assert (
        np.abs(at_tip.right[:n] - true.right[:n]).max(initial=0.0, where=largest > 0) < 0.05 * np.abs(true.right).max()
    )
    lines = np.linspace(9.0, 48.0, 300)
    exact = true.receptance(lines)
    error = np.linalg.norm(at_tip.receptance(lines) - exact, axis=(1, 2))
    assert error.max() < 0.03 * np.linalg.norm(exact, axis=(1, 2)).max()


@pytest.mark.parametrize("seed", [1000, 1010, 1019])
def test_modes_that_the_hammer_fit_overlooks_are_looked_for_where_the_cut_has_them(seed: int) -> None:
    """At 1 % noise of the accelerance, which is largest above 70 Hz, an automatic fit joins close modes."""
    rng = np.random.default_rng(seed)
    robot = draw_robot(rng, (0.03, 0.08))
    taps = [tapped(model, rng, noise=1e-2) for model in (robot.rest_at_tip, robot.rest_at_sensor)]
    calibration = calibrate_to_tip(robot.in_process(), *taps)
    rest = robot.rest_at_tip.natural_frequencies[: robot.n_low]
    assert calibration.agreement.frequencies[:, 1] == pytest.approx(rest, rel=0.003)
    assert np.abs(calibration.agreement.factors - 1).max() < 0.1
    assert not any("only the taps show" in text for text in calibration.warnings)


def test_fewer_hammer_modes_than_in_process_modes_are_refused() -> None:
    robot = draw_robot(np.random.default_rng(3), (0.03, 0.08), hidden=0)
    with pytest.raises(InputError, match=r"the hammer FRFs show 2 modes .* the in-process model has \d .*--modes 2"):
        sensor_agreement(robot.in_process(), first_modes(robot.hammer(), 2), 3)


def test_taps_along_other_directions_than_the_cut_are_refused() -> None:
    robot = draw_robot(np.random.default_rng(4), (0.03, 0.08))
    model = robot.in_process()
    sideways = replace(model, left=model.left[:, :2], excitations=model.excitations[:2])
    hammer = robot.hammer()
    with pytest.raises(InputError, match="no direction in common"):
        sensor_agreement(sideways, replace(hammer, left=hammer.left[:, 2:], excitations=hammer.excitations[2:]), 3)


def test_a_mode_without_a_partner_does_not_push_the_others_from_theirs() -> None:
    """The hammer fit misses the third mode and has a hidden one: before, all from the third on moved up by one."""
    rng = np.random.default_rng(40)
    cut = np.array([11.0, 14.6, 16.2, 21.7, 25.0, 47.6])
    rest = np.append(np.delete(cut, 2) * 1.05, 109.3)
    shapes = rng.standard_normal((6, 3))
    residues = np.einsum("rp,rq->rpq", shapes, shapes) + 0j
    hidden = rng.standard_normal((1, 3, 3)) + 0j
    rows, chosen = assign((cut, rest), (residues, np.concatenate([np.delete(residues, 2, axis=0), hidden])))
    pairs = dict(zip(rows.tolist(), chosen.tolist(), strict=True))
    assert pairs == {0: 0, 1: 1, 2: 5, 3: 2, 4: 3, 5: 4}
