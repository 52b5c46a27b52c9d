"""Limits, deviation and optimum of a path against other ways to find them: time domain, direct solve, brute force."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.linalg import expm

from millfrf.cutting import MillingProcess
from millfrf.robot_model import (
    Payload,
    Redundancy,
    attitudes_along,
    close_loops,
    cut_path,
    modal_model_at,
    named_posture,
    path_postures,
    read_spatial_robot,
    structure_at,
    target_of,
    tool_deflection,
    tool_down,
    turned_place,
    wrist_solutions,
)
from millfrf.robot_model.finite_elements.structure import coordinate_basis, mass_matrix, stiffness_matrix
from millfrf.stability import certified_lobes
from millfrf.steps.robot.along_path.optimum import optimise_postures
from millfrf.steps.robot.along_path.search import PathGoal
from millfrf.steps.robot.along_path.state import Loading
from millfrf.steps.robot.along_path.values import PathCut, PostureRequest, values_of
from modal_fit import ModalModel

CASE = read_spatial_robot("kuka_kr90_angled")
CUT = MillingProcess(2, 0.012, np.pi / 2, 600e6, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
SPEED = 3000 * np.pi / 30


def growth(model: ModalModel, speed: float, depth: float, periods: int = 300, steps: int = 160) -> float:
    """Logarithm of how much the tool's motion grows over the last half of a simulation, from a small push.

    Modes are stepped exactly with the force of the middle of the step; the chip is the difference to the motion one
    tooth period ago; force and chip are written out from the geometry of a square end mill.
    """
    tau = 2 * np.pi / (CUT.teeth * speed)
    count = len(model.poles)
    decay, turn = np.diag(model.poles.real), np.diag(model.poles.imag)
    state_matrix = np.block([[decay, -turn], [turn, decay]])
    enter = np.concatenate([model.left.real, model.left.imag])
    leave = 2 * np.concatenate([model.right.real, -model.right.imag]).T
    step = expm(state_matrix * tau / steps)
    force_step = np.linalg.solve(state_matrix, (step - np.eye(2 * count)) @ enter)
    state = enter @ np.array([1e-3, 2e-3, 0.0])
    moved = np.zeros((periods * steps + 1, 3))
    moved[0] = leave @ state
    for k in range(periods * steps):
        phi = (np.pi / CUT.teeth * 2 * (k + 0.5) / steps) % (2 * np.pi / CUT.teeth)
        force = np.zeros(3)
        for tooth in range(CUT.teeth):
            angle = phi + 2 * np.pi * tooth / CUT.teeth
            if CUT.start_angle <= angle <= CUT.exit_angle:
                now = 1.5 * moved[k] - 0.5 * moved[k - 1] if k else moved[k]
                past = 0.5 * (moved[k - steps] + moved[k - steps + 1]) if k >= steps else np.zeros(3)
                chip = (now - past) @ np.array([np.sin(angle), np.cos(angle), 0.0])
                tangential = CUT.ktc * depth * chip
                radial, axial = CUT.krc * tangential, CUT.kac * tangential
                force += [
                    -tangential * np.cos(angle) - radial * np.sin(angle),
                    tangential * np.sin(angle) - radial * np.cos(angle),
                    -axial,
                ]
        state = step @ state + force_step @ force
        moved[k + 1] = leave @ state
    sizes = np.linalg.norm(moved, axis=1)
    third = len(sizes) // 3
    return float(np.log(sizes[-third // 2 :].max() / sizes[third : third + third // 2].max()))


@pytest.mark.long
@pytest.mark.parametrize(("x", "turn"), [(1.5, 0.0), (1.9, -30.0)])
def test_limits_stand_between_decay_and_growth_in_the_time_domain(x: float, turn: float) -> None:
    place = turned_place(tool_down([x, 0.1, 0.7]), np.radians(turn), "tool")
    q = wrist_solutions(CASE.robot.mechanism, target_of(place))[0]
    model = replace(modal_model_at(CASE.robot, q, axes=place.axes, highest_frequency=100.0), residuals=None)
    result = certified_lobes(model, CUT, np.array([SPEED]), 0.02)
    assert result.status == ("verified",)
    limit = float(result.depth_limits[0])
    assert growth(model, SPEED, 0.96 * limit) < 0
    assert growth(model, SPEED, 1.04 * limit) > 0


def test_deflection_is_that_of_a_direct_solve() -> None:
    """Independent coordinates and one dense solve, in place of multipliers: cut, own weight and payload together."""
    q = close_loops(CASE.robot.mechanism, named_posture(CASE, None))
    wrench, payload = np.array([30.0, -60, 20, 0, 0, 0.4]), Payload(20.0)
    structure = structure_at(CASE.robot, q)
    basis = coordinate_basis(structure)
    nodes = len(structure.positions)
    load = np.zeros((nodes, 6))
    load[structure.tip] += wrench + np.array([0, 0, -20 * 9.80665, 0, 0, 0])
    upwards = np.zeros((nodes, 6))
    upwards[:, 2] = 1.0
    loads = load.ravel() - 9.80665 * mass_matrix(structure) @ upwards.ravel()
    moved = basis @ np.linalg.solve(basis.T @ stiffness_matrix(structure) @ basis, basis.T @ loads)
    cut, weight = tool_deflection(CASE.robot, q, wrench, payload)
    assert cut + weight == pytest.approx(moved.reshape(nodes, 6)[structure.tip], rel=1e-6, abs=1e-12)


@pytest.mark.slow
def test_the_optimum_is_that_of_every_sequence_on_the_grid() -> None:
    """Three points, eight turns: all sequences are tried; refinement between the turns may only add to the best."""
    points = np.array([[1.5, 0.1, 0.7], [1.55, 0.1, 0.7], [1.58, 0.12, 0.7]])
    path = cut_path(points, attitudes_along(np.tile([0.0, 0, -1], (3, 1))))
    free = Redundancy(np.radians(np.arange(-150.0, 61, 30)), np.zeros(1), limit_margin=np.radians(5))
    cut = PathCut(CASE.robot, CUT, 2 * SPEED, 0.02, Payload())
    start = close_loops(CASE.robot.mechanism, named_posture(CASE, None))
    step = np.radians(15)
    wanted = PathGoal("depth", 0.5, step, step)
    optimised = optimise_postures(cut, path, free, Loading(np.zeros((3, 6)), "all"), wanted, start, None)
    cut = replace(cut, highest_frequency=optimised.kept.highest_frequency)
    tables = path_postures(CASE.robot, path, free, start)
    depths = []
    for place, postures in zip(path.places, tables, strict=True):
        axes = [free.place(place, float(tool), 0.0).axes for tool in postures.tool]
        requests = [PostureRequest(q, a, np.zeros(6)) for q, a in zip(postures.q, axes, strict=True)]
        depths.append(values_of(cut, requests).known_depth(0.02))
    best = 0.0
    for chosen in product(*(range(len(each)) for each in tables)):
        qs = [each.q[i] for each, i in zip(tables, chosen, strict=True)]
        if max(np.abs(a - b).max() for a, b in pairwise(qs)) <= step:
            best = max(best, min(depth[i] for depth, i in zip(depths, chosen, strict=True)))
    assert best > 0
    assert optimised.after.values.known_depth(0.02).min() >= 0.97 * best
    assert set(optimised.after.values.status) == {"verified"}
