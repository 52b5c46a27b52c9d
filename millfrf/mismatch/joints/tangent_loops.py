"""Compiled tangent of the simulation of a joint, and derivatives of modal filters in time.

The filters ``1 / (s - p)`` act on band-limited forces in time, without a Fourier transform for each filter.
A step h of ``y' = p y + F`` adds ``int_0^h exp(p (h - t)) F(t) dt``. With Legendre polynomials over the step and
modified spherical Bessel functions i_l this is ``h exp(p h / 2) sum_l (2 l + 1) (-1)^l i_l(p h / 2) m_l``. Here ``m_l``
is the l-th moment of the force over the step: the force filtered by ``i_l(s h / 2)``. All modes use the same moments.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled, inner_loop

from .time_loops import MOMENTS, Columns, filters_run, law_change_run, look_up


@dataclass(frozen=True)
class ModalFilters:
    """Arguments of the compiled loops that apply modal filters to a few forces.

    Each complex state y of a filter gives two signals, 2 Re y and -2 Im y, called its first and second part. The last
    states, one for each mode, give no signals and only drive other states.
    """

    # moments of each force over the step before each instant, followed by the forces at the instant, N,
    # (n, n_sources MOMENTS + n_direct)
    sources: Columns
    turns: Columns  # real and imaginary parts of ``exp(p h)`` and of p, (4, n_states)
    # factors from the moments to the first, then to the second parts of the states, (n_sources MOMENTS, 2 n_states)
    inputs: Columns
    start: Columns  # states at the first instant, (2 n_states,)
    # factors from forces to the time derivatives of the first parts, (n_direct, n_signals / 2); no rows if derivatives
    # are not needed
    direct: Columns
    n_modes: int  # number of states that only drive other states
    step: float  # time step, s

    @property
    def signals(self) -> int:
        """Number of signals."""
        return 2 * (int(self.turns.shape[1]) - self.n_modes)


def modal_filters(
    force: Complex, size: tuple[int, float], modes: tuple[Complex, Complex, Complex], outputs: tuple[int, bool]
) -> ModalFilters:
    """Prepare the filters ``F_q / (s - p)`` of the first forces F_q, and ``rho (l . F) / (s - p)^2``, for each mode.

    The states with signals are ordered mode by mode for the forces F_q, followed by one squared filter for each mode.
    ``force``: spectra from 0 Hz on, (n_lines, n_sources), N. ``size``: number of instants of a period, and time step,
    s. ``modes``: poles p (n_modes,), factor l from each force to each mode (n_modes, n_sources), and factor rho from
    each mode to the deflection (n_modes,). ``outputs``: number of forces F_q, and whether time derivatives are needed.
    """
    (period, step), (n_forces, rates) = size, outputs
    poles, left, to_deflection = modes
    count, n = len(poles), force.shape[1]
    unit = np.tile(np.eye(n, dtype=complex)[None, :n_forces], (count, 1, 1)).reshape(count * n_forces, n)
    pushes = np.vstack([unit, to_deflection[:, None] * left, to_deflection[:, None] * left])
    mode = np.concatenate([np.repeat(np.arange(count), n_forces), np.arange(count), np.arange(count)])
    double = np.zeros(len(mode), dtype=bool)
    double[count * n_forces : count * n_forces + count] = True
    gains, slopes = _gains(poles, step)
    weights = np.where(double[:, None], slopes[mode], gains[mode])
    inputs = (pushes[:, :, None] * weights[:, None, :]).reshape(len(mode), -1)
    first, second = _starts(force, poles, period, step)
    start = np.sum(pushes * np.where(double[:, None], second[mode], first[mode]), axis=1)
    direct = np.zeros((n_forces if rates else 0, len(mode) - count), dtype=np.float32)
    for q in range(len(direct)):
        direct[q, q : count * n_forces : n_forces] = 2.0
    turn = np.exp(poles * step)[mode]
    return ModalFilters(
        _sources(force, period, len(direct)),
        np.array([turn.real, turn.imag, poles[mode].real, poles[mode].imag], dtype=np.float32),
        np.ascontiguousarray(_two_parts(inputs).T),
        _two_parts(start[:, None])[:, 0].copy(),
        direct,
        count,
        step,
    )


def no_filters(period: int, step: float, rates: bool) -> ModalFilters:
    """Return filters without a mode, for ``period`` instants ``step`` s apart; ``rates``: with time derivatives."""
    sources, none = np.zeros((period, int(rates)), dtype=np.float32), np.zeros((0, 0), dtype=np.float32)
    turns, direct = np.zeros((4, 0), dtype=np.float32), np.zeros((int(rates), 0), dtype=np.float32)
    return ModalFilters(sources, turns, none, none[0:0].ravel(), direct, 0, step)


def _two_parts(values: Complex) -> Columns:
    """Return 2 Re of complex rows (n, m), followed by the rows of -2 Im, (2 n, m)."""
    return np.concatenate([2 * values.real, -2 * values.imag]).astype(np.float32)


def _sources(force: Complex, period: int, direct: int) -> Columns:
    """Return the moments of all forces over the step before each instant, and the first ``direct`` forces in time.

    The shape is (period, n_sources MOMENTS + direct).
    """
    filters, n = _moment_filters(len(force), period), force.shape[1]
    spectra = np.zeros((n * MOMENTS + direct, period // 2 + 1), dtype=np.complex64)
    rows = np.ascontiguousarray(force.T, dtype=np.complex64)
    for moment in range(MOMENTS):
        np.multiply(rows, filters[moment], out=spectra[moment : n * MOMENTS : MOMENTS, : len(force)])
    spectra[n * MOMENTS :, : len(force)] = rows[:direct]
    return np.ascontiguousarray(scipy.fft.irfft(spectra, n=period, axis=1).T)


@lru_cache(maxsize=4)  # a fit needs the same filters at every step
def _moment_filters(count: int, period: int) -> NDArray[np.complex64]:
    """Return the filters (MOMENTS, count) from a force to its moments over the step before an instant."""
    half = np.asarray(1j * np.pi * np.arange(count) / period, dtype=complex)
    filters = np.array([_bessel(half, order) for order in range(MOMENTS)]) * np.exp(-half)
    result: NDArray[np.complex64] = filters.astype(np.complex64)
    result.flags.writeable = False
    return result


def _gains(poles: Complex, step: float) -> tuple[Complex, Complex]:
    """Return the factors from moments to a mode's state and their derivatives by the pole, each (n_modes, MOMENTS)."""
    half = 0.5 * step * poles
    bessel = np.array([_bessel(half, order) for order in range(MOMENTS + 1)])
    gains, slopes = [], []
    for order in range(MOMENTS):
        factor = (2 * order + 1) * (-1) ** order * step * np.exp(half)
        below = order * bessel[order - 1] if order else 0.0
        bessel_slope = (below + (order + 1) * bessel[order + 1]) / (2 * order + 1)
        gains.append(factor * bessel[order])
        slopes.append(0.5 * step * factor * (bessel[order] + bessel_slope))
    return np.array(gains).T, np.array(slopes).T


def _bessel(z: Complex, order: int) -> Complex:
    """Return the modified spherical Bessel function of the first kind by its series: the arguments are small."""
    term = np.ones_like(z) / float(np.prod(np.arange(1, 2 * order + 2, 2)))
    total = term.copy()
    for k in range(1, 9):
        term = term * (0.5 * z * z) / (k * (2 * order + 2 * k + 1))
        total += term
    return np.asarray(z**order * total)


def _starts(force: Complex, poles: Complex, period: int, step: float) -> tuple[Complex, Complex]:
    """Return the first instants of the periodic ``F / (s - p)`` and ``F / (s - p)^2``, each (n_modes, n_sources)."""
    s = np.asarray(2j * np.pi * np.arange(len(force)) / (period * step), dtype=complex)
    first: Complex = np.zeros((len(poles), force.shape[1]), dtype=complex)
    second: Complex = np.zeros_like(first)
    _add_lines(s, poles, np.ascontiguousarray(force), first, second)
    return np.asarray(first / period), np.asarray(second / period)


@compiled
def _add_lines(s: Complex, poles: Complex, force: Complex, first: Complex, second: Complex) -> None:
    """Add up the lines of ``F / (s - p)`` into ``first`` and of ``F / (s - p)^2`` into ``second``.

    The lines at negative frequencies are included.
    """
    for k in range(len(s)):
        for r in range(len(poles)):
            above, below = s[k] - poles[r], -s[k] - poles[r]
            up = above.conjugate() * (1.0 / (above.real**2 + above.imag**2))
            down = below.conjugate() * (1.0 / (below.real**2 + below.imag**2)) if k else 0.0j
            for q in range(force.shape[1]):
                positive, negative = up * force[k, q], down * force[k, q].conjugate()
                first[r, q] += positive + negative
                second[r, q] += up * positive + down * negative


BLOCK = 128  # instants that are processed together, so that their data stays in the processor's cache

TINY = np.float32(1e-26)  # added to each state: processors are slow with numbers below 1e-38, to which states decay


@compiled(
    "(UniTuple(float64[::1],2), UniTuple(complex128[::1],5), "
    "Tuple((UniTuple(float64[::1],2),UniTuple(float64,2),float64[::1],UniTuple(float64[::1],2))), "
    "Tuple((UniTuple(float32[:,::1],2),float32[:,::1],UniTuple(float32[:,::1],2),float64)), "
    "Tuple((float32[:,::1],float32[::1],UniTuple(float32[:,::1],3),Tuple((int64,float64)))), "
    "UniTuple(float32[:,::1],2), float32[::1], float32[:,::1])",
    "(UniTuple(float64[::1],2), UniTuple(complex128[::1],5), "
    "Tuple((UniTuple(float64[::1],2),UniTuple(float64,2),float64[::1],UniTuple(float64[::1],2))), "
    "Tuple((UniTuple(float32[:,::1],2),float32[:,::1],Tuple((float32[:,::1],float32[::1,:])),float64)), "
    "Tuple((float32[:,::1],float32[::1],UniTuple(float32[:,::1],3),Tuple((int64,float64)))), "
    "UniTuple(float32[:,::1],2), float32[::1], float32[:,::1])",
)
def tangent_run(
    motion: tuple[Real, Real],
    dynamics: tuple[Complex, Complex, Complex, Complex, Complex],
    law: tuple[tuple[Real, Real], tuple[float, float], Real, tuple[Real, Real]],
    slopes: tuple[tuple[Columns, Columns], Columns, tuple[Columns, Columns], float],
    filters: tuple[Columns, Columns, tuple[Columns, Columns, Columns], tuple[int, float]],
    signals: tuple[Columns, Columns],
    weights: Columns,
    force: Columns,
) -> None:
    """Write the change dg of a joint's force for each change of its law or of its driven motion.

    The equation is linearised along the motion of :func:`millfrf.mismatch.joints.time_loops.free_run`: ``dg = e + g_x
    dx + g_v dv + memory`` with ``dx = dx_driven - (h * dg)`` and the structure's impulse response h. An element that
    has been sticking since t_i adds ``k_i (dx - dx(t_i))`` to the memory, an element that slips adds nothing.

    Parameters
    ----------
    motion
        Deflection (m) and velocity (m/s) of the free run, each (n,).
    dynamics
        Argument ``dynamics`` of the free run, for the time step of this run.
    law
        Tables, spans, ramp and elements of the free run.
    slopes
        Changes e of the law, the first columns: parts of :class:`millfrf.mismatch.joints.joint_law.LawSlopes`, and the
        time between two instants over the recording's duration.
    filters
        Changes of the driven motion that are modal filters, the next columns: ``sources``, ``start``, (``turns``,
        ``inputs``, ``direct``) and (``n_modes``, ``step``) of
        :class:`millfrf.mismatch.joints.tangent_loops.ModalFilters`.
    signals
        Other changes of the driven deflection (m) and velocity (m/s), each (n, n_signals), the last columns.
    weights : (2 often - 1,)
        Weights of the instants around each written one.
    force : (n // often, n_columns), N
        Receives dg at every ``often``-th instant, as the weighted mean over the instants around it.
    """
    spans, elements = law[1], law[3]
    state, numbers, n_columns = filters[1].copy(), slopes[1].shape[1], force.shape[1]
    n, n_elements = (len(weights) + 1) // 2 * len(force), len(elements[0])
    factors, own = _step_factors(dynamics)
    modes, rows = np.zeros((2, len(factors), n_columns), np.float32), np.zeros((3, n_columns), np.float32)
    changes, e = np.zeros((2, BLOCK, n_columns), np.float32), np.zeros((BLOCK, numbers), np.float32)
    gains, sticks = np.zeros((BLOCK, 4), np.float32), np.ones((BLOCK, n_elements), dtype=np.bool_)
    memory, at_slip = (np.zeros(n_elements), np.zeros(n_elements)), np.zeros((n_elements, n_columns), np.float32)
    elastic = (elements[0], sticks, np.ones(n_elements, dtype=np.bool_), at_slip)
    force[:] = 0.0
    for begin in range(0, n, BLOCK):
        count = min(BLOCK, n - begin)
        dx, dv = changes[0, :count], changes[1, :count]
        law_change_run(motion, begin, (spans, elements[1]), slopes, memory, (sticks, e[:count]))
        _slopes(motion, begin, law, sticks, own, gains[:count])
        filters_run(filters[0], begin, state, filters[2], filters[3], numbers, (dx, dv))
        _write_others(signals, begin, numbers, (dx, dv))
        _respond(factors, gains, e, (dx, dv), (modes[0], modes[1], rows), elastic, len(filters[2][2]) > 0)
        _write(dx, weights, begin, force)


@compiled(
    "(UniTuple(float64[::1],2), int64, "
    "Tuple((UniTuple(float64[::1],2),UniTuple(float64,2),float64[::1],UniTuple(float64[::1],2))), "
    "bool[:,::1], UniTuple(float64,2), float32[:,::1])",
)
def _slopes(
    motion: tuple[Real, Real],
    begin: int,
    law: tuple[tuple[Real, Real], tuple[float, float], Real, tuple[Real, Real]],
    sticks: NDArray[np.bool_],
    own: tuple[float, float],
    out: Columns,
) -> None:
    """Write four numbers for each instant of a block.

    They are the slopes of the force by deflection and by velocity, the factor from the driving change to dg, and the
    change dx per unit of dg.
    """
    tables, spans, ramp, elements = law
    for k in range(len(out)):
        slope_x = look_up(tables[0], spans[0], motion[0][begin + k])[1] + ramp[begin + k]
        slope_v = look_up(tables[1], spans[1], motion[1][begin + k])[1]
        for i in range(sticks.shape[1]):
            if sticks[k, i]:
                slope_x += elements[0][i]
        factor = 1.0 / max(0.2, 1.0 + own[0] * slope_x + own[1] * slope_v)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = slope_x, slope_v, factor, own[0]


@inner_loop
def _write_others(signals: tuple[Columns, Columns], begin: int, numbers: int, changes: tuple[Columns, Columns]) -> None:
    """Write the driven motion of the first columns, which is zero, and of the last columns, which is given."""
    for side in range(2):
        change, signal = changes[side], signals[side]
        first = change.shape[1] - signal.shape[1]
        for k in range(len(change)):
            for j in range(numbers):
                change[k, j] = 0.0
            for j in range(signal.shape[1]):
                change[k, first + j] = signal[begin + k, j]


@compiled
def _step_factors(dynamics: tuple[Complex, Complex, Complex, Complex, Complex]) -> tuple[Columns, tuple[float, float]]:
    """Return the factors of one step of each mode, and the instantaneous effect of a force on deflection and velocity.

    The factors have single precision like the columns: a mixture of both precisions takes twice the time.
    """
    decay, start, end, to_x, to_v = dynamics
    factors = np.empty((len(decay), 8), np.float32)
    own_x, own_v = 0.0, 0.0
    for r in range(len(decay)):
        own_x += 2.0 * (to_x[r] * end[r]).real
        own_v += 2.0 * (to_v[r] * end[r]).real
        # the same force acts at the end of the previous step and at the start of this step
        push = start[r] + decay[r] * end[r]
        factors[r, 0], factors[r, 1], factors[r, 2], factors[r, 3] = decay[r].real, decay[r].imag, push.real, push.imag
        factors[r, 4], factors[r, 5] = 2.0 * to_x[r].real, 2.0 * to_x[r].imag
        factors[r, 6], factors[r, 7] = 2.0 * to_v[r].real, 2.0 * to_v[r].imag
    return factors, (own_x, own_v)


@compiled(
    "(float32[:,::1], float32[:,::1], float32[:,::1], UniTuple(float32[:,::1],2), "
    "UniTuple(float32[:,::1],3), Tuple((float64[::1],bool[:,::1],bool[::1],float32[:,::1])), bool)",
)
def _respond(
    factors: Columns,
    gains: Columns,
    e: Columns,
    changes: tuple[Columns, Columns],
    state: tuple[Columns, Columns, Columns],
    elements: tuple[Real, NDArray[np.bool_], NDArray[np.bool_], Columns],
    rates: bool,
) -> None:
    """Overwrite the driven change of the deflection by the change of the force, instant by instant.

    ``state`` holds real and imaginary parts of the modes, and rows with the last change of the force, of its memory and
    of the deflection. The copies allow the compiler to vectorise the loops (eight columns at once), as arrays that are
    created here cannot overlap.
    """
    real, imaginary, rows = state[0].copy(), state[1].copy(), state[2]
    x, v = np.zeros_like(rows[0]), np.zeros_like(rows[0])
    g, memory, last = rows[0].copy(), rows[1].copy(), rows[2].copy()
    n_columns, dx, dv = len(g), changes[0], changes[1]
    for k in range(len(dx)):
        if len(elements[0]):
            _slip(elements, k, memory, last)
        _copy_row(dx, k, x)
        _copy_row(dv, k, v)
        for r in range(len(factors)):
            turn_real, turn_imag, push_real, push_imag = factors[r, 0], factors[r, 1], factors[r, 2], factors[r, 3]
            x_real, x_imag, v_real, v_imag = factors[r, 4], factors[r, 5], factors[r, 6], factors[r, 7]
            # in a separate function, the compiler would not vectorise this loop
            for j in range(n_columns):
                a = turn_real * real[r, j] - turn_imag * imaginary[r, j] - push_real * g[j] + TINY
                b = turn_imag * real[r, j] + turn_real * imaginary[r, j] - push_imag * g[j]
                real[r, j], imaginary[r, j] = a, b
                x[j] += x_real * a - x_imag * b
            if rates:
                for j in range(n_columns):
                    v[j] += v_real * real[r, j] - v_imag * imaginary[r, j]
        slope_x, slope_v, factor, own = gains[k, 0], gains[k, 1], gains[k, 2], gains[k, 3]
        for j in range(n_columns):
            g[j] = (slope_x * x[j] + slope_v * v[j] - memory[j]) * factor
        for j in range(e.shape[1]):
            g[j] += e[k, j] * factor
        for j in range(n_columns):
            last[j] = x[j] - own * g[j]
            dx[k, j] = g[j]
    state[0][:], state[1][:] = real, imaginary
    rows[0], rows[1], rows[2] = g, memory, last


@inner_loop
def _copy_row(table: Columns, k: int, row: Columns) -> None:
    """Copy a row of a table: a view of the row would be counted as a reference, which takes longer than the copy."""
    for j in range(len(row)):
        row[j] = table[k, j]


@inner_loop
def _slip(
    elements: tuple[Real, NDArray[np.bool_], NDArray[np.bool_], Columns],
    k: int,
    memory: NDArray[np.float32],
    last: NDArray[np.float32],
) -> None:
    """Update the memory of the elements: store the change for one that begins to stick, drop it for one that slips."""
    springs, sticks, stuck, at_slip = elements
    for i in range(len(springs)):
        spring = np.float32(springs[i])
        if sticks[k, i] and not stuck[i]:
            for j in range(len(last)):
                at_slip[i, j] = last[j]
                memory[j] += spring * last[j]
        elif stuck[i] and not sticks[k, i]:
            for j in range(len(last)):
                memory[j] -= spring * at_slip[i, j]
        stuck[i] = sticks[k, i]


@inner_loop
def _write(dg: Columns, weights: Columns, begin: int, force: Columns) -> None:
    """Distribute the values at the instants of a block over the sample before and the sample after each instant."""
    often = (len(weights) + 1) // 2
    for k in range(len(dg)):
        row, past = (begin + k) // often, (begin + k) % often
        weight = weights[past + often - 1]
        for j in range(dg.shape[1]):
            force[row, j] += weight * dg[k, j]
        if past and row + 1 < len(force):
            weight = weights[past - 1]
            for j in range(dg.shape[1]):
                force[row + 1, j] += weight * dg[k, j]
