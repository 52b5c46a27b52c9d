"""Candidates for modes: groups of poly-reference poles over several ranges of order, the steadiest first."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex

from ..stabilisation import (
    OnePole,
    PoleGroup,
    StabilisationChart,
    choose_poles,
    matrix_fraction_poles,
    stabilisation_chart,
)

_RANGES = (0.4, 0.6, 0.8, 1.0)  # of the highest order: low orders show strong modes, high orders weak and close ones
_LEAST_SHARE = 0.2  # of the orders of a range
_MOST_POLES = 120  # of the highest order
_SAME = 0.15  # distance over damping below which two poles are one candidate
_NO_VIBRATION = 0.5  # damping ratio


@dataclass(frozen=True)
class Candidate(OnePole):
    """A pole that may be a mode.

    Parameters
    ----------
    pole : rad/s
        The pole, in the upper half plane.
    share
        Share of the orders that have it, in the range of orders in which it is steadiest.
    n_orders
        Number of orders in which it was found.
    participation : (n_excitations,)
        Left vector up to a factor, of the order whose pole is nearest.
    """

    pole: complex
    share: float
    n_orders: int
    participation: Complex

    def dropped(self, reason: str) -> PoleGroup:
        """The group of poles as a dropped one."""
        return PoleGroup(self.pole, self.n_orders, reason)


def default_order(n_lines: int, n_excitations: int) -> int:
    """Highest order for a band of ``n_lines`` lines: each order has a pole an excitation.

    Examples
    --------
    >>> [default_order(1000, n) for n in (1, 3, 6)], default_order(100, 3)
    ([60, 40, 24], 40)
    """
    return max(6, min(int(np.clip(_MOST_POLES // n_excitations, 24, 60)), n_lines // 2))


def candidates(
    frf: Frf, band: tuple[float, float], max_order: int, weights: NDArray[np.float64] | None
) -> tuple[StabilisationChart, tuple[Candidate, ...]]:
    """Find poles over all orders, and their groups in falling order of steadiness.

    Each response and each excitation is scaled to unit root mean square before, so that no entry decides alone. An
    exponential window's damping is taken back.

    Parameters
    ----------
    frf, band, max_order, weights
        FRF, band (Hz), highest order and weights, as in :func:`matrix_fraction_poles`.
    """
    balanced, scale = _balanced(frf, band)
    by_order = list(matrix_fraction_poles(balanced, band, max_order, weights))
    if frf.exponential_time_constant is not None:
        by_order = [replace(one, poles=one.poles + 1 / frf.exponential_time_constant) for one in by_order]
    chart = stabilisation_chart(by_order, band)
    found = [one for share in _RANGES for one in _of_range(chart, max(6, round(share * max_order)), scale)]
    return chart, tuple(_distinct(sorted(found, key=_minus_share)))


def _balanced(frf: Frf, band: tuple[float, float]) -> tuple[Frf, NDArray[np.float64]]:
    """The FRF with rows and columns of one size, and what the columns were divided by."""
    inside = frf.valid & (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    values = frf.values
    for axes in ((0, 2), (0, 1)):
        size = np.sqrt(np.mean(np.abs(values[inside]) ** 2, axis=axes, keepdims=True))
        scale = np.where(size > 0, size, 1.0)
        values = values / scale
    return replace(frf, values=values, covariance=None, coherence=None, averages=None), scale[0, 0]


def _of_range(chart: StabilisationChart, top: int, scale: NDArray[np.float64]) -> list[Candidate]:
    inside = chart.orders <= top
    part = replace(
        chart,
        orders=chart.orders[inside],
        poles=chart.poles[inside],
        stability=chart.stability[inside],
        vectors=chart.vectors[inside],
    )
    n_orders = max(1, len(np.unique(part.orders)))
    kept, dropped = choose_poles(part)
    return [
        Candidate(
            group.pole,
            group.n_orders / n_orders,
            group.n_orders,
            scale * part.vectors[int(np.argmin(np.abs(part.poles - group.pole)))],
        )
        for group in (*kept, *dropped)
        if group.n_orders >= max(3, _LEAST_SHARE * n_orders)
        and group.damping_ratio < _NO_VIBRATION
        and group.pole.real < 0
    ]


def _minus_share(candidate: Candidate) -> float:
    return -candidate.share


def _distinct(found: Sequence[Candidate]) -> list[Candidate]:
    """Drop candidates that a steadier candidate stands for."""
    distinct: list[Candidate] = []
    for one in found:
        reach = [_SAME * max(one.damping_ratio, other.damping_ratio) for other in distinct]
        distance = [abs(np.log(one.pole / other.pole)) for other in distinct]
        if all(far > near for far, near in zip(distance, reach, strict=True)):
            distinct.append(one)
    return distinct
