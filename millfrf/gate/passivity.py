"""Checks of physical consistency: passivity, magnitude, reciprocity."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, ReciprocityPair, reciprocity_pairs
from millfrf.core import Band, DegreeOfFreedom
from modal_fit import ModalModel, mode_reciprocity

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


SOFTEST = 1e-3
"""m/N: 1 N/mm at the resonance; robots and slender tools reach 1e-4 at most."""

STIFFEST = 1e-11
"""m/N at the resonance: 100 000 N/um, above any machine tool."""


def size_doubts(frf: Frf) -> list[str]:
    """Judge the largest motion of each drive point of a receptance, m/N; other quantities are not judged.

    Returns
    -------
    list of str
        Doubts: a node that is softer or stiffer than machines are, as a wrong unit makes it.
    """
    if frf.quantity != "receptance" or not frf.valid.any():
        return []
    doubts = []
    for node, points in drive_points(frf.responses, frf.excitations).items():
        peak = max(float(np.abs(frf.values[frf.valid, point.row, point.column]).max()) for point in points)
        if peak > SOFTEST:
            doubts.append(
                f"{node} moves {peak:.3g} m/N, more than {SOFTEST:g} m/N: is the FRF in mm/N or um/N, or an "
                "accelerance? Give m/N"
            )
        elif peak < STIFFEST:
            doubts.append(
                f"{node} moves {peak:.3g} m/N at most, less than {STIFFEST:g} m/N: was the force in kN? Give m/N"
            )
    return doubts


PLAIN = 0.3
"""Difference of ``H_pq`` and ``H_qp`` over their drive points' size, root mean square over the lines."""

OPPOSITE = 1.0
"""Difference over their own size that is told whatever their size is, where both are alike but for a factor."""

ALIKE = 0.8
"""Correlation from which two FRFs differ by a factor only; MAC of left and right vectors below which it is told."""

BEYOND_NOISE = 3.0


def check_reciprocity(frf: Frf, name: str = "the FRF", band: Band | None = None) -> list[str]:
    """Doubt an FRF matrix whose ``H_pq`` and ``H_qp`` plainly disagree.

    Parameters
    ----------
    frf
        FRF of receptance, mobility or accelerance.
    name
        Name of its file.
    band : Hz
        Lowest and highest frequency; None: the FRF's own, or all its lines.

    Returns
    -------
    list of str
        One doubt, of the worst pair, or none.
    """
    pairs = reciprocity_pairs(frf, band)
    wrong = [pair for pair in pairs if plainly_different(pair)]
    if not wrong:
        return []
    worst = max(wrong, key=_over_drive_points)
    others = f", and {len(wrong) - 1} more of {len(pairs)} pairs" if len(wrong) > 1 else ""
    return [
        f"{name} is not reciprocal: {worst.first} / {worst.second} and {worst.second} / {worst.first} differ by "
        f"{100 * worst.difference:.0f} % of their size (correlation {worst.correlation:.2f}){others}; {_remedy(worst)}"
    ]


def check_model_reciprocity(model: ModalModel, name: str = "the model") -> list[str]:
    """Doubt a model in which left and right vectors of a mode plainly disagree on the points that they share."""
    found = mode_reciprocity(model)
    if found is None:
        return []
    wrong = np.flatnonzero(found.assurance < ALIKE)
    if not len(wrong):
        return []
    worst = int(found.assurance.argmin())
    others = f", and {len(wrong) - 1} more of {len(model.poles)} modes" if len(wrong) > 1 else ""
    return [
        f"{name}: left and right vectors of mode {worst + 1} at {model.natural_frequencies[worst]:.4g} Hz disagree on "
        f"the {len(found.points)} points that they share (MAC {found.assurance[worst]:.2f}){others}; a structure at "
        "rest is reciprocal: check names and signs of the channels, and whether a weak mode is fitted from noise"
    ]


def plainly_different(pair: ReciprocityPair) -> bool:
    """Say whether a pair differs by more than robots do, and by more than its noise."""
    beyond = not pair.difference < BEYOND_NOISE * pair.noise
    opposite = pair.difference > OPPOSITE and pair.correlation > ALIKE
    return beyond and (_over_drive_points(pair) > PLAIN or opposite)


def _over_drive_points(pair: ReciprocityPair) -> float:
    return pair.difference * min(pair.weight, 1.0)


def _remedy(pair: ReciprocityPair) -> str:
    size, angle = abs(pair.factor), np.degrees(np.angle(pair.factor))
    if pair.correlation < ALIKE:
        return "check that forces and sensors stood where their names say, and that nothing moved between the tests"
    if abs(angle) > 150:
        return "one of the two has the wrong sign: turn the direction of its channel"
    return f"their ratio is {size:.2f} at {angle:.0f}°: check calibration and filters of the channels"


def shown_pairs(pairs: Sequence[ReciprocityPair], most: int) -> tuple[ReciprocityPair, ...]:
    """The pairs to show where there are many: those that matter most first."""
    return tuple(sorted(pairs, key=_over_drive_points, reverse=True)[:most])
