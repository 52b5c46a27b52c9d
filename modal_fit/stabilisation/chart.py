"""`StabilisationChart`: poles over model order, and the automatic choice that says why a pole was dropped."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from .matrix_fraction import OrderPoles
from .one_pole import OnePole

Complex = NDArray[np.complex128]
_FREQUENCY, _DAMPING, _VECTOR = 0.01, 0.10, 0.95  # changes from order to order that count as stable
_REACH = 0.03  # relative distance in the complex plane within which a pole continues a mode
_MEMORY = 5  # latest orders that say where a mode is
_SHARE = 0.4  # of all orders that a mode must be found in


@dataclass(frozen=True)
class StabilisationChart:
    """All poles of all orders, each with how stable it is.

    Parameters
    ----------
    orders, poles, stability : (n_poles,)
        Model order, pole (rad/s), and class: 0 new, 1 stable in frequency, 2 also in damping, 3 also in vector.
    vectors : (n_poles, n_dof)
        Unit modal vectors (participation or shape).
    band : Hz
        Lowest and highest frequency of the chart.
    """

    orders: NDArray[np.int64]
    poles: Complex
    stability: NDArray[np.int64]
    vectors: Complex
    band: tuple[float, float]

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Natural frequency of each pole, Hz."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def damping_ratios(self) -> NDArray[np.float64]:
        """Damping ratio of each pole, zeta."""
        return -self.poles.real / np.abs(self.poles)


@dataclass(frozen=True)
class PoleGroup(OnePole):
    """Poles of several orders taken for one mode.

    Parameters
    ----------
    pole
        Median over the upper half of the orders, rad/s.
    n_orders
        Orders it was found in.
    reason
        Why it was dropped; empty where it was kept.
    """

    pole: complex
    n_orders: int
    reason: str = ""


def stabilisation_chart(by_order: Sequence[OrderPoles], band: tuple[float, float]) -> StabilisationChart:
    """Compare each order's poles with those of the order before."""
    orders, poles, stability, vectors = [], [], [], []
    previous: OrderPoles | None = None
    for current in by_order:
        for pole, vector in zip(current.poles, current.participation, strict=True):
            orders.append(current.order)
            poles.append(pole)
            vectors.append(vector)
            stability.append(0 if previous is None else _stability(pole, vector, previous))
        previous = current
    width = by_order[0].participation.shape[1] if by_order else 0
    return StabilisationChart(
        np.array(orders, dtype=np.int64),
        np.array(poles, dtype=complex),
        np.array(stability, dtype=np.int64),
        np.array(vectors, dtype=complex).reshape(len(poles), width),
        band,
    )


def _stability(pole: complex, vector: Complex, previous: OrderPoles) -> int:
    """0 to 3, by the nearest pole of the order before."""
    if not len(previous.poles):
        return 0
    nearest = int(np.argmin(np.abs(previous.poles - pole)))
    other = complex(previous.poles[nearest])
    if abs(abs(pole) - abs(other)) > _FREQUENCY * abs(pole):
        return 0
    zeta, other_zeta = -pole.real / abs(pole), -other.real / abs(other)
    if abs(zeta - other_zeta) > max(_DAMPING * zeta, 1e-3):
        return 1
    likeness = abs(np.vdot(vector, previous.participation[nearest])) ** 2
    return 3 if likeness > _VECTOR else 2


def choose_poles(chart: StabilisationChart) -> tuple[tuple[PoleGroup, ...], tuple[PoleGroup, ...]]:
    """Group stable poles over the orders; return the kept groups and the dropped ones with their reasons.

    Poles that are stable in frequency and damping are followed from order to order by their distance in the complex
    plane relative to their magnitude, so that two modes of like frequency and unlike damping stay two. A group
    is a mode when two fifths of all orders have it: what only high orders find follows noise or leakage.
    """
    stable = np.flatnonzero(chart.stability >= 2)
    if len(stable) == 0:
        return (), ()
    labels = _tracks(chart.poles[stable], chart.orders[stable])
    kept: list[PoleGroup] = []
    dropped: list[PoleGroup] = []
    top = int(chart.orders.max())
    for label in np.unique(labels):
        members = stable[labels == label]
        group = _group(chart, members)
        reason = _why_dropped(chart, members, group, top)
        (dropped if reason else kept).append(PoleGroup(group.pole, group.n_orders, reason))
    return tuple(sorted(kept, key=_by_frequency)), tuple(sorted(dropped, key=_by_frequency))


def _by_frequency(group: PoleGroup) -> float:
    return group.frequency


def _tracks(poles: Complex, orders: NDArray[np.int64]) -> NDArray[np.int64]:
    """Follow modes from order to order: poles of one order are never one mode, however close they are.

    Each order's poles are assigned to the modes found so far so that the summed distance is least; distance is that
    of the logarithms of the poles, which is relative to their magnitude.
    """
    logarithm = np.log(poles)
    labels = np.empty(len(poles), dtype=np.int64)
    members: list[list[complex]] = []
    for order in np.unique(orders):
        mine = np.flatnonzero(orders == order)
        centres = np.array([np.median(np.real(m[-_MEMORY:])) + 1j * np.median(np.imag(m[-_MEMORY:])) for m in members])
        distance = np.abs(logarithm[mine][:, None] - centres.reshape(1, -1))
        rows, columns = linear_sum_assignment(np.minimum(distance, 2 * _REACH))
        found = {int(row): int(column) for row, column in zip(rows, columns, strict=True)}
        for row, index in enumerate(mine):
            column = found.get(row)
            if column is None or distance[row, column] > _REACH:
                column = len(members)
                members.append([])
            members[column].append(complex(logarithm[index]))
            labels[index] = column
    return labels


def _group(chart: StabilisationChart, members: NDArray[np.int64]) -> PoleGroup:
    orders = chart.orders[members]
    upper = chart.poles[members[orders >= np.median(orders)]]
    middle = complex(np.median(upper.real), np.median(upper.imag))
    return PoleGroup(middle, len(np.unique(orders)))


def _why_dropped(chart: StabilisationChart, members: NDArray[np.int64], group: PoleGroup, top: int) -> str:
    """Empty where the group is a mode."""
    first = int(chart.orders[members].min())
    possible = len(np.unique(chart.orders))
    low, high = chart.band
    if group.n_orders < max(3, _SHARE * possible):
        return f"found in only {group.n_orders} of {possible} orders, first at {first} of {top}"
    edge = 0.01 * (high - low)
    if not low + edge < group.frequency < high - edge:
        return f"at the edge of the band {low:g} to {high:g} Hz"
    if group.damping_ratio > 0.5:
        return f"damping ratio {group.damping_ratio:.2f} is no vibration"
    spread = chart.damping_ratios[members].std() / max(group.damping_ratio, 1e-6)
    if spread > 0.5:
        return f"damping scatters by {100 * spread:.0f} % between orders"
    return ""
