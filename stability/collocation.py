"""Depth limits by spectral collocation split at tooth entry and exit: Hopf and period doubling, to any accuracy."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from foundation import MillfrfError
from modal_fit import ModalModel

from .boundary_search import lowest_crossing
from .chip_kernel import ChipKernel, chip_kernel
from .stability_lobes import StabilityLobes
from .structure_states import StructureStates, structure_states
from .zero_order import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
_FEWEST_NODES = 10
_NODES_A_WAVE = 7.0  # Chebyshev intervals for one oscillation of the fastest mode within the cut
_STEADY = 40  # phases spread evenly
_AROUND = 33  # phases around each resonance
_ROUNDS = 3


def collocation(
    structure: ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    nodes_per_segment: int | None = None,
) -> StabilityLobes:
    """Lowest unstable depth at each speed, with chatter frequency and type.

    On the boundary a multiplier ``mu = exp(i theta)`` lies on the unit circle and
    ``(1 - 1/mu) M(mu) u = u / (a K_tc)``: for each phase theta the possible depths are the reciprocal eigenvalues of
    one small matrix, and the boundary is where one of them is real and positive. theta = pi is period doubling;
    anything between 0 and pi is a Hopf (Neimark-Sacker) bifurcation; theta = 0 cannot occur, because a motion that
    repeats with the tooth does not modulate the chip.

    Parameters
    ----------
    structure
        Modal model at the tool tip, non-symmetric or not.
    process
        Cutter with teeth of equal pitch and its engagement.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        Depths above it are not looked for, m.
    nodes_per_segment
        Chebyshev intervals between two events of a tooth; None: by the fastest mode's oscillations, which gives at
        least six digits.

    Raises
    ------
    InputError
        Speeds or depth that are not positive, or a structure that cannot be used.
    MillfrfError
        The boundary of a speed could not be confirmed.
    """
    speeds = checked_speeds(spindle_speeds, max_depth)
    states = structure_states(structure)
    limits, chatter, kinds = np.full(len(speeds), np.inf), np.full(len(speeds), np.nan), ["none"] * len(speeds)
    for k, speed in enumerate(speeds):
        nodes = nodes_per_segment or enough_nodes(states, process, float(speed))
        kernel = chip_kernel(states, process, float(speed), nodes)
        found = lowest_depth(kernel, process.ktc, max_depth)
        if found is not None:
            limits[k], phase, kinds[k] = found[0], found[1], found[2]
            chatter[k] = chatter_frequency(kernel, states, process.ktc, limits[k], phase)
    return StabilityLobes(speeds, limits, chatter, tuple(kinds), "collocation", states.warnings)


def enough_nodes(states: StructureStates, process: MillingProcess, spindle_speed: float) -> int:
    """Chebyshev intervals a segment, by the oscillations of the fastest mode in the longest stretch of cut."""
    longest = min(process.exit_angle - process.start_angle, 2 * math.pi / process.teeth) / spindle_speed
    waves = np.abs(states.poles).max() * longest / (2 * math.pi)
    return int(_FEWEST_NODES + math.ceil(_NODES_A_WAVE * waves))


def lowest_depth(kernel: ChipKernel, ktc: float, max_depth: float) -> tuple[float, float, str] | None:
    """Lowest depth with a multiplier on the unit circle: depth (m), phase theta (rad), type; None below ``max_depth``.

    Raises
    ------
    MillfrfError
        A lower crossing stays hidden between the phases looked at.
    """
    density = 1
    for _ in range(_ROUNDS):
        phases = _phases(kernel, density)
        best = lowest_crossing(kernel.matrices, phases, ktc * max_depth)
        below = 0.995 * (best[0] if best else ktc * max_depth)
        if np.abs(floquet_multipliers(kernel, below)).max() < 1.0 + 1e-9:
            return None if best is None else (best[0] / ktc, best[1], best[2])
        density *= 4
    raise MillfrfError(f"the boundary for a tooth period of {1e3 * kernel.period:.4g} ms could not be confirmed")


def floquet_multipliers(kernel: ChipKernel, stiffness: float) -> Complex:
    """All multipliers over one tooth period at a cutting stiffness ``a K_tc`` (N/m).

    Chip modulation's samples and states map on those of the next period; the cut is stable when all multipliers lie
    inside the unit circle.
    """
    n, n_states = kernel.entering.shape
    system = np.eye(n) - stiffness * kernel.direct
    right = np.concatenate([-stiffness * kernel.direct, kernel.entering], axis=1)
    chip = np.linalg.solve(system, right)
    identity = np.concatenate([np.eye(n), np.zeros((n, n_states))], axis=1)
    state = stiffness * kernel.leaving @ (chip - identity)
    state[:, n:] += np.diag(kernel.decay)
    return np.asarray(np.linalg.eigvals(np.concatenate([chip, state])), dtype=np.complex128)


def _phases(kernel: ChipKernel, density: int) -> Real:
    """Phases in 0 ... pi: even ones, and dense ones around each mode's own phase."""
    angles = np.abs(np.angle(kernel.decay))
    widths = -np.log(np.maximum(np.abs(kernel.decay), 1e-300))
    spread = np.sinh(np.linspace(-4, 4, _AROUND * density)) / np.sinh(4)
    around = [angle + width * 25 * spread for angle, width in zip(angles, widths, strict=True) if width < 2]
    everywhere = np.linspace(0, math.pi, _STEADY * density + 1)
    phases = np.unique(np.concatenate([everywhere, *around]))
    return np.asarray(phases[(phases > 1e-6) & (phases < math.pi)])


def chatter_frequency(kernel: ChipKernel, states: StructureStates, ktc: float, depth: float, phase: float) -> float:
    """Strongest line of the tool's motion at the boundary, Hz: one of ``(theta + 2 pi k) / (2 pi T)``.

    The states' motion is that of free decays driven by the chip; among the lines, the one with the largest product of
    receptance and force is taken.
    """
    matrix = kernel.matrices(np.array([np.exp(1j * phase)]))[0]
    values, vectors = np.linalg.eig(matrix)
    chip = vectors[:, np.argmin(np.abs(values - 1 / (ktc * depth)))]
    residual = kernel.leaving @ chip / (np.exp(1j * phase) - kernel.decay)  # states at the period's start
    highest = 1.5 * np.abs(states.poles).max() * kernel.period / (2 * math.pi)
    orders = np.arange(-int(highest) - 2, int(highest) + 3)
    lines = (phase + 2 * math.pi * orders) / kernel.period
    # a decaying state with quasi-period T has these Fourier coefficients
    rows = residual * (np.exp(1j * phase) - kernel.decay)
    coefficients = rows / (1j * lines[:, None] - states.poles)
    strength = np.linalg.norm(coefficients @ states.outputs.T, axis=1)
    return float(np.abs(lines[np.argmax(strength)]) / (2 * math.pi))
