r"""Can a measured structure be passive and causal? A force at a point feeds it, and it answers afterwards.

At a drive point the mobility's Hermitian part is the power that a force of 1 N feeds in; a structure without a motor
gives none back:

.. math:: G(\omega) = (Y + Y^H) / 2 \succeq 0, \qquad Y = i \omega H,

so that :math:`\mathrm{Im}\, H_{pp} \le 0` and :math:`\mathrm{Re}\, Y_{pp} \ge 0` (Ewins, Modal Testing, 2nd ed.,
section 2.7). And the answer comes late: energy-weighted, the phase falls with frequency (Parseval's theorem),

.. math:: -\int |H|^2 \, \mathrm{d}\varphi = 2 \pi \int t\, |h(t)|^2 \mathrm{d}t > 0,

whatever the points are. An FRF for :math:`e^{-i \omega t}` fails both; a wrong sign, or force and response exchanged,
fails the first alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import DegreeOfFreedom

COHERENT = 0.8
"""Multiple coherence of every response from which a line is judged."""

LEAST_LINES = 8
"""Lines without which nothing is judged."""

POWERS = {"receptance": 1, "mobility": 0, "accelerance": -1}
"""Times that each quantity is differentiated to give a mobility."""


@dataclass(frozen=True)
class DrivePoint:
    """An axis of a node that is both excited and measured.

    Parameters
    ----------
    name
        Node and axis, ``node:axis``.
    row, column
        Row of the response and column of the excitation.
    sign
        Product of their directions: -1 where they are opposite, else 1.
    """

    name: str
    row: int
    column: int
    sign: float


def drive_points(responses: Sequence[str], excitations: Sequence[str]) -> dict[str, list[DrivePoint]]:
    """Drive points by node; translations only, each axis once."""
    found: dict[str, dict[str, DrivePoint]] = {}
    for row, response in enumerate(responses):
        for column, excitation in enumerate(excitations):
            if ":" not in response or ":" not in excitation:
                continue
            here, there = DegreeOfFreedom.parse(response), DegreeOfFreedom.parse(excitation)
            if (here.node, here.axis) != (there.node, there.axis) or here.axis not in ("X", "Y", "Z"):
                continue
            point = DrivePoint(f"{here.node}:{here.axis}", row, column, here.sign * there.sign)
            found.setdefault(here.node, {}).setdefault(here.axis, point)
    return {node: list(points.values()) for node, points in found.items()}


def judged_lines(frf: Frf) -> NDArray[np.bool_]:
    """Valid lines above 0 Hz inside the FRF's band, coherent in every response where a coherence is known."""
    f = frf.frequencies
    chosen = frf.valid & (f > 0)
    if frf.band is not None:
        chosen &= (f >= frf.band[0]) & (f <= frf.band[1])
    if frf.multiple_coherence is not None:
        chosen &= frf.multiple_coherence.min(axis=1) >= COHERENT
    return np.asarray(chosen)


def mobility(frf: Frf) -> NDArray[np.complex128]:
    """Velocity over force on every line, (n_frequencies, n_responses, n_excitations)."""
    s = frf.laplace
    power = POWERS[frf.quantity]
    factor = np.power(s, power, out=np.zeros_like(s), where=s != 0)
    return np.asarray(frf.values * factor[:, None, None])


def returned_power(frf: Frf, points: Sequence[DrivePoint]) -> float | None:
    """Share of the power at some axes of one node that comes back out of the structure, 0 (passive) to 1.

    ``sum w max(-g, 0) / sum w |g|`` over the eigenvalues g of the mobility's Hermitian part and over the lines, each
    weighed by the mobility's size w, so that noise between the resonances hardly counts; None: too few lines.
    """
    chosen = judged_lines(frf)
    if chosen.sum() < LEAST_LINES:
        return None
    rows, columns = [point.row for point in points], [point.column for point in points]
    block = mobility(frf)[chosen][:, rows][:, :, columns] * np.array([point.sign for point in points])
    largest = np.abs(block).max()
    if not 0 < largest < np.inf:
        return None
    block = block / largest  # values that are no machine's must not overflow before they are told
    fed = np.linalg.eigvalsh((block + block.conj().transpose(0, 2, 1)) / 2)
    fed = fed * np.sqrt(np.sum(np.abs(block) ** 2, axis=(1, 2)))[:, None]
    total = float(np.abs(fed).sum())
    return float(np.maximum(-fed, 0.0).sum()) / total if total > 0 else None


def rising_phase(frf: Frf) -> float | None:
    """Share of the phase's energy-weighted steps from line to line that rise, 0 (causal) to 1; None: too few lines."""
    chosen = judged_lines(frf)
    pairs = chosen[1:] & chosen[:-1]
    if pairs.sum() < LEAST_LINES:
        return None
    values = mobility(frf) if frf.quantity in POWERS else frf.values
    step = np.imag(values[:-1].conj() * values[1:])[pairs]
    total = float(np.abs(step).sum())
    return float(np.maximum(step, 0.0).sum()) / total if total > 0 else None


def within(frf: Frf, low: float, high: float) -> Frf:
    """The FRF with no line valid outside a band, Hz."""
    inside = (frf.frequencies >= low) & (frf.frequencies <= high)
    return replace(frf, valid=frf.valid & inside)
