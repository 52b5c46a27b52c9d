"""Tapped modes outside the band of the cut: their errors, the seam, and the flexibility that no test shows."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from estimation import Frf, FrfCovariance
from millfrf.core import HOUSING, TIP, InputError
from modal_fit import BandSource, Residuals, TipCalibration, calibrate_to_tip, pack_parameters
from modal_fit.tip.hybrid import seam_warnings

from .random_robots import Robot, draw_robot, modes, tapped

PARTS = ("poles", "right", "left")


def calibrated(robot: Robot, rng: np.random.Generator, **options: float) -> TipCalibration:
    top, noise = options.pop("top", 200.0), options.pop("noise", 2e-3)
    model = robot.in_process()
    known = replace(model, covariance=np.zeros((len(pack_parameters(model)),) * 2))
    taps = [tapped(side, rng, noise=noise, top=top) for side in (robot.rest_at_tip, robot.rest_at_sensor)]
    return calibrate_to_tip(known, *taps, **options)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_does_not_change_is_known_up_to_the_end_of_the_taps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = draw_robot(rng, (0.0, 0.0))
    result = calibrated(robot, rng, noise=5e-4)
    lines = np.linspace(9.0, 180.0, 800)
    exact = robot.cut_at_tip.receptance(lines)
    error, size = (np.linalg.norm(values, axis=(1, 2)) for values in (result.model.receptance(lines) - exact, exact))
    for inside in (lines < 50, lines >= 50):
        assert error[inside].max() < 0.03 * size[inside].max()
    assert result.model.band == pytest.approx((2.0, 199.75))
    assert [source.source for source in result.model.sources] == ["tapped", "in-process", "tapped"]
    assert result.model.sources[1:] == (BandSource(8.0, 50.0, "in-process"), BandSource(50.0, 199.75, "tapped"))
    assert result.model.mode_sources == ("in-process",) * robot.n_low + ("tapped",) * 2


@pytest.mark.long
def test_errors_of_tapped_modes_hold_the_truth_in_the_cut() -> None:
    """Each mode is stiffer at rest by another share: two standard errors hold 95 %, and are not absurdly wide."""
    scores, widths = [], []
    for seed in range(12):
        rng = np.random.default_rng(200 + seed)
        robot = draw_robot(rng, (0.03, 0.08))
        at_tip = calibrated(robot, rng).model
        errors = at_tip.standard_errors()
        assert errors is not None
        true = robot.cut_at_tip.natural_frequencies[-2:]
        scores += list((at_tip.natural_frequencies[-2:] - true) / errors[0][-2:])
        widths += list(errors[0][-2:] / true)
    assert np.mean(np.abs(scores) < 2) > 0.9
    assert np.median(widths) < 0.06


def test_the_shares_of_rest_are_those_of_the_common_modes() -> None:
    """All modes are 6 % stiffer at rest: the tapped modes are moved by that, and their scatter is small."""
    rng = np.random.default_rng(7)
    robot = draw_robot(rng, (0.06, 0.06))
    at_tip = calibrated(robot, rng).model
    assert at_tip.natural_frequencies == pytest.approx(robot.cut_at_tip.natural_frequencies, rel=2e-3)
    lines = np.linspace(60.0, 160.0, 400)
    exact = robot.cut_at_tip.receptance(lines)
    assert np.abs(at_tip.receptance(lines) - exact).max() < 0.1 * np.abs(exact).max()


@pytest.mark.long
@pytest.mark.parametrize(("top", "hidden"), [(60.0, 3), (200.0, 2)])
def test_the_unmeasured_flexibility_is_a_bound_and_not_an_absurd_one(top: float, hidden: int) -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        robot = draw_robot(rng, (0.03, 0.08), hidden=hidden)
        if top > 150:
            robot = with_stiff_mode(robot, rng)
        at_tip = calibrated(robot, rng, top=top).model
        true = robot.rest_at_tip
        above = true.natural_frequencies > top
        residues = np.einsum("rp,rq->rpq", true.right[above], true.left[above])
        static = np.linalg.norm(-2 * np.real(residues / true.poles[above][:, None, None]).sum(axis=0), 2)
        assert at_tip.unmeasured_flexibility is not None
        assert static <= at_tip.unmeasured_flexibility < 4 * static


def with_stiff_mode(robot: Robot, rng: np.random.Generator) -> Robot:
    """Add a mode between 230 and 400 Hz, which does not change from rest to cut."""
    f, zeta, shape = np.array([rng.uniform(230, 400)]), np.array([0.02]), rng.normal(size=(1, 3)) / np.sqrt(100)
    added = {name: modes(f, zeta, shape, shape, TIP if name.endswith("tip") else HOUSING) for name in vars(robot)}

    def joined(name: str) -> object:
        own, new = getattr(robot, name), added[name]
        return replace(own, **{key: np.concatenate([getattr(own, key), getattr(new, key)]) for key in PARTS})

    return replace(robot, **{name: joined(name) for name in vars(robot)})


def test_static_flexibility_does_not_count_twice() -> None:
    """The in-process residual holds what the tapped modes add in the band of the cut; it is replaced by theirs."""
    rng = np.random.default_rng(9)
    robot = draw_robot(rng, (0.0, 0.0))
    hidden = robot.cut_at_sensor
    static = -2 * np.real(
        np.einsum("rp,rq->rpq", hidden.right[robot.n_low :], hidden.left[robot.n_low :])
        / hidden.poles[robot.n_low :][:, None, None]
    ).sum(axis=0)
    model = replace(robot.in_process(), residuals=Residuals(static, np.zeros((3, 3))))
    taps = [tapped(side, rng, noise=5e-4) for side in (robot.rest_at_tip, robot.rest_at_sensor)]
    at_tip = calibrate_to_tip(model, *taps).model
    lines = np.array([1.0, 2.0])
    exact = robot.cut_at_tip.receptance(lines)
    assert np.abs(at_tip.receptance(lines) - exact).max() < 0.01 * np.abs(exact).max()


@pytest.mark.long
def test_a_given_seam_takes_the_modes_above_it_from_the_taps() -> None:
    rng = np.random.default_rng(11)
    robot = draw_robot(rng, (0.0, 0.0))
    f = robot.cut_at_tip.natural_frequencies
    seam = float((f[robot.n_low - 2] + f[robot.n_low - 1]) / 2)
    calibration = calibrated(robot, rng, tip_above=seam)
    assert calibration.model.mode_sources == ("in-process",) * (robot.n_low - 1) + ("tapped",) * 3
    assert len(calibration.ratios) == robot.n_low - 1
    assert calibration.model.sources[-1].low == seam
    with pytest.raises(InputError, match=r"tip_above 250 Hz is not between 8 Hz.* 199.8 Hz"):
        calibrated(robot, rng, tip_above=250.0)


@pytest.mark.long
@pytest.mark.parametrize("lacking", [0, -1])
def test_a_mode_in_the_band_that_only_the_taps_show_is_added(lacking: int) -> None:
    """The cut shows all modes but one: the receptance of the tip has it all the same, and its band says whence."""
    rng = np.random.default_rng(12)
    robot = draw_robot(rng, (0.0, 0.0))
    model, kept = robot.in_process(), np.arange(robot.n_low) != lacking % robot.n_low
    model = replace(model, **{part: getattr(model, part)[kept] for part in PARTS})
    taps = [tapped(side, rng) for side in (robot.rest_at_tip, robot.rest_at_sensor)]
    missing = robot.cut_at_tip.natural_frequencies[lacking % robot.n_low]
    calibration = calibrate_to_tip(model, *taps)
    assert any(f"only the taps show a mode at {missing:.4g}"[:-1] in text for text in calibration.warnings)
    sources = np.where(np.append(kept, [False] * 2), "in-process", "tapped")
    assert calibration.model.mode_sources == tuple(sources)
    lines = np.linspace(5.0, 60.0, 500)
    exact = robot.cut_at_tip.receptance(lines)
    assert np.abs(calibration.model.receptance(lines) - exact).max() < 0.03 * np.abs(exact).max()


def test_a_jump_between_the_bands_is_told_with_its_size() -> None:
    """The model lacks the highest mode of the cut: where the taps take over, at 50 Hz, this mode is missing."""
    shown = refused = 0
    for seed in range(20):
        robot = draw_robot(np.random.default_rng(seed), (0.0, 0.0))
        true, n, seam = robot.cut_at_tip, robot.n_low, np.array([50.0])
        assert not seam_warnings(true, true, (8.0, 50.0), (8.0, 200.0))
        kept = np.arange(n + 2) != n - 1
        model = replace(true, **{part: getattr(true, part)[kept] for part in PARTS})
        rest = model.receptance(seam)[0]
        jump = np.linalg.norm(true.receptance(seam)[0] - rest) / np.linalg.norm(rest)
        if jump > 1:
            refused += 1
            with pytest.raises(InputError, match="the fit of the cut lacks a mode near it"):
                seam_warnings(model, true, (8.0, 50.0), (8.0, 200.0))
            continue
        said = seam_warnings(model, true, (8.0, 50.0), (8.0, 200.0))
        sizes = [float(text.split("differ by ")[1].split(" ±")[0]) for text in said if "at 50 Hz" in text]
        assert sizes == pytest.approx([100 * jump] * len(sizes), rel=0.1)
        assert sizes or jump < 0.05
        shown += len(sizes)
    assert shown > 1
    assert refused > 1


def taps_along(robot: Robot, rng: np.random.Generator, forces: int, responses: int = 3) -> list[Frf]:
    """Return the FRFs of tip and sensor for taps along the first axes, with the first responses."""
    taps = []
    for side in (robot.rest_at_tip, robot.rest_at_sensor):
        frf = tapped(side, rng, noise=5e-4)
        assert frf.covariance is not None
        rows, columns = slice(responses), slice(forces)
        covariance = FrfCovariance(
            frf.covariance.response[:, rows, rows], frf.covariance.excitation[:, columns, columns]
        )
        values = frf.values[:, rows, columns]
        names = {"responses": frf.responses[rows], "excitations": frf.excitations[columns]}
        taps.append(replace(frf, values=values, covariance=covariance, **names))
    return taps


@pytest.mark.long
def test_a_force_that_was_not_tapped_follows_from_reciprocity() -> None:
    """Taps along X and Y, responses along all axes: tip's FRF along Z as well, up to the end of the taps."""
    rng = np.random.default_rng(13)
    robot = draw_robot(rng, (0.0, 0.0))
    calibration = calibrate_to_tip(robot.in_process(), *taps_along(robot, rng, 2))
    assert any("TCP:+Z was not tapped" in text for text in calibration.warnings)
    assert calibration.model.mode_sources == ("in-process",) * robot.n_low + ("tapped",) * 2
    lines = np.linspace(9.0, 180.0, 800)
    exact = robot.cut_at_tip.receptance(lines)
    error, size = (np.linalg.norm(v, axis=(1, 2)) for v in (calibration.model.receptance(lines) - exact, exact))
    for inside in (lines < 50, lines >= 50):
        assert error[inside].max() < 0.03 * size[inside].max()
    assert len(calibrate_to_tip(robot.in_process(), *taps_along(robot, rng, 2), tip_above=60.0).model.poles)


@pytest.mark.long
def test_the_error_of_reciprocity_is_that_of_the_modes_of_the_cut() -> None:
    """Left vectors along Z are off by 10 % of their modes: errors of the hidden modes follow the F distribution.

    The error comes from the modes of the cut, of two parts each. The chance of an error as large as that of a robot is
    therefore uniformly distributed, and -2 ln of it is chi-square distributed with two degrees of freedom.
    """
    chances = []
    for seed in range(8):
        rng = np.random.default_rng(300 + seed)
        robot = draw_robot(rng, (0.0, 0.0))
        size = np.linalg.norm(robot.cut_at_tip.left, axis=1)
        off = 0.1 * size * rng.standard_normal(len(size)) * np.exp(2j * np.pi * rng.random(len(size)))
        bent = Robot(*(replace(m, left=m.left + off[:, None] * [0, 0, 1]) for m in vars(robot).values()))
        model = bent.in_process()
        model = replace(model, covariance=np.zeros((len(pack_parameters(model)),) * 2))
        at_tip = calibrate_to_tip(model, *taps_along(bent, rng, 2)).model
        assert at_tip.covariance is not None
        n, hidden = at_tip.left.size, np.arange(bent.n_low, len(at_tip.poles))
        errors = np.sqrt(np.diag(at_tip.covariance)[-2 * n : -n].reshape(at_tip.left.shape)[hidden, 2])
        # a tapped mode's scale lies in its right vectors: compare the residue from Z to the largest response
        rows = np.abs(at_tip.right[hidden]).argmax(axis=1)
        scale = bent.cut_at_tip.right[hidden, rows] / at_tip.right[hidden, rows]
        squared = np.abs(at_tip.left[hidden, 2] - scale * bent.cut_at_tip.left[hidden, 2]) ** 2 / (2 * errors**2)
        chances.append(scipy.stats.f.sf(squared.mean(), 2 * len(hidden), 2 * bent.n_low))
    low, high = scipy.stats.chi2.ppf([0.001, 0.999], 2 * len(chances))
    assert low < -2 * np.log(chances).sum() < high


@pytest.mark.long
def test_forces_without_taps_and_without_a_response_do_not_extend_the_model() -> None:
    rng = np.random.default_rng(13)
    robot = draw_robot(rng, (0.0, 0.0))
    process = robot.in_process()
    process = replace(process, right=process.right[:, :2], responses=process.responses[:2])
    taps = taps_along(robot, rng, 2, 2)
    calibration = calibrate_to_tip(process, *taps)
    assert len(calibration.model.poles) == robot.n_low
    assert any("tap along each direction" in text for text in calibration.warnings)
    rest = robot.rest_at_tip
    hidden = replace(rest, **{part: getattr(rest, part)[robot.n_low :] for part in PARTS}).receptance(np.array([0.0]))
    assert calibration.model.unmeasured_flexibility is not None
    assert calibration.model.unmeasured_flexibility > 0.98 * np.linalg.norm(hidden[0].real[:2, :2], 2)
    with pytest.raises(InputError, match="every direction of the model's forces"):
        calibrate_to_tip(process, *taps, tip_above=60.0)
