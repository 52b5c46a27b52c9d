"""Mistakes between cut and taps: each is refused, and named by its cause; what both share is not refused."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from millfrf.core import TIP, InputError
from modal_fit import ModalModel, calibrate_to_tip, pack_parameters
from modal_fit.tip.agreement import sensor_agreement
from modal_fit.tip.mistakes import refuse_disagreement, refuse_exchanged_tip, refuse_tip_scale

from .random_robots import draw_robot, tapped

G = 9.80665
Change = Callable[[ModalModel], ModalModel]


def same(model: ModalModel) -> ModalModel:
    return model


def moved(*gains: float) -> Change:
    return lambda model: replace(model, right=model.right * np.array(gains))


def forced(*gains: float) -> Change:
    return lambda model: replace(model, left=model.left * np.array(gains))


def at_sensor(*gains: float) -> Change:
    """Return a change of the hammer model at the sensor, whose rows follow the three of the tip."""
    return moved(1, 1, 1, *gains)


def exchanged(side: str) -> Change:
    return lambda model: replace(model, **{side: getattr(model, side)[:, [1, 0, 2]]})


MISTAKES = [
    ("accelerations of the cut in g", moved(1 / G), same, "accelerations of the cut are in g"),
    ("accelerations of the taps in g", same, moved(1 / G), "accelerations of the taps are in g"),
    ("the sensor's taps in g", same, at_sensor(1 / G, 1 / G, 1 / G), "accelerations of the taps are in g"),
    ("forces of the cut in kN", forced(1e3), same, "forces of the cut are in kN"),
    ("forces of the taps in kN", same, forced(1e3), "forces of the taps are in kN"),
    ("all forces of the cut reversed", forced(-1), same, "wrong sign"),
    ("one force of the cut reversed", forced(-1, 1, 1), same, r"TCP:\+X .*wrong sign"),
    ("one accelerometer reversed", moved(1, -1, 1), same, r"HOUSING:\+Y .*wrong sign"),
    ("the spindle's axis reversed", moved(1, 1, -1), same, r"HOUSING:\+Z .*wrong sign"),
    ("one accelerometer of the taps reversed", same, at_sensor(-1, 1, 1), r"HOUSING:\+X .*wrong sign"),
    ("two accelerometers exchanged", exchanged("right"), same, r"HOUSING:\+X and HOUSING:\+Y are exchanged"),
    ("two forces exchanged", exchanged("left"), same, r"TCP:\+X and TCP:\+Y are exchanged"),
    ("one sensitivity three times too large", moved(3, 1, 1), same, r"HOUSING:\+X by a factor of 3.*sensitivity"),
    ("one accelerometer in g", moved(1 / G, 1, 1), same, r"HOUSING:\+X by a factor of 0.1.*in g"),
    ("one force in kN", forced(1, 1e3, 1), same, r"TCP:\+Y by a factor of 1e\+03.*kN"),
    ("a derivative of the motion", moved(1j), same, "at 90°.*another tool"),
]


@pytest.mark.parametrize(("name", "cut", "taps", "cause"), MISTAKES, ids=[row[0] for row in MISTAKES])
def test_a_mistake_between_cut_and_taps_is_refused_with_its_cause(
    name: str, cut: Change, taps: Change, cause: str
) -> None:
    for seed in range(20):
        robot = draw_robot(np.random.default_rng(seed), (0.03, 0.08))
        model, hammer = cut(robot.in_process()), taps(robot.hammer())
        with pytest.raises(InputError, match=cause):
            refuse_disagreement(model, hammer, 3, sensor_agreement(model, hammer, 3))


def test_a_single_mode_three_times_too_large_is_refused_by_its_number() -> None:
    for seed in range(20):
        robot = draw_robot(np.random.default_rng(seed), (0.03, 0.08))
        model, hammer = robot.in_process(), robot.hammer()
        gains = np.r_[3, np.ones(robot.n_low - 1)][:, None]
        wrong = replace(model, right=model.right * gains)
        with pytest.raises(InputError, match=r"mode 1, .*factor 3"):
            refuse_disagreement(wrong, hammer, 3, sensor_agreement(wrong, hammer, 3))


def test_another_robot_is_refused() -> None:
    for seed in range(20):
        robot, other = (draw_robot(np.random.default_rng(k), (0.03, 0.08)) for k in (seed, 100 + seed))
        model, hammer = robot.in_process(), other.hammer()
        with pytest.raises(InputError):
            refuse_disagreement(model, hammer, 3, sensor_agreement(model, hammer, 3))


TIPS = [
    ("the tip in g", (1 / G, 1 / G, 1 / G), "the tip moves .*at the tip in g"),
    ("the sensor in g", (G, G, G), "the tip moves .*at the sensor in g"),
    ("the tip reversed", (-1, -1, -1), "the tip moves against the sensor"),
    ("forces in kN", (1e3, 1e3, 1e3), "in kN"),
]


@pytest.mark.parametrize(("name", "gains", "cause"), TIPS, ids=[row[0] for row in TIPS])
def test_a_tip_of_another_unit_or_sign_is_refused(name: str, gains: tuple[float, ...], cause: str) -> None:
    for seed in range(100):
        robot = draw_robot(np.random.default_rng(seed), (0.03, 0.08))
        hammer, low = robot.hammer(), slice(robot.n_low)
        places = (hammer.right[low, 3:], TIP, hammer.natural_frequencies[low])
        refuse_tip_scale(hammer.right[low, :3], *places)
        refuse_exchanged_tip(hammer.right[low, :3], hammer.left[low], *places[1:])
        with pytest.raises(InputError, match=cause):
            refuse_tip_scale(hammer.right[low, :3] * np.array(gains), *places)


def test_one_axis_of_the_tip_in_g_or_reversed_is_refused_where_it_moves() -> None:
    """Nine robots of ten move along X enough; where one does not, nothing that is measured shows the mistake."""
    for gains, cause in (((1 / G, 1, 1), r"TCP:\+X moves .*in g"), ((-1, 1, 1), r"TCP:\+X moves against")):
        said = []
        for seed in range(100):
            robot = draw_robot(np.random.default_rng(seed), (0.03, 0.08))
            hammer, low = robot.hammer(), slice(robot.n_low)
            places = (hammer.right[low, 3:], TIP, hammer.natural_frequencies[low])
            try:
                refuse_tip_scale(hammer.right[low, :3] * np.array(gains), *places)
            except InputError as error:
                said.append(str(error))
        assert len(said) >= 85
        assert all(re.search(cause, text) for text in said)


def test_a_joint_that_moves_the_sensor_little_in_some_modes_is_no_unit() -> None:
    """A posture of a simulated campaign was refused: "TCP:+Y moves 5.08 times as much", were accelerations in g?"""
    sensor = np.array([[1.0, 0.03, 0.2], [0.3, 0.15, 1.0], [1.0, 0.2, -0.3]], dtype=complex)
    tip = np.array([[1.3, 0.95, 0.2], [0.4, 0.15, 1.0], [1.2, 0.2, -0.3]], dtype=complex)
    frequencies = np.array([17.0, 25.0, 40.0])
    refuse_tip_scale(tip, sensor, TIP, frequencies)
    with pytest.raises(InputError, match=r"TCP:\+Y moves .* over all modes: were the accelerations at the sensor in g"):
        refuse_tip_scale(sensor * np.array([1.3, G, 1.0]), sensor, TIP, frequencies)


def test_two_exchanged_axes_of_the_tip_are_refused() -> None:
    robot = draw_robot(np.random.default_rng(5), (0.03, 0.08))
    hammer, low = robot.hammer(), slice(robot.n_low)
    with pytest.raises(InputError, match=r"TCP:\+X and TCP:\+Y of the tip's FRF are exchanged"):
        refuse_exchanged_tip(hammer.right[low][:, [1, 0, 2]], hammer.left[low], TIP, hammer.natural_frequencies[low])


@pytest.mark.parametrize("gain", [0.8, 1.3])
def test_a_small_disagreement_counts_as_an_error_of_the_tip(gain: float) -> None:
    """Cut and taps differ in scale by up to a factor of two: which one is right is not known."""
    rng = np.random.default_rng(1)
    robot = draw_robot(rng, (0.03, 0.08))
    model = robot.in_process()
    known = replace(model, covariance=np.zeros((len(pack_parameters(model)),) * 2))
    taps = [tapped(side, rng) for side in (robot.rest_at_tip, robot.rest_at_sensor)]
    for scale, least in ((1.0, 0.0), (gain, 0.5 * abs(1 / gain - 1))):
        scaled = replace(known, right=known.right * scale)
        at_tip = calibrate_to_tip(scaled, *taps).model
        assert at_tip.covariance is not None
        start, n, modes = 2 * len(at_tip.poles), 3 * robot.n_low, len(at_tip.poles)
        variance = np.diag(at_tip.covariance)[start : start + 2 * 3 * modes].reshape(2, -1)[:, :n].sum(axis=0)
        error = np.sqrt(variance.sum()) / np.linalg.norm(at_tip.right[: robot.n_low])
        assert error >= least
        assert error < 2 * least + 0.05


def test_a_disagreement_about_the_forces_counts_as_an_error_of_the_left_vectors() -> None:
    """The cut's left vectors are 10 % off across themselves: the errors at the tip contain that, and not much more."""
    rng = np.random.default_rng(2)
    robot = draw_robot(rng, (0.03, 0.08))
    model = robot.in_process()
    known = replace(model, covariance=np.zeros((len(pack_parameters(model)),) * 2))
    taps = [tapped(side, rng) for side in (robot.rest_at_tip, robot.rest_at_sensor)]
    across = np.cross(model.left, rng.standard_normal(3))
    size = np.linalg.norm(model.left, axis=1, keepdims=True)
    across *= size / np.linalg.norm(across, axis=1, keepdims=True)
    for off in (0.0, 0.1):
        at_tip = calibrate_to_tip(replace(known, left=known.left + off * across), *taps).model
        assert at_tip.covariance is not None
        variance = np.diag(at_tip.covariance)[-2 * at_tip.left.size :].reshape(2, *at_tip.left.shape).sum(axis=(0, 2))
        shares = np.sqrt(variance[: robot.n_low]) / size[:, 0]
        assert (shares < 1.2 * off + 0.02).all()
        assert (shares >= 0.8 * off).all()


def with_uncertain_shape(model: ModalModel, mode: int, rng: np.random.Generator, error: float) -> ModalModel:
    """Return the model with the left vector of a mode off across itself, MAC .78, and the covariance of that."""
    size = np.linalg.norm(model.left[mode])
    across = np.cross(model.left[mode], rng.standard_normal(3))
    across *= np.sqrt(1 / 0.78 - 1) * size / np.linalg.norm(across)
    left = model.left.copy()
    left[mode] += across
    variance = np.zeros(len(pack_parameters(model)))
    n = left.size
    for start in (len(variance) - 2 * n, len(variance) - n):
        variance[start + mode * 3 : start + mode * 3 + 3] = (error * size) ** 2 / 2
    return replace(model, left=left, covariance=np.diag(variance))


def test_a_shape_is_refused_if_it_differs_beyond_its_error_and_no_gain_is_named_that_other_modes_refute() -> None:
    """One of several modes has a MAC of .78 with the taps: by an uncertain fit of the cut, or by a certain one."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        robot = draw_robot(rng, (0.03, 0.08))
        model, hammer, mode = robot.in_process(), robot.hammer(), seed % robot.n_low
        uncertain = with_uncertain_shape(model, mode, rng, 0.2)
        refuse_disagreement(uncertain, hammer, 3, sensor_agreement(uncertain, hammer, 3))
        certain = with_uncertain_shape(model, mode, rng, 0.002)
        with pytest.raises(InputError, match=rf"1 of {robot.n_low} modes; mode {mode + 1},") as refused:
            refuse_disagreement(certain, hammer, 3, sensor_agreement(certain, hammer, 3))
        assert "all of them by" not in str(refused.value)


def test_a_common_factor_is_not_named_where_a_mode_refutes_it() -> None:
    """All modes but the first are 2.6 times too large in the cut, the first only 1.4 times: no unit does that."""
    for seed in range(10):
        robot = draw_robot(np.random.default_rng(seed), (0.03, 0.08))
        model, hammer = robot.in_process(), robot.hammer()
        gains = np.r_[1.4, np.full(robot.n_low - 1, 2.6)][:, None]
        wrong = replace(model, right=model.right * gains)
        with pytest.raises(InputError) as refused:
            refuse_disagreement(wrong, hammer, 3, sensor_agreement(wrong, hammer, 3))
        assert "all of them by" not in str(refused.value)


def test_a_direction_in_which_the_sensor_hardly_moves_does_not_spoil_the_tip() -> None:
    """The cut knows each component to 3 % of the mode; where the sensor moves less, the ratio is all error."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        robot = draw_robot(rng, (0.0, 0.0))
        still = np.ones_like(robot.cut_at_sensor.right.real)
        still[0, 2] = 0.01
        at_sensor = (replace(side, right=side.right * still) for side in (robot.cut_at_sensor, robot.rest_at_sensor))
        robot = replace(robot, **dict(zip(("cut_at_sensor", "rest_at_sensor"), at_sensor, strict=True)))
        model = robot.in_process()
        size = np.linalg.norm(model.right, axis=1, keepdims=True)
        model = replace(model, right=model.right + 0.03 * size * rng.choice([-1, 1], model.right.shape))
        taps = [tapped(side, rng, noise=1e-4) for side in (robot.rest_at_tip, robot.rest_at_sensor)]
        result, true = calibrate_to_tip(model, *taps).model.right[: robot.n_low], robot.cut_at_tip.right[: robot.n_low]
        error = np.linalg.norm(result - true, axis=1) / np.linalg.norm(true, axis=1)
        assert error.max() < 0.15
