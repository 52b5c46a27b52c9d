"""Poles over model order by a right matrix fraction, and the stabilisation chart."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex

_ARC = 1.7 * np.pi  # the band's share of the unit circle; the gap keeps its two ends apart


_REGULAR = 1e-6  # smallest over largest diagonal entry of a Cholesky factor


@dataclass(frozen=True)
class OrderPoles:
    """Poles of one model order.

    Parameters
    ----------
    order
        Degree of the denominator. Its coefficients are complex and its band is one-sided, so that each degree holds a
        mode an excitation; the real polynomials of the textbooks need two degrees for one.
    poles : (n_poles,), rad/s
        Poles of that order that are stable and lie inside the band.
    participation : (n_poles, n_excitations)
        Unit participation vectors: the left vectors up to a factor.
    """

    order: int
    poles: Complex
    participation: Complex


@dataclass(frozen=True)
class _NormalMatrices:
    denominator: Complex  # (n+1, n_e, n+1, n_e): sum over responses of H^H H z^(s-r)
    reduced: Complex  # (n+1, n_responses, n+1, n_e): numerator rows, whitened by the Cholesky factor


def matrix_fraction_poles(
    frf: Frf, band: tuple[float, float], max_order: int, weights: NDArray[np.float64] | None = None
) -> Iterator[OrderPoles]:
    """Give the poles of every order 1 ... ``max_order`` from one factorisation.

    ``H(z) = B(z) A(z)^-1`` with complex polynomials in ``z = exp(i arc (f - f_low) / (f_high - f_low))``,
    so that a narrow band far from 0 Hz is as well posed as any. The numerator is eliminated by the Cholesky factor
    of its normal matrix; because leading blocks of a Cholesky factor are the factors of leading blocks, every lower
    order's reduced normal matrix follows by leaving rows out (Peeters, Guillaume, Van der Auweraer et al., The PolyMAX
    frequency-domain method, Shock and Vibration 11, 2004).

    Parameters
    ----------
    frf
        FRF; its valid lines inside ``band`` are used.
    band : Hz
        Lowest and highest frequency of the fit.
    max_order
        Highest order of the denominator.
    weights : (n_frequencies,), or None
        Weight of the squared error on each line; None: equal weights.
    """
    inside = frf.valid & (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    angles = _ARC * (frf.frequencies[inside] - band[0]) / (band[1] - band[0])
    values = frf.values[inside]
    scale = np.ones(len(angles)) if weights is None else weights[inside]
    normal = _normal_matrices(values, angles, scale / scale.mean(), max_order)
    n_excitations = values.shape[2]
    numerator = np.zeros(normal.denominator.shape, dtype=complex)
    eliminated = numerator.reshape((max_order + 1) * n_excitations, -1)
    for order in range(max_order + 1):
        rows = normal.reduced[order].reshape(values.shape[1], -1)
        eliminated += rows.conj().T @ rows
        if order == 0:
            continue
        size = (order + 1) * n_excitations
        full = normal.denominator.reshape(eliminated.shape)[:size, :size] - eliminated[:size, :size]
        yield _poles_of_order(full, order, n_excitations, band)


def _normal_matrices(
    values: Complex, angles: NDArray[np.float64], weights: NDArray[np.float64], max_order: int
) -> _NormalMatrices:
    """All sums over lines depend on the difference of powers only: one product for each kind."""
    n_lines, n_responses, n_excitations = values.shape
    count = max_order + 1
    shifts = np.exp(1j * np.outer(np.arange(-max_order, count), angles)) * weights
    gram = np.einsum("kpi,kpj->kij", values.conj(), values).reshape(n_lines, -1)
    sums = shifts @ np.concatenate([np.ones((n_lines, 1)), values.reshape(n_lines, -1), gram], axis=1)
    difference = np.arange(count)[None, :] - np.arange(count)[:, None] + max_order  # [r, s] -> s - r
    vandermonde = sums[:, 0][difference]
    factor = np.linalg.cholesky(vandermonde + 1e-13 * n_lines * np.eye(count))
    mixed = sums[:, 1 : 1 + n_responses * n_excitations][difference]
    # rows: numerator power r; columns: denominator power s
    mixed = mixed.reshape(count, count, n_responses, n_excitations).transpose(0, 2, 1, 3)
    reduced = scipy.linalg.solve_triangular(factor, mixed.reshape(count, -1), lower=True).reshape(
        count, n_responses, count, n_excitations
    )
    square = sums[:, 1 + n_responses * n_excitations :][difference]
    square = square.reshape(count, count, n_excitations, n_excitations).transpose(0, 2, 1, 3)
    return _NormalMatrices(np.ascontiguousarray(square), np.ascontiguousarray(reduced))


def _logarithm_in_band(z: Complex) -> Complex:
    """Logarithm whose imaginary part lies on the band's arc, half of the gap before and half after it."""
    gap = np.pi - _ARC / 2
    angle = np.mod(np.angle(z) + gap, 2 * np.pi) - gap
    return np.asarray(np.log(np.abs(z)) + 1j * angle)


def _poles_of_order(full: Complex, order: int, n_excitations: int, band: tuple[float, float]) -> OrderPoles:
    """Solve for the denominator with its lowest coefficient the identity, and take its companion's eigenvalues.

    With the lowest coefficient fixed and exp(+iwt), poles that only follow noise come out unstable and are left out
    (Cauberghe, Guillaume, Verboven & Parloo, Identification of modal parameters ..., JSV 283, 2005).
    """
    free, fixed = full[n_excitations:, n_excitations:], full[n_excitations:, :n_excitations]
    coefficients = _solve_hermitian(free, -fixed).reshape(order, n_excitations, n_excitations)
    # A(z) v = 0 with A_0 = I: in 1/z, the monic polynomial z^-n + A_1 z^-(n-1) + ... reversed
    size = order * n_excitations
    companion = np.zeros((size, size), dtype=complex)
    companion[n_excitations:, : size - n_excitations] = np.eye(size - n_excitations)
    companion[:n_excitations] = -coefficients.transpose(1, 0, 2).reshape(n_excitations, size)
    inverse: Complex = np.linalg.eigvals(companion).astype(complex)
    step = _ARC / (2 * np.pi * (band[1] - band[0]))
    z: Complex = 1 / inverse[np.abs(inverse) > 1.0]  # the others are unstable
    poles = 2j * np.pi * band[0] + _logarithm_in_band(z) / step
    low, high = 2 * np.pi * band[0], 2 * np.pi * band[1]
    kept = (poles.real < 0) & (poles.imag > low) & (poles.imag < high) & (poles.real > -0.7 * np.abs(poles))
    return OrderPoles(order, poles[kept], _null_vectors(coefficients, z[kept]))


def _solve_hermitian(matrix: Complex, right_side: Complex) -> Complex:
    """Cholesky where the matrix is regular in double precision, else the least-norm solution."""
    try:
        factor, lower = scipy.linalg.cho_factor(matrix, lower=True, check_finite=False)
        diagonal = np.abs(np.diag(factor))
        if diagonal.min() > _REGULAR * diagonal.max():
            return np.asarray(scipy.linalg.cho_solve((factor, lower), right_side, check_finite=False))
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(matrix, right_side, rcond=1e-14)[0])


def _null_vectors(coefficients: Complex, z: Complex) -> Complex:
    """Unit vectors v with ``A(z) v = 0``, shape (n_poles, n_excitations)."""
    if not len(z):
        return np.empty((0, coefficients.shape[1]), dtype=complex)
    powers = z[:, None] ** np.arange(1, len(coefficients) + 1)
    matrices = np.eye(coefficients.shape[1]) + np.einsum("kr,rij->kij", powers, coefficients, optimize=True)
    return np.asarray(np.linalg.svd(matrices)[2][:, -1].conj())


class OnePole:
    """Frequency and damping of whatever has one ``pole`` (rad/s), for dataclasses to share."""

    pole: complex

    @property
    def frequency(self) -> float:
        """Natural frequency, Hz: ``|pole| / 2 pi``."""
        return abs(self.pole) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio zeta: ``-Re pole / |pole|``."""
        return -self.pole.real / abs(self.pole)


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
        rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(distance, 2 * _REACH))
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


def chart_to_json(chart: StabilisationChart) -> dict[str, Any]:
    """A chart as lists, without vectors."""
    return {
        "orders": chart.orders.tolist(),
        "poles_rad_per_s": np.stack([chart.poles.real, chart.poles.imag], axis=1).round(6).tolist(),
        "stability": chart.stability.tolist(),
        "band_hz": list(chart.band),
    }


def chart_from_json(stored: dict[str, Any]) -> StabilisationChart:
    """The chart that :func:`chart_to_json` stored, without vectors (no figure needs them)."""
    poles = np.asarray(stored["poles_rad_per_s"], dtype=float).reshape(-1, 2)
    low, high = stored["band_hz"]
    return StabilisationChart(
        np.asarray(stored["orders"], dtype=np.int64),
        poles[:, 0] + 1j * poles[:, 1],
        np.asarray(stored["stability"], dtype=np.int64),
        np.zeros((len(poles), 0), dtype=complex),
        (float(low), float(high)),
    )
