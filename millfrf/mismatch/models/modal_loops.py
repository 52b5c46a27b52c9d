"""Loops over lines of a modal model and of its derivatives. Compiled."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled


@compiled
def over(value: complex) -> complex:
    """``1 / value``; a complex division that guards against overflow takes three times as long."""
    return value.conjugate() * (1.0 / (value.real**2 + value.imag**2))


@compiled(
    "(complex128[::1], complex128[::1], complex128[:,::1], complex128[:,::1], complex128[:,::1], complex128[:,::1])",
)
def modal_displacement(s: Complex, poles: Complex, right: Complex, left: Complex, force: Complex, out: Complex) -> None:
    """Write ``sum_r right_r (left_r . F) / (s - p_r)`` and its conjugate half.

    Parameters
    ----------
    s : (n,), rad/s
        Laplace variable ``i omega`` of the lines.
    poles : (n_modes,), rad/s
        Poles of the modes, one of each conjugate pair.
    right : (n_modes, n_responses)
        Right vectors of the modes; ``right left^T`` is the residue, m/(N s).
    left : (n_modes, n_excitations)
        Left vectors of the modes.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    out : (n, n_responses), m
        Receives the displacement at the lines.
    """
    out[:] = 0.0
    for k in range(len(s)):
        for r in range(len(poles)):
            push, pull = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                pull += left[r, q].conjugate() * force[k, q]
            push *= over(s[k] - poles[r])
            pull *= over(s[k] - poles[r].conjugate())
            for p in range(right.shape[1]):
                out[k, p] += right[r, p] * push + right[r, p].conjugate() * pull


@compiled(
    "(complex128[::1], Tuple((complex128[::1],complex128[:,:,::1])), UniTuple(float64[:,::1],2), "
    "float64, complex128[:,::1], complex128[:,::1])",
)
def add_outside(
    s: Complex, terms: tuple[Complex, Complex], plain: tuple[Real, Real], lowest: float, force: Complex, out: Complex
) -> None:
    """Add what modes outside the band make of forces.

    ``(U + L / s^2 + sum_n R_n / (s - p_n) + conjugate) F``; at lines below ``lowest`` without L.

    Parameters
    ----------
    s : (n,), rad/s
        Laplace variable ``i omega`` of the lines.
    terms
        Poles (n_terms,) outside the band, rad/s, and residues (n_terms, n_responses, n_excitations), m/(N s).
    plain
        Residual flexibility U, m/N, and residual inertia L, 1/kg, each (n_responses, n_excitations).
    lowest
        Angular frequency from which L counts, rad/s.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    out : (n, n_responses), m
        Is added to: the displacement at the lines.
    """
    poles, residues = terms
    upper, lower = plain
    for k in range(len(s)):
        inverse_square = over(s[k] * s[k]) if s[k].imag >= lowest and s[k].imag > 0.0 else 0.0j
        for p in range(upper.shape[0]):
            for q in range(upper.shape[1]):
                out[k, p] += (upper[p, q] + inverse_square * lower[p, q]) * force[k, q]
        for n in range(len(poles)):
            up, down = over(s[k] - poles[n]), over(s[k] - poles[n].conjugate())
            for p in range(upper.shape[0]):
                for q in range(upper.shape[1]):
                    residue = residues[n, p, q]
                    out[k, p] += (up * residue + down * residue.conjugate()) * force[k, q]


@compiled(
    "(complex128[::1], complex128[:,::1], Tuple((complex128[::1],complex128[:,::1],complex128[:,::1])), "
    "Tuple((complex128[::1],complex128[::1],float64[::1],float64[::1])), complex128[:,:,::1], int64, "
    "float64[:,:,:,::1])",
)
def modal_slopes(
    s: Complex,
    force: Complex,
    modes: tuple[Complex, Complex, Complex],
    units: tuple[Complex, Complex, Real, Real],
    factor: Complex,
    fitted: int,
    out: Real,
) -> None:
    """Write the derivative of ``M (H F)`` by every number of every mode, as `ModelShape` orders them.

    Parameters
    ----------
    s : (n,), rad/s
        Laplace variable ``i omega`` of the lines.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    modes
        Poles (n_modes,), right (n_modes, n_responses) and left vectors (n_modes, n_excitations).
    units
        Change of each pole by a unit of frequency and of damping, units of right and of left entries, each (n_modes,).
    factor : (n, n_rows, n_responses)
        Matrix M that the displacement at each line is multiplied by.
    fitted
        Number of excitations whose left entries are fitted; those behind them only push.
    out : (2, n, n_rows, n_columns)
        Receives real and imaginary parts in the modes' columns; the columns behind them are left alone.
    """
    poles, right, left = modes
    n, m = right.shape[1], fitted
    size = 2 + 2 * n + 2 * m
    for k in range(len(s)):
        for r in range(len(poles)):
            up, down = over(s[k] - poles[r]), over(s[k] - poles[r].conjugate())
            push, pull = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                pull += left[r, q].conjugate() * force[k, q]
            push *= up
            pull *= down
            even, odd = units[2][r] * (push + pull), 1j * units[2][r] * (push - pull)
            first = r * size
            for i in range(factor.shape[1]):
                one, other = 0.0 + 0.0j, 0.0 + 0.0j
                for p in range(n):
                    one += factor[k, i, p] * right[r, p]
                    other += factor[k, i, p] * right[r, p].conjugate()
                    _put(out, k, i, first + 2 + p, factor[k, i, p] * even)
                    _put(out, k, i, first + 2 + n + p, factor[k, i, p] * odd)
                one *= up
                other *= down
                a, b = one * push, other * pull
                _put(out, k, i, first, a * units[0][r] + b * units[0][r].conjugate())
                _put(out, k, i, first + 1, a * units[1][r] + b * units[1][r].conjugate())
                a, b = units[3][r] * (one + other), 1j * units[3][r] * (one - other)
                for q in range(m):
                    _put(out, k, i, first + 2 + 2 * n + q, a * force[k, q])
                    _put(out, k, i, first + 2 + 2 * n + m + q, b * force[k, q])


@compiled(
    "(complex128[:,::1], float64[:,:,::1], complex128[:,::1], complex128[:,:,::1], float64[:,:,:,::1], int64)",
)
def outside_slopes(basis: Complex, units: Real, force: Complex, factor: Complex, out: Real, first: int) -> None:
    """Write the derivative of ``M (H F)`` by the numbers of terms that stand for modes outside the band.

    Parameters
    ----------
    basis : (n_terms, n)
        Functions of frequency at the lines.
    units : (n_terms, n_responses, n_excitations)
        Unit of each number.
    force, factor, out
        As for :func:`modal_slopes`.
    first
        First column of these numbers.
    """
    n_terms, n, m = units.shape
    for k in range(len(force)):
        for i in range(factor.shape[1]):
            for t in range(n_terms):
                for p in range(n):
                    shown = factor[k, i, p] * basis[t, k]
                    for q in range(m):
                        _put(out, k, i, first + (t * n + p) * m + q, units[t, p, q] * shown * force[k, q])


@compiled(
    "(complex128[:,::1], complex128[:,::1], int64, float64[:,:,:,::1])",
)
def add_outer(response: Complex, change: Complex, first: int, out: Real) -> None:
    """Add ``b_k c_k^T`` of every line to some columns.

    Parameters
    ----------
    response : (n, n_rows)
        Response b of each line to a unit of what changes, in the unit of the responses over that of the change.
    change : (n, n_columns)
        Change c of each line for every number that is fitted, as N or another unit.
    first
        Column of ``out`` that the first of them is added to.
    out : (2, n, n_rows, n_columns)
        Is added to: real and imaginary parts.
    """
    for k in range(len(response)):
        for i in range(response.shape[1]):
            value = response[k, i]
            for c in range(change.shape[1]):
                product = value * change[k, c]
                out[0, k, i, first + c] += product.real
                out[1, k, i, first + c] += product.imag


@compiled
def driven_basis(
    s: Complex,
    force: Complex,
    modes: tuple[Complex, Complex, Complex],
    fitted: int,
    out: NDArray[np.complexfloating],
) -> None:
    """Write the real signals that make up every change of a deflection by the modes' numbers, as spectra.

    For each mode, with ``a = 1 / (s - p)`` and ``b`` its conjugate half: ``z + w`` and ``i (z - w)`` with
    ``z = rho a^2 (left . F)``; then ``(a + b) F_q`` of every force, then ``i (a - b) F_q`` of every force.

    Parameters
    ----------
    s : (n,), rad/s
        Laplace variable ``i omega`` of the lines.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    modes
        Poles (n_modes,), left vectors (n_modes, n_excitations), and each mode's right vector along the deflection, rho.
    fitted
        Number m of excitations whose left entries are fitted; those behind them only push.
    out : (n or more, n_modes * (2 + 2 m))
        Receives the spectra.
    """
    poles, left, ahead = modes
    m = fitted
    for k in range(len(s)):
        for r in range(len(poles)):
            first = r * (2 + 2 * m)
            up, down = over(s[k] - poles[r]), over(s[k] - poles[r].conjugate())
            push, pull = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                pull += left[r, q].conjugate() * force[k, q]
            for q in range(m):
                out[k, first + 2 + q] = (up + down) * force[k, q]
                out[k, first + 2 + m + q] = 1j * (up - down) * force[k, q]
            push *= ahead[r] * up * up
            pull *= ahead[r].conjugate() * down * down
            out[k, first] = push + pull
            out[k, first + 1] = 1j * (push - pull)


@compiled
def _put(out: Real, k: int, i: int, column: int, value: complex) -> None:
    """Write the two parts of a value."""
    out[0, k, i, column] = value.real
    out[1, k, i, column] = value.imag
