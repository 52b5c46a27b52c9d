"""Each measured posture left out in turn: do the bands that the others give hold what was measured?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .learning import LearnedPostures, assembled
from .modes import KNOWN, MeasuredModes, mode_pairs
from .predicting import PredictedPosture, predict_posture

Real = NDArray[np.float64]

LEAST = 3
"""Postures without which leaving one out says nothing."""

SAME_POSTURE = 1e-3
"""Difference of joint values (rad, m) up to which two measurements are of one posture, and are left out together."""


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
    measured : (n_modes, 2)
        Measured natural frequency (Hz) and damping ratio of the modes that have a predicted partner.
    low, high : (n_modes, 2)
        Ends of that band.
    """

    name: str
    errors: Real
    held: NDArray[np.bool_]
    measured: Real
    low: Real
    high: Real


def left_out_postures(learned: LearnedPostures, samples: int = 120) -> tuple[LeftOutPosture, ...]:
    """Predict every measured posture from the others; empty for fewer than three postures.

    All measurements of one posture are left out together: what a repeat says of its posture is no prediction.

    The hyperparameters and the point of linearisation stay those of all postures; measurements do not.

    Parameters
    ----------
    learned
        Process over postures.
    samples
        Number of models to draw for each posture.
    """
    groups = _of_one_posture(learned)
    if len(groups) < LEAST:
        return ()
    found = {p: one for group in groups for p, one in zip(group, _left_out(learned, group, samples), strict=True)}
    return tuple(found[p] for p in sorted(found))


def _of_one_posture(learned: LearnedPostures) -> list[list[int]]:
    """Numbers of the measurements of each posture."""
    groups: list[list[int]] = []
    for p, one in enumerate(learned.measured):
        for group in groups:
            if np.abs(learned.measured[group[0]].driven - one.driven).max() <= SAME_POSTURE:
                group.append(p)
                break
        else:
            groups.append([p])
    return groups


def _left_out(learned: LearnedPostures, group: list[int], samples: int) -> list[LeftOutPosture]:
    kept = [p for p in range(len(learned.measured)) if p not in group]
    others = assembled(
        learned.robot,
        [learned.measured[p] for p in kept],
        tuple(learned.pairs[p] for p in kept),
        (learned.best, learned.draws),
        (learned.stiffness[kept], learned.mass),
    )
    found = predict_posture(others, learned.measured[group[0]].driven, samples=samples)
    return [_beside(learned.measured[number], number, found) for number in group]


def _beside(one: MeasuredModes, number: int, found: PredictedPosture) -> LeftOutPosture:
    """One measurement beside the prediction of its posture."""
    model = found.model
    moved = model.right.real @ one.directions.T
    pairs = mode_pairs(one.frequencies, one.shapes, model.natural_frequencies, moved, KNOWN)
    rng = np.random.default_rng(number)
    rows = []
    drawn = np.array([[draw.natural_frequencies, draw.damping_ratios] for draw in found.draws])
    for i, r in pairs:
        measured = np.log([one.frequencies[i], one.damping[i]])
        seen = np.log(drawn[:, :, r]) + one.errors[i, :2] * rng.normal(size=(len(drawn), 2))
        low, high = np.quantile(seen, [0.025, 0.975], axis=0)
        rows.append((measured - seen.mean(axis=0), measured, low, high))
    errors, measured, low, high = np.array(rows).reshape(-1, 4, 2).transpose(1, 0, 2)
    held = (low <= measured) & (measured <= high)
    return LeftOutPosture(one.name, errors, held, np.exp(measured), np.exp(low), np.exp(high))
