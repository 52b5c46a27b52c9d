"""How far two modal models of one structure disagree, mode by mode, in units of their error bars."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from foundation import InputError

from .modal_model import ModalModel
from .shape_measures import modal_assurance
from .uncertainty import frequency_and_damping_errors

_REACH = 0.1  # relative distance of poles beyond which two modes are not the same


@dataclass(frozen=True)
class ModePair:
    """One mode in two models.

    Parameters
    ----------
    first, second
        Numbers of the mode in either model.
    frequency_change
        Natural frequency of the second less that of the first, Hz.
    frequency_error
        Standard error of the change, Hz; NaN where a model has no covariance.
    damping_change, damping_error
        The same of the damping ratio.
    right_likeness, left_likeness
        Modal assurance criterion of the right and of the left vectors.
    """

    first: int
    second: int
    frequency_change: float
    frequency_error: float
    damping_change: float
    damping_error: float
    right_likeness: float
    left_likeness: float

    @property
    def significance(self) -> float:
        """Larger of the two changes over their standard errors."""
        changes = np.array([self.frequency_change, self.damping_change])
        return float(np.max(np.abs(changes) / np.array([self.frequency_error, self.damping_error])))

    @property
    def moved(self) -> bool:
        """Whether frequency or damping moved by more than three standard errors of the change."""
        return self.significance > 3.0


def compare_modes(first: ModalModel, second: ModalModel) -> tuple[ModePair, ...]:
    """Pair the modes of two models by their poles and say how far they moved.

    Pairs minimise the summed distance ``|log(pole_2 / pole_1)|``; modes further apart than a tenth stay without a
    partner. The two fits' errors are taken as independent.

    Parameters
    ----------
    first, second
        Models with the same responses and excitations, in the same order.

    Raises
    ------
    InputError
        Degrees of freedom that differ.

    Examples
    --------
    >>> import numpy as np
    >>> pole = 100 * (-0.02 + 1j)
    >>> one = ModalModel(np.array([pole]), np.ones((1, 1)), np.ones((1, 1)), ("TCP:+X",), ("TCP:+X",))
    >>> two = ModalModel(np.array([1.01 * pole]), np.ones((1, 1)), np.ones((1, 1)), ("TCP:+X",), ("TCP:+X",))
    >>> [pair] = compare_modes(one, two)
    >>> round(pair.frequency_change, 3), pair.right_likeness
    (0.159, 1.0)
    """
    if (first.responses, first.excitations) != (second.responses, second.excitations):
        raise InputError(
            f"models of {', '.join(first.responses)} and of {', '.join(second.responses)} cannot be compared; "
            "give models of the same degrees of freedom"
        )
    distance = np.abs(np.log(first.poles)[:, None] - np.log(second.poles)[None, :])
    rows, columns = linear_sum_assignment(np.minimum(distance, 2 * _REACH))
    right, left = modal_assurance(first.right, second.right), modal_assurance(first.left, second.left)
    errors = [_errors(model) for model in (first, second)]
    pairs = []
    for i, j in zip(rows, columns, strict=True):
        if distance[i, j] > _REACH:
            continue
        change = np.array(
            [
                second.natural_frequencies[j] - first.natural_frequencies[i],
                second.damping_ratios[j] - first.damping_ratios[i],
            ]
        )
        spread = np.hypot(errors[0][:, i], errors[1][:, j])
        pairs.append(
            ModePair(
                int(i),
                int(j),
                float(change[0]),
                float(spread[0]),
                float(change[1]),
                float(spread[1]),
                float(right[i, j]),
                float(left[i, j]),
            )
        )
    return tuple(pairs)


def _errors(model: ModalModel) -> np.ndarray:
    found = frequency_and_damping_errors(model)
    return np.full((2, len(model.poles)), np.nan) if found is None else np.stack(found)
