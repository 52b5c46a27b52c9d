"""Maxwell's reciprocity of a measured FRF matrix."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from millfrf.core import Band, Complex, DegreeOfFreedom, InputError, Real

from .frf_matrix import Frf


@dataclass(frozen=True)
class SharedPoint:
    """A node and axis at which the structure is both excited and measured."""

    name: str  # node:axis, without a sign
    row: int  # index among the responses
    column: int  # index among the excitations
    response_sign: float  # +1 or -1: direction of the response along the axis
    excitation_sign: float  # +1 or -1: direction of the excitation along the axis


def shared_points(responses: Sequence[str], excitations: Sequence[str]) -> tuple[SharedPoint, ...]:
    """Find the points that are excited and measured, in the order of the responses, each once.

    Opposite directions belong to one axis. Names that are no degree of freedom are left out.

    Examples
    --------
    >>> [point] = shared_points(["TCP:+X", "HOUSING:-Y"], ["HOUSING:+Y", "BASE:+Z"])
    >>> point.name, point.row, point.column, point.response_sign, point.excitation_sign
    ('HOUSING:Y', 1, 0, -1.0, 1.0)
    """
    rows, columns = _first_places(responses), _first_places(excitations)
    return tuple(
        SharedPoint(name, row, columns[name][0], sign, columns[name][1])
        for name, (row, sign) in rows.items()
        if name in columns
    )


def _first_places(labels: Sequence[str]) -> dict[str, tuple[int, float]]:
    """Return the first index and the sign of each ``node:axis`` among labels; leave out labels without a direction."""
    places: dict[str, tuple[int, float]] = {}
    for index, label in enumerate(labels):
        try:
            dof = DegreeOfFreedom.parse(label)
        except InputError:
            continue
        if dof.axis != "S":
            places.setdefault(f"{dof.node}:{dof.axis}", (index, dof.sign))
    return places


@dataclass(frozen=True)
class ReciprocityPair:
    """Comparison of ``H_pq`` and ``H_qp``, both along the positive axes."""

    first: str  # point p, ``node:axis``
    second: str  # point q
    frequencies: Real  # (n_lines,), Hz
    forth: Complex  # (n_lines,); the entry ``H_pq`` (response at p, force at q)
    back: Complex  # (n_lines,); the entry ``H_qp``
    # ``|H_pq - H_qp|`` over the mean of both, root mean square over the lines: 0 where they agree, 2 where they are
    # opposite
    difference: float
    # ``|sum H_pq conj(H_qp)|^2 / (sum |H_pq|^2 sum |H_qp|^2)``, as a coherence over the lines: 1 where they differ by a
    # factor only
    correlation: float
    factor: complex  # factor in ``H_pq = factor H_qp`` by least squares: -1 shows a wrong sign, 1.2 a wrong calibration
    noise: float  # difference that noise alone would give, in the same measure; NaN where the noise is not known
    # size of both relative to their drive points, ``sqrt(|H_pq| |H_qp| / (|H_pp| |H_qq|))`` of root mean squares: where
    # it is small, there is hardly more than crosstalk to compare
    weight: float

    @property
    def difference_over_frequency(self) -> Real:
        """Return ``|H_pq - H_qp|`` over the root mean square of both on the line, (n_lines,); 0 where both are 0."""
        size = np.sqrt((np.abs(self.forth) ** 2 + np.abs(self.back) ** 2) / 2)
        return np.asarray(np.divide(np.abs(self.forth - self.back), size, out=np.zeros_like(size), where=size > 0))


def reciprocity_pairs(frf: Frf, band: Band | None = None) -> tuple[ReciprocityPair, ...]:
    """Compare every two points that are both excited and measured, and sort by difference, largest first.

    A structure at rest is reciprocal; robots in motion need not be. Source: Ewins, *Modal Testing*, 2nd ed.,
    section 2.2; the correlation is the frequency response assurance criterion (Heylen & Lammens 1996) of both FRFs.

    Parameters
    ----------
    frf
        Receptance, mobility or accelerance; a ``transfer`` has no reciprocity and gives no pair.
    band : Hz
        Band that is compared; None: the FRF's own, or all its lines.

    Examples
    --------
    >>> axis, dofs = np.array([1.0, 2.0]), ("A:+X", "A:+Y")
    >>> values = np.array([[[4, 1], [1, 4]], [[4, 2], [-2, 4]]]) + 0j
    >>> [pair] = reciprocity_pairs(Frf(axis, values, dofs, dofs, "receptance", "m/N", axis > 0))
    >>> round(pair.difference, 3), round(pair.correlation, 3), pair.factor
    (1.789, 0.36, (-0.6+0j))
    """
    low, high = band or frf.band or (0.0, np.inf)
    f = frf.frequencies
    inside = frf.valid & (f > 0) & (f >= low) & (f <= high)
    if frf.quantity == "transfer" or not inside.any():
        return ()
    variance = frf.entry_variance()
    lines = (f[inside], frf.values[inside], None if variance is None else variance[inside])
    points = shared_points(frf.responses, frf.excitations)
    known = np.ones(frf.values.shape[1:], dtype=bool) if frf.measured is None else frf.measured
    pairs = [
        _pair(*lines, first, second)
        for first, second in combinations(points, 2)
        if known[first.row, second.column] and known[second.row, first.column]
    ]
    return tuple(sorted(pairs, key=lambda pair: -pair.difference))


def _pair(
    frequencies: Real, values: Complex, variance: Real | None, first: SharedPoint, second: SharedPoint
) -> ReciprocityPair:
    forth = values[:, first.row, second.column] * first.response_sign * second.excitation_sign
    back = values[:, second.row, first.column] * second.response_sign * first.excitation_sign
    power = (float(np.mean(np.abs(forth) ** 2)), float(np.mean(np.abs(back) ** 2)))
    mean = max(sum(power) / 2, 1e-300)
    product = complex(np.mean(forth * back.conj()))
    drive = np.sqrt(
        np.mean(np.abs(values[:, first.row, first.column]) ** 2)
        * np.mean(np.abs(values[:, second.row, second.column]) ** 2)
    )
    noise = float("nan")
    if variance is not None:
        sums = variance[:, first.row, second.column] + variance[:, second.row, first.column]
        known = sums[np.isfinite(sums)]
        noise = float(np.sqrt(np.mean(known) / mean)) if len(known) else noise
    return ReciprocityPair(
        first.name,
        second.name,
        frequencies,
        forth,
        back,
        float(np.sqrt(np.mean(np.abs(forth - back) ** 2) / mean)),
        abs(product) ** 2 / max(power[0] * power[1], 1e-300),
        product / max(power[1], 1e-300),
        noise,
        float(np.sqrt(np.sqrt(power[0] * power[1]) / drive)) if drive > 0 else float("inf"),
    )
