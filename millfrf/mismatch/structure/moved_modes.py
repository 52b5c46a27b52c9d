"""Refitted modes as a cause: the poles, rows and columns that moved, and by how many laboratory errors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from millfrf.core import listed

from ..inference.diagnosis import AcceptedCause
from ..models.fitting import Fit, excess_of_modes, modes_are_implausible
from ..models.hypothesis import Hypothesis
from ..physics.linear_causes import MODAL_PARAMETERS


@dataclass(frozen=True)
class MovedPart:
    """A part of the modal model, and its deviation from the nominal model."""

    part: str  # such as ``frequency of mode 2`` or ``row TCP:+X``
    errors: float  # root mean square deviation of its numbers, laboratory errors
    implausible: bool  # whether errors of the usual size do not explain the deviation

    def __str__(self) -> str:
        return f"{self.part} by {self.errors:.2g} laboratory errors"


def moved_parts(hypothesis: Hypothesis) -> tuple[MovedPart, ...]:
    """Return the poles, rows and columns of the refitted modes with their deviations, largest first.

    A row contains the entries of one response in the right vectors of all modes, a column those of one excitation in
    the left vectors: an exchanged, reversed or badly mounted transducer changes one row or column of all modes.
    """
    shape = hypothesis.shape
    numbers = shape.deviations(hypothesis.u)
    n, m = len(hypothesis.model.responses), len(hypothesis.model.excitations)
    groups = [(f"frequency of mode {k + 1}", row[:1]) for k, row in enumerate(numbers)]
    groups += [(f"damping ratio of mode {k + 1}", row[1:2]) for k, row in enumerate(numbers)]
    right, left = numbers[:, 2 : 2 + 2 * n], numbers[:, 2 + 2 * n :]
    groups += [(f"row {label}", right[:, [p, p + n]].ravel()) for p, label in enumerate(hypothesis.model.responses)]
    groups += [(f"column {label}", left[:, [q, q + m]].ravel()) for q, label in enumerate(hypothesis.model.excitations)]
    parts = [
        MovedPart(
            name,
            float(np.sqrt(np.mean(values**2))),
            MODAL_PARAMETERS.implausible(float(values @ values), len(values)),
        )
        for name, values in groups
    ]
    return tuple(sorted(parts, key=lambda part: -part.errors))


def modal_deviation(fitted: Fit) -> AcceptedCause | None:
    """Return the modal parameters as a cause if they deviate implausibly from the nominal model; else None."""
    if not modes_are_implausible(fitted):
        return None
    shape = fitted.hypothesis.shape
    count = shape.nominal_modes
    rows = shape.deviations(fitted.hypothesis.u)
    spread = np.sqrt(shape.modal_rows(np.diag(fitted.covariance)))[:count]
    model, nominal = fitted.hypothesis.model, shape.nominal
    modes = [k for k in range(count) if np.sum(rows[k] ** 2) > shape.per_mode + 3 * np.sqrt(2 * shape.per_mode)]
    parameters, errors = {}, {}
    for k in range(count):
        parameters[f"frequency_{k + 1}_hz"] = float(model.natural_frequencies[k])
        errors[f"frequency_{k + 1}_hz"] = float(spread[k, 0] * shape.lab.frequency * nominal.natural_frequencies[k])
        parameters[f"damping_ratio_{k + 1}"] = float(model.damping_ratios[k])
        errors[f"damping_ratio_{k + 1}"] = float(spread[k, 1] * shape.lab.damping * nominal.damping_ratios[k])
    place = {"modes": [k + 1 for k in modes], "moved": [str(part) for part in _implausible(fitted.hypothesis)]}
    return AcceptedCause(MODAL_PARAMETERS.name, place, parameters, errors, excess_of_modes(fitted))


MOST_LISTED = 3  # most parts that a sentence lists


def _implausible(hypothesis: Hypothesis) -> Sequence[MovedPart]:
    """Return the parts that moved most and implausibly far, largest first; the largest one if none is implausible."""
    parts = moved_parts(hypothesis)
    return ([part for part in parts if part.implausible] or list(parts[:1]))[:MOST_LISTED]


def another_structure(hypothesis: Hypothesis, most: float) -> str:
    """Return a sentence if a part of the refitted modes moved by over ``most`` laboratory errors; else an empty text.

    Modes that far from the nominal ones are no errors of a modal test, and do not explain the difference.
    """
    far = [part for part in moved_parts(hypothesis) if part.errors > most]
    if not far:
        return ""
    return (
        "another structure or another wiring: with refitted modes the nominal model moves in "
        f"{listed([str(part) for part in far], MOST_LISTED)}, beyond the {most:g} up to which a modal test may be "
        "wrong; compare pose, tool, and names, signs and directions of the channels with those of the modal test"
    )
