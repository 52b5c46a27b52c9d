"""Candidates for modes: groups of poly-reference poles over several ranges of order, the most stable first."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation import Frf
from millfrf.core import Band, Complex, Real

from ..settings import SETTINGS
from ..stabilisation import (
    PoleGroup,
    PoleMixin,
    StabilisationChart,
    choose_poles,
    matrix_fraction_poles,
    stabilisation_chart,
)


@dataclass(frozen=True)
class Candidate(PoleMixin):
    """A pole that may be a mode."""

    pole: complex  # rad/s, in the upper half plane
    order_share: float  # share of the orders that have the pole, in the range of orders where that share is largest
    n_orders: int  # orders in which it was found
    participation: Complex  # (n_excitations,): left vector up to a factor, from the order with the nearest pole

    def dropped(self, reason: str) -> PoleGroup:
        """Return the candidate as a dropped group of poles, with the reason."""
        return PoleGroup(self.pole, self.n_orders, reason)


def default_order(n_lines: int, n_excitations: int) -> int:
    """Return the highest order for a band of ``n_lines`` lines; each order has one pole per excitation.

    >>> [default_order(1000, n) for n in (1, 3, 6)], default_order(100, 3)
    ([60, 40, 24], 40)
    """
    return max(6, min(int(np.clip(SETTINGS.most_poles // n_excitations, 24, 60)), n_lines // 2))


def find_candidates(
    frf: Frf, band: Band, max_order: int, weights: Real | None
) -> tuple[StabilisationChart, tuple[Candidate, ...]]:
    """Find the poles of all orders; return the chart, and the groups of poles as candidates, the most stable first.

    Each response and each excitation is first scaled to unit root mean square, so that no entry dominates. The damping
    of an exponential window is subtracted. Parameters are those of :func:`matrix_fraction_poles`.
    """
    balanced, scale = _balanced(frf, band)
    by_order = list(matrix_fraction_poles(balanced, band, max_order, weights))
    if frf.exponential_time_constant is not None:
        by_order = [replace(order, poles=order.poles + 1 / frf.exponential_time_constant) for order in by_order]
    chart = stabilisation_chart(by_order, band)
    # low orders show strong modes, high orders weak and close ones
    ranges = [max(6, round(share * max_order)) for share in SETTINGS.order_ranges]
    candidates = [candidate for top in ranges for candidate in _up_to_order(chart, top, scale)]
    return chart, tuple(_distinct(sorted(candidates, key=lambda candidate: -candidate.order_share)))


def _balanced(frf: Frf, band: Band) -> tuple[Frf, Real]:
    """Scale rows and columns of the FRF to unit root mean square; also return the scale of the columns."""
    inside = frf.valid & (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    values = frf.values
    for axes in ((0, 2), (0, 1)):
        size = np.sqrt(np.mean(np.abs(values[inside]) ** 2, axis=axes, keepdims=True))
        scale = np.where(size > 0, size, 1.0)
        values = values / scale
    return replace(frf, values=values, covariance=None, coherence=None, averages=None), scale[0, 0]


def _up_to_order(chart: StabilisationChart, top: int, scale: Real) -> list[Candidate]:
    """Return the candidates from the orders up to ``top``.

    ``scale`` (n_excitations,) converts their participation vectors back to the unscaled FRF.
    """
    low = chart.orders <= top
    lower = replace(
        chart,
        orders=chart.orders[low],
        poles=chart.poles[low],
        stability=chart.stability[low],
        vectors=chart.vectors[low],
    )
    n_orders = max(1, len(np.unique(lower.orders)))
    groups, dropped = choose_poles(lower)
    return [
        Candidate(
            group.pole,
            group.n_orders / n_orders,
            group.n_orders,
            scale * lower.vectors[int(np.argmin(np.abs(lower.poles - group.pole)))],
        )
        for group in (*groups, *dropped)
        if group.n_orders >= max(3, SETTINGS.order_share_of_candidate * n_orders)
        and group.damping_ratio < SETTINGS.largest_damping
        and group.pole.real < 0
    ]


def _distinct(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Drop every candidate whose pole is close to that of a more stable candidate."""
    distinct: list[Candidate] = []
    for candidate in candidates:
        if all(
            abs(np.log(candidate.pole / other.pole))
            > SETTINGS.same_candidate * max(candidate.damping_ratio, other.damping_ratio)
            for other in distinct
        ):
            distinct.append(candidate)
    return distinct
