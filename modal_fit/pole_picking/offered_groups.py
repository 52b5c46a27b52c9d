"""Groups of poles that a picker offers: the modes of the automatic fit, and what it dropped with the reason."""

from dataclasses import dataclass

import numpy as np

from ..polyreference import ModalFit
from ..stabilisation import OnePole, StabilisationChart

_SAME = 0.003  # relative distance in the complex plane within which a pole of an order belongs to a group


@dataclass(frozen=True)
class CandidateGroup(OnePole):
    """A group of poles of the stabilisation chart, from which a user may pick.

    Parameters
    ----------
    number
        Number of the group, from 1 on, in order of frequency.
    pole : rad/s
        Pole of the group, in the upper half plane.
    n_orders
        Number of orders of the chart that have it.
    taken
        Whether the automatic fit took it for a mode.
    reason
        Reason why it was not taken; empty where it was.
    """

    number: int
    pole: complex
    n_orders: int
    taken: bool
    reason: str = ""


def candidate_groups(fit: ModalFit) -> tuple[CandidateGroup, ...]:
    """Number modes and dropped groups of a fit by frequency.

    Parameters
    ----------
    fit
        Result of :func:`fit_polyreference`.
    """
    poles = [(complex(pole), _orders_near(fit.chart, complex(pole)), True, "") for pole in fit.model.poles]
    poles += [(group.pole, group.n_orders, False, group.reason) for group in fit.dropped if group.pole.real < 0]
    ordered = sorted(poles, key=_frequency)
    return tuple(CandidateGroup(number, *values) for number, values in enumerate(ordered, start=1))


def _orders_near(chart: StabilisationChart, pole: complex) -> int:
    near = np.abs(np.log(chart.poles / pole)) < _SAME
    return len(np.unique(chart.orders[near]))


def _frequency(group: tuple[complex, int, bool, str]) -> float:
    return abs(group[0])
