"""Stability limits of a modal model with coefficients as they vary, by spectral collocation."""

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel

from .crossings import Crossings, find_crossings
from .delay_system import DelaySystem, delay_system
from .loop_gain import LoopGain, loop_gain
from .period_operator import PeriodOperator, period_operator
from .stability_limits import StabilityLimits
from .stability_lobes import StabilityLobes
from .zero_order import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]


def collocation(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Lowest unstable depth at each speed; Hopf and period doubling.

    Parameters
    ----------
    structure
        Modal model at the tool tip.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        Depths above it are not looked for, m.

    Raises
    ------
    InputError
        As :func:`collocation_limits`.
    """
    return collocation_limits(structure, process, spindle_speeds, max_depth).lowest()


def collocation_limits(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLimits:
    """All depths at which a Floquet multiplier crosses the unit circle, with frequency, kind and error.

    Each tooth period is collocated on pieces between entries and exits (Butcher et al. 2009; Insperger & Stepan 2011),
    and 1 / depth is found as an eigenvalue of the loop gain on the unit circle, so no grid of depths is needed. With a
    purely regenerative force there is no fold: at a multiplier of 1 the chip would be ``y - y_tau = 0``.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        As :func:`collocation`.

    Raises
    ------
    InputError
        Speeds or depth not positive, an FRF (fit it, or take ``multi_frequency``), or a structure that cannot be used.
    """
    if isinstance(structure, Frf):
        raise InputError("collocation needs a modal model, this is an FRF; fit it first, or use multi-frequency")
    speeds = checked_speeds(spindle_speeds, max_depth)
    system = delay_system(structure, process)
    parts = [_limits_of(system, speeds, chunk, max_depth) for chunk in _chunks(speeds)]
    speed, depth, frequency, at_pi, change, error = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort([depth, speed])
    kinds = tuple("period-doubling" if doubling else "hopf" for doubling in at_pi[order])
    return StabilityLimits(
        speeds,
        float(max_depth),
        speed[order],
        depth[order],
        frequency[order],
        kinds,
        change[order],
        error[order],
        "collocation",
        system.warnings,
    )


def _chunks(speeds: Real) -> list[Index]:
    """Indices of speeds whose tooth periods differ by less than a fifth: they share their nodes."""
    order = np.argsort(speeds)
    octave = np.floor(np.log(speeds[order] / speeds[order][0]) / np.log(1.2)).astype(int)
    groups = np.split(order, np.flatnonzero(np.diff(octave)) + 1)
    return [part for group in groups for part in np.array_split(group, max(1, len(group) // 16))]


def _limits_of(
    system: DelaySystem, speeds: Real, chunk: Index, max_depth: float
) -> tuple[Index, Real, Real, NDArray[np.bool_], Index, Real]:
    periods = 2 * np.pi / (system.process.teeth * speeds[chunk])
    operator = period_operator(system, periods)
    gain = loop_gain(operator, max_depth)
    found = find_crossings(gain.eigenvalues, first_angles(system.poles, periods), max_depth)
    at_pi = found.theta == np.pi
    change = np.where(found.outward, 1, -1) * np.where(at_pi, 1, 2)
    error = _depth_errors(system, periods, found, max_depth)
    frequency = _strongest_lines(system, operator, gain, found)
    return chunk[found.speed], found.depth, frequency, at_pi, change, error


def first_angles(poles: Complex, periods: Real, *, count: int = 24) -> Real:
    """Angles in (0, pi] to begin with at each period: clustered at both ends and about every resonance.

    Returns
    -------
    (n_periods, n_angles), increasing, the last pi
    """
    even = (1 - np.cos(np.linspace(0, np.pi, count + 1)[1:])) * np.pi / 2
    turn = np.outer(periods, poles.imag)[:, :, None]
    width = np.minimum(-np.outer(periods, poles.real), 1.0)[:, :, None]
    near = turn + width * np.array([-6.0, -2.5, -0.9, 0.05, 0.9, 2.5, 6.0])
    folded = np.abs(np.mod(near + np.pi, 2 * np.pi) - np.pi).reshape(len(periods), -1)
    together = [np.broadcast_to(even, (len(periods), count)), np.clip(folded, 1e-3, np.pi - 1e-3)]
    return np.asarray(np.sort(np.concatenate(together, axis=1), axis=1))


def _depth_errors(system: DelaySystem, periods: Real, found: Crossings, max_depth: float) -> Real:
    """How far more nodes would move each depth, and the root's own tolerance."""
    if not len(found.depth):
        return np.zeros(0)
    finer = loop_gain(period_operator(system, periods, extra=4), max_depth)
    values = finer.eigenvalues(found.speed, found.theta)
    nearest = np.argmin(np.abs(values - found.eigenvalue[:, None]), axis=1)
    moved = values[np.arange(len(values)), nearest] - found.eigenvalue
    # the root moves along the circle until the imaginary part vanishes again; at pi it stays where it is
    steep = np.where(found.theta == np.pi, 0.0, found.slope.real / found.slope.imag)
    gain_error = np.abs(moved.real) + np.abs(moved.imag * steep)
    return np.asarray(found.depth**2 * gain_error + 1e-9 * found.depth)


def _strongest_lines(system: DelaySystem, operator: PeriodOperator, gain: LoopGain, found: Crossings) -> Real:
    """Frequency (Hz) of the strongest harmonic of the tool's motion at each crossing."""
    if not len(found.depth):
        return np.zeros(0)
    matrices = gain.matrices(found.speed, found.theta)
    n = matrices.shape[1]
    shifted = matrices - (found.eigenvalue * (1 + 1e-9))[:, None, None] * np.eye(n)
    chip = np.ones((len(matrices), n, 1), dtype=complex)
    for _ in range(3):  # inverse iteration: the eigenvalue is known
        chip = np.linalg.solve(shifted, chip)
        chip /= np.linalg.norm(chip, axis=1, keepdims=True)
    nodes = chip[:, :, 0] if gain.basis is None else (gain.basis[found.speed] @ chip)[:, :, 0]
    periods = operator.periods[found.speed]
    top = int(np.ceil(1.5 * np.abs(system.poles).max() * periods.max() / (2 * np.pi))) + 1
    turns = found.theta[:, None] + 2 * np.pi * np.arange(-top, top + 1)
    wave = np.exp(-1j * turns[:, :, None] * operator.times)
    force = np.einsum("ckn,cn,nd->ckd", wave, nodes * operator.weights, operator.forces, optimize=True)
    line = turns / periods[:, None]
    motion = np.zeros_like(force)
    for pole, right, left in zip(system.poles, system.right, system.left, strict=True):
        motion += (force @ left / (1j * line - pole))[:, :, None] * right
        motion += (force @ left.conj() / (1j * line - pole.conj()))[:, :, None] * right.conj()
    strongest = np.argmax(np.linalg.norm(motion, axis=2), axis=1)
    return np.asarray(np.abs(line[np.arange(len(line)), strongest]) / (2 * np.pi))
