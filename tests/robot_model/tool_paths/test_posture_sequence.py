"""The sequence of postures against every sequence there is."""

from itertools import pairwise, product

import numpy as np
import pytest

from millfrf.robot_model import best_sequence

Real = np.ndarray


def every_sequence(costs: list[Real], nodes: list[Real]) -> list[tuple[float, tuple[int, ...]]]:
    """Largest cost of every continuous sequence."""
    result = []
    for chosen in product(*(range(len(cost)) for cost in costs)):
        steps = [np.abs(nodes[k][i] - nodes[k + 1][j]).max() for k, (i, j) in enumerate(pairwise(chosen))]
        if max(steps) <= 1:
            result.append((max(float(cost[i]) for cost, i in zip(costs, chosen, strict=True)), chosen))
    return result


@pytest.mark.parametrize("seed", range(20))
def test_no_continuous_sequence_has_a_lower_bottleneck(seed: int) -> None:
    random = np.random.default_rng(seed)
    sizes = random.integers(1, 6, 6)
    costs = [random.uniform(0, 1, n) for n in sizes]
    nodes = [random.uniform(0, 2.0, (n, 2)) for n in sizes]
    every = every_sequence(costs, nodes)
    result = best_sequence(costs, nodes)
    if not every:
        assert not len(result.chosen)
        assert result.bottleneck == np.inf
        return
    assert result.bottleneck == pytest.approx(min(cost for cost, _ in every))
    assert (result.bottleneck, tuple(result.chosen)) in [(pytest.approx(cost), chosen) for cost, chosen in every]


@pytest.mark.parametrize("seed", range(10))
def test_among_equals_the_shortest_is_taken(seed: int) -> None:
    random = np.random.default_rng(seed)
    costs = [np.ones(4) for _ in range(5)]
    nodes = [random.uniform(0, 1.5, (4, 2)) for _ in range(5)]
    extra = [random.uniform(0, 0.3, 4) for _ in range(5)]

    def length(chosen: tuple[int, ...]) -> float:
        steps = [np.sum((nodes[k][i] - nodes[k + 1][j]) ** 2) for k, (i, j) in enumerate(pairwise(chosen))]
        return float(0.7 * sum(steps) + sum(each[i] for each, i in zip(extra, chosen, strict=True)))

    best = min(length(chosen) for _, chosen in every_sequence(costs, nodes))
    result = best_sequence(costs, nodes, motion=0.7, extra=extra)
    assert length(tuple(result.chosen)) == pytest.approx(best)


def test_a_broken_path_says_how_far_it_leads() -> None:
    nodes = [np.zeros((1, 1)), np.zeros((1, 1)), np.full((1, 1), 5.0), np.zeros((1, 1))]
    result = best_sequence([np.zeros(1)] * 4, nodes)
    assert not len(result.chosen)
    assert result.reached == 2
