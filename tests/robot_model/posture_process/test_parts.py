"""Parts of the posture process: modes, slopes, kernels, pairs, likelihood."""

from dataclasses import replace

import numpy as np
import pytest
from measured_cell import MeasuredCell, measured_cell

from millfrf.robot_model import measured_modes, modal_model_at, modes_at, read_spatial_robot, with_joint_factor
from millfrf.robot_model.posture_process.learning import assembled
from millfrf.robot_model.posture_process.modal_basis import (
    basis_at,
    corrected_modes,
    mode_pairs,
    part_names,
    shape_slopes,
)
from millfrf.robot_model.posture_process.process import MEDIANS, Evidence, joint_kernels, log_posterior, posture_kernel

KUKA = read_spatial_robot("kuka_kr90_r3100").robot
Q = np.radians([10.0, -15.0, 95.0, 30.0, 70.0, 20.0])


@pytest.fixture(scope="module")
def few() -> MeasuredCell:
    return measured_cell(3, 4)


def _evidence(few: MeasuredCell) -> Evidence:
    measured = few.measured
    pairs = tuple(tuple((i, i) for i in range(6)) for _ in measured)
    hyper = np.log(MEDIANS)
    unknown = (np.full((len(measured), 6), 0.05), np.full(6, -0.03))
    return assembled(few.robot, measured, pairs, (hyper, hyper[None]), unknown).evidence


def test_the_parts_of_the_basis_add_up_to_the_modes() -> None:
    basis, place = basis_at(KUKA, Q)
    assert np.abs(basis.stiffness.sum(axis=0) - np.diag(basis.squares)).max() < 1e-9 * basis.squares.max()
    assert np.abs(basis.mass.sum(axis=0) - np.eye(len(basis.squares))).max() < 1e-9
    assert len(basis.stiffness) == len(part_names(KUKA)[0]) == len(place.own)
    assert place.own[:6] == pytest.approx(Q)


def test_a_corrected_joint_gives_the_modes_of_the_corrected_robot() -> None:
    basis = basis_at(KUKA, Q)[0]
    factors = np.zeros(len(basis.stiffness))
    factors[1] = np.log(0.67)
    result = corrected_modes(basis, factors, np.zeros(len(basis.mass)))
    expected = modes_at(with_joint_factor(KUKA, "2", 0.67), Q)
    assert result.natural[:6] / (2 * np.pi) == pytest.approx(expected.frequencies[:6], rel=1e-4)
    assert result.shares[:4].sum(axis=1) == pytest.approx(1.0)


def test_slopes_are_those_of_differences() -> None:
    basis = basis_at(KUKA, Q)[0]
    stiffness, mass = np.full(len(basis.stiffness), 0.1), np.full(len(basis.mass), -0.05)
    modes = corrected_modes(basis, stiffness, mass)
    step = 1e-5
    for mode in range(4):
        by_stiffness, by_mass = shape_slopes(basis, modes, stiffness, mass, mode)
        for k in (0, 1, 2):
            single = np.eye(len(stiffness))[k] * step
            moved = corrected_modes(basis, stiffness + single, mass).tip[mode]
            moved = moved if moved @ modes.tip[mode] > 0 else -moved
            assert by_stiffness[:, k] == pytest.approx((moved - modes.tip[mode]) / step, rel=0.15, abs=2e-4)
        heavier = corrected_modes(basis, stiffness, mass + np.eye(len(mass))[-2] * step)
        slope = np.log(heavier.natural[mode] / modes.natural[mode]) / step
        assert slope == pytest.approx(-modes.masses[mode, -2] / 2, rel=1e-3, abs=1e-6)
        moved = heavier.tip[mode] * np.sign(heavier.tip[mode] @ modes.tip[mode])
        assert by_mass[:, -2] == pytest.approx((moved - modes.tip[mode]) / step, rel=0.15, abs=2e-4)


def test_shapes_and_their_frame_come_back_from_a_modal_model() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    modes = modes_at(KUKA, Q)
    model = modal_model_at(KUKA, Q, axes=turn, highest_frequency=60.0)
    result = measured_modes("one", Q, model, turn)
    tip = modes.shapes[: len(model.poles), modes.structure.tip, :3]
    for r, shape in enumerate(result.shapes):
        in_base = shape @ result.directions
        assert np.abs(in_base) == pytest.approx(np.abs(tip[r]), rel=1e-9, abs=1e-12)
    only = replace(model, right=model.right[:, [0, 2]], responses=("TCP:+X", "TCP:+Z"))
    part = measured_modes("two", Q, replace(only, left=model.left[:, :1], excitations=("TCP:+X",)), turn)
    assert np.abs(part.shapes) == pytest.approx(np.abs(result.shapes[:, [0, 2]]), rel=1e-9, abs=1e-12)


def test_kernels_are_covariances_and_angles_return_after_a_turn(few: MeasuredCell) -> None:
    distances = _evidence(few).distances
    for kernel in (posture_kernel(distances, 0.8), *joint_kernels(distances, 0.8)):
        assert np.diag(kernel) == pytest.approx(1.0)
        assert np.linalg.eigvalsh(kernel).min() > -1e-12
    learned = few.measured[0]
    turned = replace(learned, driven=learned.driven + 2 * np.pi * np.eye(6)[3])
    pairs = tuple(tuple((i, i) for i in range(6)) for _ in range(2))
    hyper = np.log(MEDIANS)
    both = assembled(few.robot, (learned, turned), pairs, (hyper, hyper[None]), (np.zeros((2, 6)), np.zeros(6)))
    assert np.abs(both.evidence.distances.total).max() < 1e-20


def test_the_gradient_of_the_marginal_likelihood_is_that_of_differences(few: MeasuredCell) -> None:
    evidence, hyper, step = _evidence(few), np.log(MEDIANS) + 0.1, 1e-5
    slope = log_posterior(hyper, evidence)[1]
    for k, each in enumerate(np.eye(len(hyper)) * step):
        change = log_posterior(hyper + each, evidence)[0] - log_posterior(hyper - each, evidence)[0]
        assert slope[k] == pytest.approx(change / (2 * step), rel=2e-3, abs=2e-3)


def test_modes_that_cross_are_paired_by_shape_and_far_ones_not_at_all() -> None:
    shapes = np.array([[0.1, 0.0, 0.0], [0.0, 0.08, 0.0], [0.0, 0.0, 0.05]])
    pairs = mode_pairs(np.array([17.0, 18.0, 80.0]), shapes, np.array([17.2, 17.9, 30.0]), shapes[[1, 0, 2]])
    assert pairs == ((0, 1), (1, 0))
