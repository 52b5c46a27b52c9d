"""Maxwell's reciprocity of a measured FRF matrix."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Band, Complex, DegreeOfFreedom, InputError, Real

from .frf_matrix import Frf


@dataclass(frozen=True)
class SharedPoint:
    """A node and axis that stand among responses and excitations.

    Parameters
    ----------
    name
        Node and axis, ``node:axis``, without a sign.
    row, column
        Row of the response and column of the excitation.
    response_sign, excitation_sign
        Direction of either along the axis, +1 or -1.
    """

    name: str
    row: int
    column: int
    response_sign: float
    excitation_sign: float


def shared_points(responses: Sequence[str], excitations: Sequence[str]) -> tuple[SharedPoint, ...]:
    """Points in the order of the responses, each once; opposite directions are one axis, other names are left out.

    Examples
    --------
    >>> [point] = shared_points(["TCP:+X", "HOUSING:-Y"], ["HOUSING:+Y", "BASE:+Z"])
    >>> point.name, point.row, point.column, point.response_sign, point.excitation_sign
    ('HOUSING:Y', 1, 0, -1.0, 1.0)
    """
    columns: dict[str, tuple[int, float]] = {}
    for column, label in enumerate(excitations):
        axis = _axis(label)
        if axis is not None:
            columns.setdefault(axis[0], (column, axis[1]))
    found: dict[str, SharedPoint] = {}
    for row, label in enumerate(responses):
        axis = _axis(label)
        if axis is not None and axis[0] in columns:
            column, sign = columns[axis[0]]
            found.setdefault(axis[0], SharedPoint(axis[0], row, column, axis[1], sign))
    return tuple(found.values())


def _axis(label: str) -> tuple[str, float] | None:
    """``node:axis`` and sign; None for a label that is no direction."""
    try:
        dof = DegreeOfFreedom.parse(label)
    except InputError:
        return None
    return None if dof.axis == "S" else (f"{dof.node}:{dof.axis}", dof.sign)


@dataclass(frozen=True)
class ReciprocityPair:
    """``H_pq`` beside ``H_qp``, both along the positive axes.

    Parameters
    ----------
    first, second
        The points p and q, ``node:axis``.
    frequencies : (n_lines,), Hz
        Frequencies of the lines that are compared.
    forth, back : (n_lines,), complex
        The entries ``H_pq`` (response at p, force at q) and ``H_qp``.
    difference
        ``|H_pq - H_qp|`` over the mean of both, root mean square over the lines: 0 where they agree, 2 where they are
        opposite.
    correlation
        ``|sum H_pq conj(H_qp)|^2 / (sum |H_pq|^2 sum |H_qp|^2)``, as a coherence over the lines: 1 where they differ by
        a factor only.
    factor
        Factor in ``H_pq = factor H_qp`` by least squares: -1 tells a wrong sign, 1.2 a wrong calibration.
    noise
        The difference that noise alone gives, root mean square as above; NaN where the noise is not known.
    weight
        Size of both against their drive points, ``sqrt(|H_pq| |H_qp| / (|H_pp| |H_qq|))`` of root mean squares: where
        it is small, there is hardly more than crosstalk to compare.
    """

    first: str
    second: str
    frequencies: Real
    forth: Complex
    back: Complex
    difference: float
    correlation: float
    factor: complex
    noise: float
    weight: float

    @property
    def difference_over_frequency(self) -> Real:
        """``|H_pq - H_qp|`` over the root mean square of both on the same line, (n_lines,); 0 where both are 0."""
        size = np.sqrt((np.abs(self.forth) ** 2 + np.abs(self.back) ** 2) / 2)
        return np.asarray(np.divide(np.abs(self.forth - self.back), size, out=np.zeros_like(size), where=size > 0))


def reciprocity_pairs(frf: Frf, band: Band | None = None) -> tuple[ReciprocityPair, ...]:
    """Every two points that are both excited and measured, the most different first.

    Source: Ewins, *Modal Testing*, 2nd ed., section 2.2; the correlation is the frequency response assurance criterion
    (Heylen & Lammens 1996) of both FRFs. Robots in motion need not be reciprocal; a structure at rest is.

    Parameters
    ----------
    frf
        Receptance, mobility or accelerance; a ``transfer`` has no reciprocity and gives none.
    band
        Hz; None: the FRF's own, or all its lines.

    Examples
    --------
    >>> axis, dofs = np.array([1.0, 2.0]), ("A:+X", "A:+Y")
    >>> values = np.array([[[4, 1], [1, 4]], [[4, 2], [-2, 4]]]) + 0j
    >>> [pair] = reciprocity_pairs(Frf(axis, values, dofs, dofs, "receptance", "m/N", axis > 0))
    >>> round(pair.difference, 3), round(pair.correlation, 3), pair.factor
    (1.789, 0.36, (-0.6+0j))
    """
    if frf.quantity == "transfer":
        return ()
    points = shared_points(frf.responses, frf.excitations)
    low, high = band or frf.band or (0.0, np.inf)
    f = frf.frequencies
    inside = frf.valid & (f > 0) & (f >= low) & (f <= high)
    if not inside.any():
        return ()
    variance = frf.entry_variance()
    pairs = [
        _pair(frf, inside, variance, one, other) for number, one in enumerate(points) for other in points[number + 1 :]
    ]
    return tuple(sorted(pairs, key=_minus_difference))


def _pair(
    frf: Frf, inside: NDArray[np.bool_], variance: Real | None, first: SharedPoint, second: SharedPoint
) -> ReciprocityPair:
    values = frf.values[inside]
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
        both = variance[inside][:, first.row, second.column] + variance[inside][:, second.row, first.column]
        known = both[np.isfinite(both)]
        noise = float(np.sqrt(np.mean(known) / mean)) if len(known) else noise
    return ReciprocityPair(
        first.name,
        second.name,
        frf.frequencies[inside],
        forth,
        back,
        float(np.sqrt(np.mean(np.abs(forth - back) ** 2) / mean)),
        abs(product) ** 2 / max(power[0] * power[1], 1e-300),
        product / max(power[1], 1e-300),
        noise,
        float(np.sqrt(np.sqrt(power[0] * power[1]) / drive)) if drive > 0 else float("inf"),
    )


def _minus_difference(pair: ReciprocityPair) -> float:
    return -pair.difference
