"""Poles over model order by a right matrix fraction, and the stabilisation chart."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import Band, Complex, FileFormatError, Index, Real

from .settings import SETTINGS

_ARC = 1.7 * np.pi  # part of the unit circle that the band covers; the gap keeps its two ends apart


class PoleMixin:
    """Natural frequency and damping ratio of a dataclass with one ``pole`` (rad/s)."""

    pole: complex

    @property
    def frequency(self) -> float:
        """Return the natural frequency ``|pole| / 2 pi``, Hz."""
        return abs(self.pole) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Return the damping ratio ``-Re pole / |pole|``."""
        return -self.pole.real / abs(self.pole)


@dataclass(frozen=True)
class OrderPoles:
    """Stable poles of one model order inside the band."""

    order: int  # degree of the denominator: its coefficients are complex, each degree adds one mode per reference
    poles: Complex  # (n_poles,), rad/s
    participation: Complex  # (n_poles, n_excitations): unit participation vectors, the left vectors up to a factor


def matrix_fraction_poles(frf: Frf, band: Band, max_order: int, weights: Real | None = None) -> Iterator[OrderPoles]:
    """Yield the poles of every order 1 ... ``max_order`` from one factorisation.

    ``H(z) = B(z) A(z)^-1`` with complex polynomials in ``z = exp(i arc (f - f_low) / (f_high - f_low))``,
    so that a narrow band far from 0 Hz is as well conditioned as any. The numerator is eliminated by the Cholesky
    factor of its normal matrix. Leading blocks of a Cholesky factor are the factors of leading blocks, so that the
    reduced normal matrix of every lower order follows by leaving rows out (Peeters, Guillaume, Van der Auweraer et al.,
    The PolyMAX frequency-domain method, Shock and Vibration 11, 2004).

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
    chosen = frf.valid & (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    angles = _ARC * (frf.frequencies[chosen] - band[0]) / (band[1] - band[0])
    values = frf.values[chosen]
    scale = np.ones(len(angles)) if weights is None else weights[chosen]
    denominator, reduced = _normal_matrices(values, angles, scale / scale.mean(), max_order)
    n_excitations = values.shape[2]
    eliminated = np.zeros(denominator.shape, dtype=complex)
    for order in range(max_order + 1):
        rows = reduced[order].reshape(values.shape[1], -1)
        eliminated += rows.conj().T @ rows
        if order > 0:
            size = (order + 1) * n_excitations
            yield _poles_of_order(denominator[:size, :size] - eliminated[:size, :size], order, n_excitations, band)


def _normal_matrices(values: Complex, angles: Real, weights: Real, max_order: int) -> tuple[Complex, Complex]:
    """Return the normal matrix of the denominator, and the numerator's rows whitened by its Cholesky factor.

    The sums over the lines only depend on the difference of two powers, so that one matrix product computes them.
    """
    n_lines, n_responses, n_excitations = values.shape
    count = max_order + 1
    shifts = np.exp(1j * np.outer(np.arange(-max_order, count), angles)) * weights
    gram = np.einsum("kpi,kpj->kij", values.conj(), values).reshape(n_lines, -1)
    sums = shifts @ np.concatenate([np.ones((n_lines, 1)), values.reshape(n_lines, -1), gram], axis=1)
    difference = np.arange(count)[None, :] - np.arange(count)[:, None] + max_order  # [r, s] -> s - r
    vandermonde = sums[:, 0][difference]
    factor = np.linalg.cholesky(vandermonde + 1e-13 * n_lines * np.eye(count))  # regular in spite of rounding
    mixed = sums[:, 1 : 1 + n_responses * n_excitations][difference]
    # rows: numerator power r; columns: denominator power s
    mixed = mixed.reshape(count, count, n_responses, n_excitations).transpose(0, 2, 1, 3)
    reduced = scipy.linalg.solve_triangular(factor, mixed.reshape(count, -1), lower=True)
    square = sums[:, 1 + n_responses * n_excitations :][difference]
    square = square.reshape(count, count, n_excitations, n_excitations).transpose(0, 2, 1, 3)
    return square.reshape(count * n_excitations, -1), np.ascontiguousarray(reduced)


def _logarithm_in_band(z: Complex) -> Complex:
    """Return the logarithm whose imaginary part lies on the arc of the band, or in half of the gap on either side."""
    gap = np.pi - _ARC / 2
    angle = np.mod(np.angle(z) + gap, 2 * np.pi) - gap
    return np.asarray(np.log(np.abs(z)) + 1j * angle)


def _poles_of_order(full: Complex, order: int, n_excitations: int, band: Band) -> OrderPoles:
    """Solve for the denominator with the identity as lowest coefficient; return its poles inside the band.

    With the lowest coefficient fixed and exp(+iwt), poles that only follow noise are unstable and are left out
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
    # a pole with a damping ratio above 0.7 is a trend, no vibration
    usable = (poles.real < 0) & (poles.imag > low) & (poles.imag < high) & (poles.real > -0.7 * np.abs(poles))
    return OrderPoles(order, poles[usable], _null_vectors(coefficients, z[usable]))


def _solve_hermitian(matrix: Complex, right_side: Complex) -> Complex:
    """Solve by Cholesky where the matrix is regular in double precision, else give the least-norm solution."""
    try:
        factor, lower = scipy.linalg.cho_factor(matrix, lower=True, check_finite=False)
        diagonal = np.abs(np.diag(factor))
        if diagonal.min() > SETTINGS.regular_diagonal * diagonal.max():
            return np.asarray(scipy.linalg.cho_solve((factor, lower), right_side, check_finite=False))
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(matrix, right_side, rcond=1e-14)[0])


def _null_vectors(coefficients: Complex, z: Complex) -> Complex:
    """Return unit vectors v with ``A(z) v = 0``, shape (n_poles, n_excitations)."""
    if not len(z):
        return np.empty((0, coefficients.shape[1]), dtype=complex)
    powers = z[:, None] ** np.arange(1, len(coefficients) + 1)
    matrices = np.eye(coefficients.shape[1]) + np.einsum("kr,rij->kij", powers, coefficients, optimize=True)
    return np.asarray(np.linalg.svd(matrices)[2][:, -1].conj())


@dataclass(frozen=True)
class StabilisationChart:
    """All poles of all orders, each with its stability from order to order.

    Parameters
    ----------
    orders, poles, stability : (n_poles,)
        Model order, pole (rad/s), and class: 0 new, 1 stable in frequency, 2 also in damping, 3 also in vector.
    vectors : (n_poles, n_dof)
        Unit modal vectors (participation or shape).
    band : Hz
        Lowest and highest frequency of the chart.
    """

    orders: Index
    poles: Complex
    stability: Index
    vectors: Complex
    band: Band

    @property
    def frequencies(self) -> Real:
        """Return the natural frequency of each pole, Hz."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def damping_ratios(self) -> Real:
        """Return the damping ratio of each pole."""
        return -self.poles.real / np.abs(self.poles)

    def within(self, band: Band) -> "StabilisationChart":
        """Return the poles whose frequency lies in a band (Hz)."""
        inside = (self.frequencies > band[0]) & (self.frequencies < band[1])
        return StabilisationChart(
            self.orders[inside], self.poles[inside], self.stability[inside], self.vectors[inside], band
        )


@dataclass(frozen=True)
class PoleGroup(PoleMixin):
    """Poles of several orders that belong to one mode."""

    pole: complex  # rad/s: median over the upper half of the orders
    n_orders: int  # orders in which it was found
    reason: str = ""  # reason why it was dropped; empty for a mode


def stabilisation_chart(by_order: Sequence[OrderPoles], band: Band) -> StabilisationChart:
    """Classify the poles of each order by their change from the order before."""
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
    """Return the stability class of a pole, 0 to 3, compared with the nearest pole of the order before."""
    if not len(previous.poles):
        return 0
    nearest = int(np.argmin(np.abs(previous.poles - pole)))
    other = complex(previous.poles[nearest])
    if abs(abs(pole) - abs(other)) > SETTINGS.stable_frequency * abs(pole):
        return 0
    zeta, other_zeta = -pole.real / abs(pole), -other.real / abs(other)
    if abs(zeta - other_zeta) > max(SETTINGS.stable_damping * zeta, 1e-3):  # absolute where damping is nearly 0
        return 1
    assurance = abs(np.vdot(vector, previous.participation[nearest])) ** 2
    return 3 if assurance > SETTINGS.stable_vector else 2


def choose_poles(chart: StabilisationChart) -> tuple[tuple[PoleGroup, ...], tuple[PoleGroup, ...]]:
    """Group stable poles over the orders; return the groups that are modes, and those that are not with their reasons.

    Poles that are stable in frequency and damping are followed from order to order by their distance in the complex
    plane relative to their magnitude, so that two modes of similar frequency and different damping stay two. A group is
    a mode when two fifths of all orders have it: poles that only high orders have follow noise or leakage.
    """
    stable = np.flatnonzero(chart.stability >= 2)
    if len(stable) == 0:
        return (), ()
    labels = _tracks(chart.poles[stable], chart.orders[stable])
    members = [stable[labels == label] for label in np.unique(labels)]
    groups = sorted((_group(chart, indices) for indices in members), key=attrgetter("frequency"))
    return tuple(g for g in groups if not g.reason), tuple(g for g in groups if g.reason)


def _tracks(poles: Complex, orders: Index) -> Index:
    """Assign a mode number to each pole; two poles of the same order never get the same number.

    Each order's poles are assigned to the modes found so far so that the summed distance is least. The distance of two
    poles is the distance of their logarithms, which is relative to their magnitude.
    """
    logarithm = np.log(poles)
    labels = np.empty(len(poles), dtype=np.int64)
    reach, memory = SETTINGS.track_reach, SETTINGS.track_memory
    tracks: list[list[complex]] = []
    for order in np.unique(orders):
        own = np.flatnonzero(orders == order)
        recent = [track[-memory:] for track in tracks]
        centres = np.array([np.median(np.real(track)) + 1j * np.median(np.imag(track)) for track in recent])
        distance = np.abs(logarithm[own][:, None] - centres.reshape(1, -1))
        rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(distance, 2 * reach))
        assigned = {int(row): int(column) for row, column in zip(rows, columns, strict=True)}
        for row, index in enumerate(own):
            column = assigned.get(row)
            if column is None or distance[row, column] > reach:
                column = len(tracks)
                tracks.append([])
            tracks[column].append(complex(logarithm[index]))
            labels[index] = column
    return labels


def _group(chart: StabilisationChart, members: Index) -> PoleGroup:
    orders = chart.orders[members]
    upper = chart.poles[members[orders >= np.median(orders)]]
    group = PoleGroup(complex(np.median(upper.real), np.median(upper.imag)), len(np.unique(orders)))
    return replace(group, reason=_drop_reason(chart, members, group))


def _drop_reason(chart: StabilisationChart, members: Index, group: PoleGroup) -> str:
    """Return the reason why a group is no mode; empty where it is a mode."""
    first, top = int(chart.orders[members].min()), int(chart.orders.max())
    possible = len(np.unique(chart.orders))
    low, high = chart.band
    if group.n_orders < max(3, SETTINGS.order_share_of_mode * possible):
        return f"found in only {group.n_orders} of {possible} orders, first at {first} of {top}"
    edge = 0.01 * (high - low)
    if not low + edge < group.frequency < high - edge:
        return f"at the edge of the band {low:g} to {high:g} Hz"
    if group.damping_ratio > SETTINGS.largest_damping:
        return f"damping ratio {group.damping_ratio:.2f} is no vibration"
    spread = chart.damping_ratios[members].std() / max(group.damping_ratio, 1e-6)
    if spread > SETTINGS.damping_scatter:
        return f"damping scatters by {100 * spread:.0f} % between orders"
    return ""


def joined_chart(charts: Sequence[StabilisationChart]) -> StabilisationChart:
    """Join the charts of FRFs that were fitted apart, without vectors, by rising order."""
    orders, poles, stability = (
        np.concatenate([getattr(chart, name) for chart in charts]) for name in ("orders", "poles", "stability")
    )
    by_order = np.argsort(orders, kind="stable")
    vectors = np.zeros((len(poles), 0), dtype=complex)
    return StabilisationChart(orders[by_order], poles[by_order], stability[by_order], vectors, charts[0].band)


def chart_to_json(chart: StabilisationChart) -> dict[str, Any]:
    """Convert a chart to lists for a JSON file, without vectors."""
    return {
        "orders": chart.orders.tolist(),
        "poles_rad_per_s": np.stack([chart.poles.real, chart.poles.imag], axis=1).round(6).tolist(),
        "stability": chart.stability.tolist(),
        "band_hz": list(chart.band),
    }


def chart_from_json(stored: dict[str, Any]) -> StabilisationChart:
    """Read the chart that :func:`chart_to_json` stored, without vectors (no figure needs them).

    Raises
    ------
    FileFormatError
        A field is missing, or holds something else than numbers in the form of the others.
    """
    try:
        poles = np.asarray(stored["poles_rad_per_s"], dtype=float).reshape(-1, 2)
        low, high = (float(frequency) for frequency in stored["band_hz"])
        orders, stability = (np.asarray(stored[name], dtype=np.int64) for name in ("orders", "stability"))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"the stored stabilisation chart is damaged ({error!r}); fit again") from error
    if not len(orders) == len(stability) == len(poles) or not np.isfinite(poles).all() or not 0 <= low < high:
        raise FileFormatError("the stored stabilisation chart is damaged: its columns do not agree; fit again")
    return StabilisationChart(
        orders, poles[:, 0] + 1j * poles[:, 1], stability, np.zeros((len(poles), 0), dtype=complex), (low, high)
    )
