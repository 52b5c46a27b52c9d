"""Depth limits of many postures at one spindle speed, compiled: averaged coefficients, as the zero-order solution."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, average_directional_matrix, refuse_varied
from cutting.compiled import compiled
from foundation import InputError
from modal_fit import ModalModel

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


def depth_limits(models: Sequence[ModalModel], process: MillingProcess, spindle_speed: float, max_depth: float) -> Real:
    """Largest stable depth of each model at one speed (rad/s), m, (n_models,); infinite above ``max_depth``.

    The smallest positive ``a`` with ``det(I - a K_tc alpha_0 (1 - exp(-i w tau)) H(w)) = 0`` (Budak & Altintas 1998),
    from the eigenvalues of the 3 x 3 loop in closed form on lines around every mode, crossings refined on the model.
    ``stability.zero_order`` finds the same limit, takes FRFs too and gives the chatter frequency, in 40 times the time.

    Parameters
    ----------
    models
        Receptances over TCP X, Y, Z in the axes of the cut.

    Raises
    ------
    InputError
        Speed or depth not positive, or a model over other degrees of freedom.
    """
    if not (spindle_speed > 0 and max_depth > 0):
        raise InputError(f"spindle speed {spindle_speed!r} rad/s and depth {max_depth!r} m must be positive")
    refuse_varied(process, "a map of depth limits", "use the lobes of single postures", takes=("helix",))
    loop = process.ktc * average_directional_matrix(process)
    delay = 2 * np.pi / (process.teeth * spindle_speed)
    limits = np.empty(len(models))
    for i, model in enumerate(models):
        if model.responses != ("TCP:+X", "TCP:+Y", "TCP:+Z") or model.excitations != model.responses:
            raise InputError(f"depth limits need a receptance over TCP:+X, +Y, +Z, not over {model.responses}")
        upper = np.zeros((3, 3)) if model.residuals is None else model.residuals.upper
        left_loop = np.ascontiguousarray(model.left)
        lines = _lines(model, delay)
        limits[i] = _lowest(lines, model.poles, model.right, left_loop, upper, loop, delay, max_depth)
    return limits


def _lines(model: ModalModel, delay: float) -> Real:
    """Angular frequencies: close around each mode, and a twelfth of a turn of the delay between."""
    natural = np.abs(model.poles)
    width = np.maximum(-model.poles.real, 1e-4 * natural)
    offsets = np.tan(np.linspace(-1.45, 1.45, 25))
    low, high = 0.3 * natural.min(), 2.0 * natural.max()
    close = (natural[:, None] + width[:, None] * offsets).ravel()
    step = 2 * np.pi / (12 * delay)
    even = np.concatenate([np.geomspace(low, high, 60), np.arange(low, high, step)])
    lines = np.concatenate([close, even])
    return np.unique(lines[(lines >= low) & (lines <= high)])


@compiled
def _eigenvalues(
    w: float, poles: Complex, right: Complex, left: Complex, upper: Real, loop: Real, delay: float
) -> Complex:
    """Eigenvalues of ``(1 - exp(-i w tau)) alpha H(w)``: roots of the cubic by Cardano, polished by Newton."""
    receptance = upper.astype(np.complex128)
    for r in range(len(poles)):
        ahead, behind = 1 / (1j * w - poles[r]), 1 / (1j * w - np.conj(poles[r]))
        for p in range(3):
            for q in range(3):
                residue = right[r, p] * left[r, q]
                receptance[p, q] += residue * ahead + np.conj(residue) * behind
    g = np.zeros((3, 3), np.complex128)
    factor = 1 - np.exp(-1j * w * delay)
    for p in range(3):
        for q in range(3):
            g[p, q] = factor * (
                loop[p, 0] * receptance[0, q] + loop[p, 1] * receptance[1, q] + loop[p, 2] * receptance[2, q]
            )
    trace = g[0, 0] + g[1, 1] + g[2, 2]
    minors = (
        g[0, 0] * g[1, 1]
        - g[0, 1] * g[1, 0]
        + g[0, 0] * g[2, 2]
        - g[0, 2] * g[2, 0]
        + g[1, 1] * g[2, 2]
        - g[1, 2] * g[2, 1]
    )
    determinant = (
        g[0, 0] * (g[1, 1] * g[2, 2] - g[1, 2] * g[2, 1])
        - g[0, 1] * (g[1, 0] * g[2, 2] - g[1, 2] * g[2, 0])
        + g[0, 2] * (g[1, 0] * g[2, 1] - g[1, 1] * g[2, 0])
    )
    return _cubic(trace, minors, determinant)


@compiled
def _cubic(trace: complex, minors: complex, determinant: complex) -> Complex:
    """Roots of ``x^3 - trace x^2 + minors x - determinant``."""
    shift = trace / 3
    p = minors - trace * trace / 3
    q = -2 * trace**3 / 27 + trace * minors / 3 - determinant
    root = np.sqrt(q * q / 4 + p**3 / 27)
    first, second = -q / 2 + root, -q / 2 - root
    u = (first if abs(first) > abs(second) else second) ** (1 / 3)
    turn = complex(-0.5, 0.8660254037844386)
    roots = np.empty(3, np.complex128)
    for k in range(3):
        roots[k] = shift + (u - p / (3 * u) if abs(u) > 0 else 0j)
        u *= turn
    for k in range(3):
        x = roots[k]
        for _ in range(2):
            slope = 3 * x * x - 2 * trace * x + minors
            if abs(slope) > 0:
                x -= (((x - trace) * x + minors) * x - determinant) / slope
        roots[k] = x
    return roots


@compiled
def _nearest(roots: Complex, guess: complex) -> np.complex128:
    best: np.complex128 = roots[0]
    for k in range(1, 3):
        if abs(roots[k] - guess) < abs(best - guess):
            best = roots[k]
    return best


@compiled
def _lowest(
    lines: Real, poles: Complex, right: Complex, left: Complex, upper: Real, loop: Real, delay: float, max_depth: float
) -> float:
    """Smallest ``1 / lambda`` where an eigenvalue is real and positive."""
    largest = 1 / max_depth
    before = _eigenvalues(lines[0], poles, right, left, upper, loop, delay)
    for i in range(1, len(lines)):
        after = _eigenvalues(lines[i], poles, right, left, upper, loop, delay)
        for k in range(3):
            start, end = before[k], _nearest(after, before[k])
            if start.imag * end.imag < 0 and max(start.real, end.real) > largest:
                low, high, at_low, at_high = lines[i - 1], lines[i], start, end
                for _ in range(30):
                    share = at_low.imag / (at_low.imag - at_high.imag)
                    share = min(max(share, 0.05), 0.95)
                    middle = low + share * (high - low)
                    guess = at_low + share * (at_high - at_low)
                    value = _nearest(_eigenvalues(middle, poles, right, left, upper, loop, delay), guess)
                    if value.imag * at_low.imag < 0:
                        high, at_high = middle, value
                    else:
                        low, at_low = middle, value
                    if abs(value.imag) < 1e-9 * abs(value) or high - low < 1e-10 * high:
                        break
                largest = max(largest, value.real)
        before = after
    return 1 / largest if largest > 1 / max_depth else np.inf
