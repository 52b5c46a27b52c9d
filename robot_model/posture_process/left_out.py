"""Each measured posture left out in turn: do the bands that the others give hold what was measured?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .learning import LearnedPostures, assembled
from .modes import KNOWN, mode_pairs
from .predicting import predict_posture

Real = NDArray[np.float64]

LEAST = 3
"""Postures without which leaving one out says nothing."""


@dataclass(frozen=True)
class LeftOutPosture:
    """One measured posture beside what the others predict.

    Parameters
    ----------
    name
        Name of the measurement.
    errors : (n_modes, 2)
        Logarithms of measured over predicted frequency and damping ratio.
    held : (n_modes, 2), bool
        Whether the 95 % band, widened by the measurement's own error, holds them.
    """

    name: str
    errors: Real
    held: NDArray[np.bool_]


def left_out_postures(learned: LearnedPostures, samples: int = 120) -> tuple[LeftOutPosture, ...]:
    """Predict every measured posture from the others; empty for fewer than three postures.

    The hyperparameters and the point of linearisation stay those of all postures; measurements do not.

    Parameters
    ----------
    learned
        Process over postures.
    samples
        Number of models to draw for each posture.
    """
    if len(learned.measured) < LEAST:
        return ()
    return tuple(_left_out(learned, p, samples) for p in range(len(learned.measured)))


def _left_out(learned: LearnedPostures, number: int, samples: int) -> LeftOutPosture:
    kept = [p for p in range(len(learned.measured)) if p != number]
    others = assembled(
        learned.robot,
        [learned.measured[p] for p in kept],
        tuple(learned.pairs[p] for p in kept),
        (learned.best, learned.draws),
        (learned.stiffness[kept], learned.mass),
    )
    one = learned.measured[number]
    found = predict_posture(others, one.driven, samples=samples)
    model = found.model
    moved = model.right.real @ one.directions.T
    pairs = mode_pairs(one.frequencies, one.shapes, model.natural_frequencies, moved, KNOWN)
    rng = np.random.default_rng(number)
    errors, held = [], []
    drawn = np.array([[draw.natural_frequencies, draw.damping_ratios] for draw in found.draws])
    for i, r in pairs:
        measured = np.log([one.frequencies[i], one.damping[i]])
        seen = np.log(drawn[:, :, r]) + one.errors[i, :2] * rng.normal(size=(len(drawn), 2))
        low, high = np.quantile(seen, [0.025, 0.975], axis=0)
        errors.append(measured - seen.mean(axis=0))
        held.append((low <= measured) & (measured <= high))
    return LeftOutPosture(one.name, np.array(errors).reshape(-1, 2), np.array(held, dtype=bool).reshape(-1, 2))
