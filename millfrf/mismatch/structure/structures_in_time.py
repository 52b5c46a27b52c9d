"""Structures at the beginning and at the end of a recording in which a stiffness changes."""

from dataclasses import replace
from typing import Any

import numpy as np

from millfrf.core import Complex, Index
from modal_fit import ModalModel

from ..joints.joint_law import JointLaw
from ..models.hypothesis import Hypothesis
from ..models.model_terms import hypothesis_of
from ..physics.joint_laws import SPEED_STIFFNESS
from ..physics.wider_forms import families


def structures_in_time(model: ModalModel) -> tuple[ModalModel, ...]:
    """Return the modes at the beginning and at the end of a recording, from a model with the terms of a diagnosis.

    A stiffness that follows the spindle speed has its lowest and its highest speed there.

    A stiffness k along b changes the modal coordinates ``q' = p q + l.F`` of all modes and their conjugates to
    ``q' = (p - k (l.b) (b.r)) q + l.F``, whose eigenvectors give the new modes.

    Parameters
    ----------
    model
        Modal model in m/N; its own modes are those between beginning and end at which no stiffness is added.

    Returns
    -------
    tuple of ModalModel
        Empty where no stiffness changes in time, or where a mode does not vibrate any more.
    """
    if not model.physics:
        return ()
    hypothesis = hypothesis_of(model)
    drifting = [families(cause.law()) == "t" for cause in hypothesis.laws]
    if not any(drifting):
        return ()
    ends = [
        _stiffened(model, hypothesis, [_stiffness(cause.law(), tau) for cause in hypothesis.laws], drifting)
        for tau in (-0.5, 0.5)
    ]
    vibrating = tuple(end for end in ends if end is not None)
    return vibrating if len(vibrating) == len(ends) else ()


def modes_in_time(model: ModalModel) -> dict[str, Any] | None:
    """Return natural frequencies at the beginning and the end, or at the lowest and highest speed; None: no change.

    Parameters
    ----------
    model
        Modal model with the terms of a diagnosis.
    """
    ends = structures_in_time(model)
    if not ends:
        return None
    first, last = (end.natural_frequencies.tolist() for end in ends)
    low, high = (", ".join(f"{frequency:.4g}" for frequency in each) for each in (first, last))
    by_speed = any(term["name"] == SPEED_STIFFNESS.name for term in model.physics)
    places = ("the lowest speed", "the highest") if by_speed else ("the beginning of a recording", "its end")
    sentence = f"The modes move from {low} Hz at {places[0]} to {high} Hz at {places[1]}."
    return {"beginning_hz": first, "end_hz": last, "sentence": sentence}


def _stiffness(law: JointLaw, tau: float) -> float:
    """Return the stiffness, N/m, that a law adds at a time of -1/2 (beginning) to 1/2 (end)."""
    constant = (law.stiffness[-1] - law.stiffness[0]) / (2 * law.reach) if len(law.stiffness) else 0.0
    return float(constant + law.ramp * tau + law.bend * (4 * tau**2 - 1))


def _stiffened(
    model: ModalModel, hypothesis: Hypothesis, stiffnesses: list[float], chosen: list[bool]
) -> ModalModel | None:
    """Return a model with stiffnesses along the chosen joints; None if a mode does not vibrate any more."""
    reach = hypothesis.reach
    poles, right, left = (
        np.concatenate([part, part.conj()]) for part in (reach.model.poles, reach.model.right, reach.model.left)
    )
    matrix = np.diag(poles)
    for path, stiffness, is_chosen in zip(reach.paths, stiffnesses, chosen, strict=True):
        if is_chosen:
            matrix = matrix - stiffness * np.outer(left @ path.push, right @ path.along)
    values, vectors = np.linalg.eig(matrix)
    upper = _upper(values)
    if len(upper) != len(model.poles):
        return None
    inverse = np.linalg.inv(vectors)
    return replace(
        model,
        poles=values[upper],
        right=vectors.T[upper] @ right[:, : len(model.responses)],
        left=inverse[upper] @ left[:, : len(model.excitations)],
        physics=(),
        covariance=None,
        errors=None,
    )


def _upper(values: Complex) -> Index:
    """Return the places of the poles in the upper half-plane, by frequency."""
    places = np.flatnonzero(np.imag(values) > 0)
    return np.asarray(places[np.argsort(np.abs(values[places]))])
