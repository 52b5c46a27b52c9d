"""Checks of physical consistency: passivity, magnitude, reciprocity."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf, ReciprocityPair, reciprocity_pairs, to_receptance
from millfrf.core import Band, Complex, DegreeOfFreedom, Real
from millfrf.stability import known_lines
from modal_fit import ModalModel, mode_reciprocity

from .settings import GATE

POWERS = {"receptance": 1, "mobility": 0, "accelerance": -1}  # derivatives with respect to time that give a mobility


@dataclass(frozen=True)
class DrivePoint:
    """An axis of a node that is both excited and measured."""

    name: str  # node:axis
    row: int  # of the response
    column: int  # of the excitation
    sign: float  # -1 where response and excitation have opposite directions, else 1


def drive_points(responses: Sequence[str], excitations: Sequence[str]) -> dict[str, list[DrivePoint]]:
    """Return the drive points of each node: every axis of translation that is excited and measured, without repeats."""
    nodes: dict[str, dict[str, DrivePoint]] = {}
    for row, response in enumerate(responses):
        for column, excitation in enumerate(excitations):
            if ":" not in response or ":" not in excitation:
                continue
            motion, force = DegreeOfFreedom.parse(response), DegreeOfFreedom.parse(excitation)
            if (motion.node, motion.axis) != (force.node, force.axis) or motion.axis not in ("X", "Y", "Z"):
                continue
            point = DrivePoint(f"{motion.node}:{motion.axis}", row, column, motion.sign * force.sign)
            nodes.setdefault(motion.node, {}).setdefault(motion.axis, point)
    return {node: list(points.values()) for node, points in nodes.items()}


def checked_lines(frf: Frf) -> NDArray[np.bool_]:
    """Return the valid lines above 0 Hz in the FRF's band; leave out noise and lines with a low coherence.

    The mobility of an acceleration's noise grows towards 0 Hz, and would outweigh the resonances.
    """
    f = frf.frequencies
    chosen = frf.valid & (f > 0)
    if frf.band is not None:
        chosen &= (f >= frf.band[0]) & (f <= frf.band[1])
    if frf.quantity in POWERS:
        chosen &= known_lines(to_receptance(frf))[0].valid
    if frf.multiple_coherence is not None:
        chosen &= frf.multiple_coherence.min(axis=1) >= GATE.passivity_coherent
    return np.asarray(chosen)


def mobility(frf: Frf) -> NDArray[np.complex128]:
    """Compute velocity over force on every line for each response and excitation."""
    s = frf.laplace
    power = POWERS[frf.quantity]
    factor = np.power(s, power, out=np.zeros_like(s), where=s != 0)
    return np.asarray(frf.values * factor[:, None, None])


def returned_power(frf: Frf, points: Sequence[DrivePoint]) -> float | None:
    """Compute the share of the power at one node that the structure returns, from 0 (passive structure) to 1.

    The share is ``sum w max(-g, 0) / sum w |g|`` over all lines and over the eigenvalues g of the Hermitian part of the
    mobility. Each line is weighted by the size w of the mobility, so that noise between the resonances hardly counts.
    With too few lines, return None.
    """
    chosen = checked_lines(frf)
    if chosen.sum() < GATE.passivity_lines_min:
        return None
    rows, columns = [point.row for point in points], [point.column for point in points]
    block = mobility(frf)[chosen][:, rows][:, :, columns] * np.array([point.sign for point in points])
    largest = np.abs(block).max()
    if not 0 < largest < np.inf:
        return None
    block = block / largest  # absurd values must not overflow: magnitude_warnings reports them
    power = np.linalg.eigvalsh((block + block.conj().transpose(0, 2, 1)) / 2)
    power = power * np.sqrt(np.sum(np.abs(block) ** 2, axis=(1, 2)))[:, None]
    total = float(np.abs(power).sum())
    return float(np.maximum(-power, 0.0).sum()) / total if total > 0 else None


def drive_point_delay(frf: Frf, point: DrivePoint) -> float | None:
    """Return the smallest delay (s) of the response that explains why a drive point returns power; None without one.

    A delay tau turns the mobility to ``Y exp(-i w tau)``, and a passive structure has ``Re Y >= 0``. The misfit is
    ``Q(tau) = sum max(0, -Re(Y exp(i w tau)))^2 / |Y|^2`` over the lines. An F-test compares it without delay
    and with the best delay, or with the known noise of the lines where that is larger; as neighbouring lines are alike,
    its freedom is the number of independent lines. The delay is the one next to zero whose misfit is as small within
    this noise.
    """
    variance = frf.entry_variance()
    if variance is None:  # noise alone returns power between the resonances
        return None
    chosen = checked_lines(frf)
    values = mobility(frf)[:, point.row, point.column] * point.sign
    if frf.coherence is not None:
        chosen &= np.nan_to_num(frf.coherence[:, point.row, point.column], nan=1.0) >= GATE.passivity_coherent
    chosen &= np.abs(values) > 0
    lines = np.flatnonzero(chosen)
    lines = lines[:: 1 + len(lines) // GATE.model_lines]
    count = len(lines)
    if count < GATE.passivity_lines_min:
        return None
    unit, w = values[lines] / np.abs(values[lines]), 2 * np.pi * frf.frequencies[lines]
    # in a narrow band, delays a period apart look alike: half a period to either side is searched
    reach = 4 * np.pi if w[-1] > 4 * w[0] else np.pi
    delays = np.linspace(-reach, reach, 1441) / w[-1]
    misfit = np.sum(np.maximum(0.0, -np.real(unit * np.exp(1j * np.outer(delays, w)))) ** 2, axis=1)
    size = np.abs(frf.values[lines, point.row, point.column]) ** 2
    noise = float(np.nansum(variance[lines, point.row, point.column] / size))
    floor = max(float(misfit.min()), noise, 1e-12)
    ratio, freedom = float(misfit[len(delays) // 2]) / floor, _independent_lines(unit)
    if not scipy.stats.f.sf(ratio, freedom, freedom) < GATE.p_value:
        return None
    enough = delays[misfit <= misfit.min() + floor]
    return float(enough[np.argmin(np.abs(enough))])


def _independent_lines(phases: Complex) -> float:
    """Return the number of independent values that vary as much as a sequence of phase factors (Bartlett 1935)."""
    n = len(phases)
    correlation = np.fft.ifft(np.abs(np.fft.fft(phases, 2 * n)) ** 2)[:n] / n
    return float(n / (1 + 2 * np.sum(np.abs(correlation[1:]) ** 2)))


def rising_phase(frf: Frf) -> float | None:
    """Compute the energy-weighted share of rising phase steps, 0 (causal) to 1; None with too few lines."""
    steps = _phase_steps(frf)
    total = float(np.abs(steps).sum())
    return float(np.maximum(steps, 0.0).sum()) / total if total > 0 else None


def entries_with_rising_phase(frf: Frf) -> list[str]:
    """Name the entries whose phase rises, if that of most others falls; empty if most of them rise, or none."""
    steps = _phase_steps(frf)
    total = np.abs(steps).sum(axis=0)
    rising = np.maximum(steps, 0.0).sum(axis=0) > GATE.rising_phase_max * total
    if 2 * np.count_nonzero(rising) >= np.count_nonzero(total):
        return []
    return [f"{frf.responses[p]} / {frf.excitations[q]}" for p, q in np.argwhere(rising)]


def _phase_steps(frf: Frf) -> Real:
    """Return the energy-weighted phase steps of each entry between checked lines; none if these are too few."""
    chosen = checked_lines(frf)
    pairs = chosen[1:] & chosen[:-1]
    if pairs.sum() < GATE.passivity_lines_min:
        return np.zeros((0, *frf.values.shape[1:]))
    values = mobility(frf) if frf.quantity in POWERS else frf.values
    return np.asarray(np.imag(values[:-1].conj() * values[1:])[pairs])


def magnitude_warnings(frf: Frf, band: Band | None = None) -> list[str]:
    """Return warnings about drive points of a receptance (m/N) whose motion is implausible, as from a wrong unit.

    Other quantities are not checked, nor lines outside ``band`` (Hz; None: the FRF's own, or all its lines).
    """
    if frf.quantity != "receptance" or not frf.valid.any():
        return []
    # lines that are noise or the error of an integration, such as that at 0 Hz, say nothing about the unit
    f = frf.frequencies
    known = known_lines(frf)[0].valid & (f > 0)
    if band is not None:
        known &= (f >= band[0]) & (f <= band[1])
    if not known.any():
        return []
    warnings = []
    for node, points in drive_points(frf.responses, frf.excitations).items():
        sizes = np.max([np.abs(frf.values[:, point.row, point.column]) for point in points], axis=0) * known
        line = int(np.argmax(sizes))
        peak = float(sizes[line])
        if peak > GATE.flexibility_max:
            warnings.append(
                f"{node} moves {peak:.3g} m/N at {f[line]:.4g} Hz, more than {GATE.flexibility_max:g} m/N: is the FRF "
                "in mm/N or um/N, or an accelerance? Give m/N; if the lowest lines are noise, begin --band above them"
            )
        elif peak < GATE.flexibility_min:
            warnings.append(
                f"{node} moves {peak:.3g} m/N at most, less than {GATE.flexibility_min:g} m/N: was the force in kN? "
                "Give m/N"
            )
    return warnings


def check_reciprocity(frf: Frf, name: str = "the FRF", band: Band | None = None) -> list[str]:
    """Return a warning if ``H_pq`` and ``H_qp`` of an FRF matrix disagree.

    Parameters
    ----------
    frf
        FRF of receptance, mobility or accelerance.
    name
        Name of its file.
    band : Hz
        Lowest and highest frequency; None: the FRF's own, or all its lines.
    """
    pairs = reciprocity_pairs(frf, band)
    wrong = [pair for pair in pairs if clearly_different(pair)]
    if not wrong:
        return []
    worst = max(wrong, key=_over_drive_points)
    others = f", and {len(wrong) - 1} more of {len(pairs)} pairs" if len(wrong) > 1 else ""
    return [
        f"{name} is not reciprocal: {worst.first} / {worst.second} and {worst.second} / {worst.first} differ by "
        f"{100 * worst.difference:.0f} % of their size (correlation {worst.correlation:.2f}){others}; {_remedy(worst)}"
    ]


def check_model_reciprocity(model: ModalModel, name: str = "the model") -> list[str]:
    """Return a warning if the left and right vectors of a mode disagree at their common points."""
    modes = mode_reciprocity(model)
    if modes is None:
        return []
    wrong = np.flatnonzero(modes.assurance < GATE.reciprocity_correlation)
    if not len(wrong):
        return []
    worst = int(modes.assurance.argmin())
    others = f", and {len(wrong) - 1} more of {len(model.poles)} modes" if len(wrong) > 1 else ""
    return [
        f"{name}: left and right vectors of mode {worst + 1} at {model.natural_frequencies[worst]:.4g} Hz disagree on "
        f"the {len(modes.points)} points that they share (MAC {modes.assurance[worst]:.2f}){others}; a structure at "
        "rest is reciprocal: check names and signs of the channels, and whether a weak mode is fitted from noise"
    ]


def clearly_different(pair: ReciprocityPair) -> bool:
    """Return whether the difference of a pair exceeds both the usual difference of robots and the noise."""
    beyond_noise = not pair.difference < GATE.reciprocity_noise * pair.noise  # also where the noise is NaN: not known
    # a wrong sign or factor is an error of the channels, however small both entries are
    wrong_factor = pair.difference > GATE.reciprocity_factor and pair.correlation > GATE.reciprocity_correlation
    return beyond_noise and (_over_drive_points(pair) > GATE.reciprocity_difference or wrong_factor)


def _over_drive_points(pair: ReciprocityPair) -> float:
    return pair.difference * min(pair.weight, 1.0)


def _remedy(pair: ReciprocityPair) -> str:
    size, angle = abs(pair.factor), np.degrees(np.angle(pair.factor))
    if pair.correlation < GATE.reciprocity_correlation:
        return "check that forces and sensors stood where their names say, and that nothing moved between the tests"
    if abs(angle) > 150:
        return "one of the two has the wrong sign: turn the direction of its channel"
    return f"their ratio is {size:.2f} at {angle:.0f}°: check calibration and filters of the channels"


def shown_pairs(pairs: Sequence[ReciprocityPair], most: int) -> tuple[ReciprocityPair, ...]:
    """Return up to ``most`` pairs, sorted by falling difference relative to the size of their drive points."""
    return tuple(sorted(pairs, key=_over_drive_points, reverse=True)[:most])
