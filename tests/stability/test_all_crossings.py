"""Crossings found along the circle against multipliers counted at depths, on random structures."""

import numpy as np
import pytest
from drawn_cuts import random_case

from millfrf.cutting import MillingProcess
from millfrf.stability import collocation, collocation_limits, multipliers
from millfrf.stability.floquet.collocated_period import period_operator
from millfrf.stability.floquet.crossings import Crossings, polished
from millfrf.stability.milling_loop import delay_system
from modal_fit import ModalModel

LABELS = ("T:+X", "T:+Y", "T:+Z")


@pytest.mark.parametrize("seed", range(12))
def test_counts_of_unstable_multipliers_follow_from_the_crossings(seed: int) -> None:
    """Non-reciprocal modes, low speeds, depths many times the first limit: where a coarse search would miss some."""
    rng = np.random.default_rng(seed)
    n_modes = int(rng.integers(1, 4))
    omega = 2 * np.pi * np.sort(rng.uniform(30, 120, n_modes))
    damping = rng.uniform(0.01, 0.06, n_modes)
    poles = omega * (-damping + 1j * np.sqrt(1 - damping**2))
    shapes = rng.normal(size=(n_modes, 3))
    model = ModalModel(
        poles,
        shapes / (2j * poles.imag[:, None] * rng.uniform(1, 3, (n_modes, 1))),
        shapes + 0.15 * rng.normal(size=(n_modes, 3)) + 0j,
        LABELS,
        LABELS,
    )
    start = rng.uniform(0, 1.8)
    process = MillingProcess(
        int(rng.integers(1, 5)), 0.01, np.pi / 2, 2e8, 0.3, 0.1, start, min(start + rng.uniform(0.5, 3.1), np.pi), 1e-4
    )
    speeds = np.sort(rng.uniform(700, 4000, 4)) * np.pi / 30
    limits = collocation_limits(model, process, speeds, 4e-3)
    depths = np.linspace(2e-4, 4e-3, 20)
    counted = limits.unstable_multipliers(depths)
    for k, speed in enumerate(speeds):
        for depth, count in zip(depths, counted[k], strict=True):
            edges = limits.depth[limits.speed == k]
            if len(edges) and np.abs(edges - depth).min() < 1e-6:
                continue
            here = multipliers(model, process, float(speed), float(depth)).values
            assert (np.abs(here) > 1).sum() == count, (speed, depth)
    lowest = collocation(model, process, speeds, 4e-3).depth_limits
    first = [limits.depth[limits.speed == k].min(initial=np.inf) for k in range(len(speeds))]
    np.testing.assert_allclose(lowest, first, rtol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_crossings_are_polished_near_their_start_or_given_up(seed: int) -> None:
    """Newton steps from a wrong start went to any depth, and one ended where the collocation is singular."""
    case, rng = random_case(seed), np.random.default_rng(seed)
    operator = period_operator(delay_system(case.model, case.cut), np.array([2 * np.pi / (case.cut.teeth * 150.0)]))
    count = 200
    start = Crossings(
        np.zeros(count, dtype=np.int64),
        10 ** rng.uniform(-5, 0, count),
        rng.uniform(0.01, np.pi, count),
        np.ones(count, dtype=bool),
    )
    ended, converged = polished(operator, start)
    assert not converged.all()
    np.testing.assert_allclose(ended.depth, start.depth, rtol=0.1)
    np.testing.assert_allclose(ended.theta, start.theta, atol=0.1)
