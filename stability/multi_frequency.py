"""Multi-frequency solution: period doubling and Hopf limits from the FRF alone, without a modal fit."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, chip_direction, force_direction
from estimation import Frf
from modal_fit import ModalModel

from .boundary_search import Matrices, lowest_crossing
from .stability_lobes import StabilityLobes
from .tool_receptance import ToolReceptance, tool_receptance
from .zero_order import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
_QUADRATURE = 60
_FEWEST_HARMONICS, _MOST_HARMONICS = 6, 60
_PHASES = 160


def multi_frequency(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    harmonics: int | None = None,
) -> StabilityLobes:
    """Depth limit at each speed from the truncated infinite determinant of the periodic loop.

    Motion at a chatter frequency w comes with lines at ``w + k W`` (W the tooth passing): with Fourier coefficients
    alpha_k of the directional matrix, ``F_h = a K_tc (1 - exp(-i w T)) sum_k alpha_(h-k) H(w + k W) F_k`` (Budak &
    Altintas 1998; Merdol & Altintas, J. Manuf. Sci. Eng. 126, 2004). For each phase ``w T`` the possible depths are
    reciprocal eigenvalues; the boundary is where one is real and positive. w T = pi is period doubling.

    Parameters
    ----------
    structure
        Tip receptance, measured or modal. Outside a measured FRF's span it counts as rigid.
    process
        Cutter with teeth of equal pitch.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        Depths above it are not looked for, m.
    harmonics
        Lines kept on either side of the chatter frequency; None: all within the FRF's span, at least six.

    Raises
    ------
    InputError
        Speeds or depth that are not positive, or a structure that cannot be used.
    """
    speeds = checked_speeds(spindle_speeds, max_depth)
    source = tool_receptance(structure)
    highest = source.span[1]
    if isinstance(structure, ModalModel):  # known at every frequency, but for a residual that is infinite at 0
        source = replace(source, span=(source.span[0] if structure.residuals else 0.0, math.inf))
    limits, chatter, kinds = np.full(len(speeds), np.inf), np.full(len(speeds), np.nan), ["none"] * len(speeds)
    for k, speed in enumerate(speeds):
        period = 2 * math.pi / (process.teeth * float(speed))
        kept = harmonics or int(np.clip(math.ceil(highest * period) + 2, _FEWEST_HARMONICS, _MOST_HARMONICS))
        coefficients = directional_harmonics(process, 2 * kept + 1)

        matrices = partial(_determinant_blocks, source, coefficients, period, kept)
        phases = _phases(source, period)
        found = lowest_crossing(matrices, phases, process.ktc * max_depth)
        if found is not None:
            limits[k], kinds[k] = found[0] / process.ktc, found[2]
            chatter[k] = _chatter(source, matrices, found, period, kept)
    return StabilityLobes(speeds, limits, chatter, tuple(kinds), "multi-frequency", source.warnings)


def directional_harmonics(process: MillingProcess, n_harmonics: int) -> Complex:
    """Fourier coefficients of alpha over a tooth period, ``alpha(phi) = sum_k alpha_k exp(i k N phi)``.

    Returns
    -------
    (2 n_harmonics + 1, 3, 3), k from -n to n
    """
    half = 0.5 * (process.exit_angle - process.start_angle)
    waves_in_cut = process.teeth * n_harmonics * half / math.pi
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE + math.ceil(4 * waves_in_cut))
    angles = process.start_angle + half * (nodes + 1)
    product = force_direction(process, angles)[:, :, None] * chip_direction(process, angles)[:, None, :]
    orders = np.arange(-n_harmonics, n_harmonics + 1)
    waves = np.exp(-1j * process.teeth * np.outer(orders, angles)) * (weights * half)
    return np.asarray(process.teeth / (2 * math.pi) * np.einsum("ka,apq->kpq", waves, product))


def _determinant_blocks(
    source: ToolReceptance, coefficients: Complex, period: float, kept: int, multipliers: Complex
) -> Complex:
    """``(1 - 1/mu) alpha_(h-k) H(w + k W)`` for every multiplier, (n, 3 (2 kept + 2), the same)."""
    orders = _orders(kept)
    angular = (np.angle(multipliers)[:, None] + 2 * math.pi * orders) / period
    receptance = _two_sided(source, angular / (2 * math.pi))
    middle = (len(coefficients) - 1) // 2
    blocks = coefficients[middle + orders[:, None] - orders[None, :]]
    product = np.einsum("hkpq,nkqr->nhpkr", blocks, receptance, optimize=True)
    size = 3 * len(orders)
    return np.asarray((1 - 1 / multipliers)[:, None, None] * product.reshape(len(multipliers), size, size))


def _orders(kept: int) -> NDArray[np.int64]:
    """Lines ``-kept - 1 ... kept``: at w T = pi each has its mirror image, so that period doubling stays real."""
    return np.arange(-kept - 1, kept + 1)


def _two_sided(source: ToolReceptance, frequencies: Real) -> Complex:
    """H at positive and negative frequencies; zero outside the span."""
    size = np.abs(frequencies)
    inside = (size >= source.span[0]) & (size <= source.span[1])
    values = np.zeros((*frequencies.shape, 3, 3), dtype=complex)
    values[inside] = source.evaluate(size[inside])
    return np.where((frequencies < 0)[..., None, None], values.conj(), values)


def _phases(source: ToolReceptance, period: float) -> Real:
    """Phases that the FRF's own lines fold onto, and even ones; pi is looked at apart."""
    folded = np.abs(np.angle(np.exp(2j * math.pi * source.grid * period)))
    phases = np.unique(np.concatenate([folded, np.linspace(0, math.pi, _PHASES)]))
    phases = phases[(phases > 1e-6) & (phases < math.pi)]
    if len(phases) > 4 * _PHASES:  # no finer than the grid's own resolution needs
        phases = phases[np.linspace(0, len(phases) - 1, 4 * _PHASES).astype(int)]
    return np.asarray(phases)


def _chatter(
    source: ToolReceptance, matrices: Matrices, found: tuple[float, float, str], period: float, kept: int
) -> float:
    """The line with the largest motion, Hz."""
    matrix = matrices(np.array([np.exp(1j * found[1])]))[0]
    values, vectors = np.linalg.eig(matrix)
    force: Complex = np.asarray(vectors[:, np.argmin(np.abs(values - 1 / found[0]))].reshape(-1, 3), dtype=complex)
    lines: Real = np.asarray((found[1] + 2 * math.pi * _orders(kept)) / (2 * math.pi * period))
    motion = np.einsum("kpq,kq->kp", _two_sided(source, lines), force)
    return float(np.abs(lines[np.argmax(np.linalg.norm(motion, axis=1))]))
