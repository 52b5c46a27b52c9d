"""Receptance of a modal model at spectral lines, and compiled loops over these lines."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled
from modal_fit import ModalModel


@compiled
def reciprocal(value: complex) -> complex:
    """Return ``1 / value`` without protection against overflow, three times as fast as a complex division."""
    return value.conjugate() * (1.0 / (value.real**2 + value.imag**2))


@compiled(
    "(complex128[::1], complex128[::1], complex128[:,::1], complex128[:,::1], complex128[:,::1], complex128[:,::1])"
)
def modal_displacement(s: Complex, poles: Complex, right: Complex, left: Complex, force: Complex, out: Complex) -> None:
    """Write the displacement ``sum_r right_r (left_r . F) / (s - p_r)`` plus the terms of the conjugate poles.

    ``s`` is ``i omega`` of the lines (n,), rad/s, and ``poles`` (n_modes,) holds one of each conjugate pair. The
    vectors ``right`` (n_modes, n_responses) and ``left`` (n_modes, n_excitations) give the residues ``right left^T``,
    m/(N s). ``force`` is (n, n_excitations), N; ``out`` receives (n, n_responses), m.
    """
    out[:] = 0.0
    for k in range(len(s)):
        for r in range(len(poles)):
            push, conjugate_push = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                conjugate_push += left[r, q].conjugate() * force[k, q]
            push *= reciprocal(s[k] - poles[r])
            conjugate_push *= reciprocal(s[k] - poles[r].conjugate())
            for p in range(right.shape[1]):
                out[k, p] += right[r, p] * push + right[r, p].conjugate() * conjugate_push


@compiled(
    "(complex128[::1], Tuple((complex128[::1],complex128[:,:,::1])), UniTuple(float64[:,::1],2), "
    "float64, complex128[:,::1], complex128[:,::1])",
)
def add_outside(
    s: Complex, terms: tuple[Complex, Complex], plain: tuple[Real, Real], lowest: float, force: Complex, out: Complex
) -> None:
    """Add the displacement through modes outside the band, ``(U + L / s^2 + sum_n R_n / (s - p_n) + conjugate) F``.

    ``terms``: poles p (n_terms,), rad/s, and residues R (n_terms, n_responses, n_excitations), m/(N s). ``plain``:
    residual flexibility U, m/N, and residual inertia L, 1/kg, each (n_responses, n_excitations). L is left out below
    the angular frequency ``lowest``, rad/s. Lines, force and ``out`` are those of `modal_displacement`.
    """
    poles, residues = terms
    upper, lower = plain
    for k in range(len(s)):
        inverse_square = reciprocal(s[k] * s[k]) if s[k].imag >= lowest and s[k].imag > 0.0 else 0.0j
        for p in range(upper.shape[0]):
            for q in range(upper.shape[1]):
                out[k, p] += (upper[p, q] + inverse_square * lower[p, q]) * force[k, q]
        for n in range(len(poles)):
            up, down = reciprocal(s[k] - poles[n]), reciprocal(s[k] - poles[n].conjugate())
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
    """Write the derivative of ``M (H F)`` by all numbers of the modes, in the order of `ModelShape`.

    ``factor`` is M, (n, n_rows, n_responses). ``out`` (2, n, n_rows, n_columns) receives real and imaginary parts in
    the columns of the modes, which are the first. Lines and force are those of `modal_displacement`.
    """
    poles, right, left = modes
    n, m = right.shape[1], fitted
    size = 2 + 2 * n + 2 * m
    for k in range(len(s)):
        for r in range(len(poles)):
            up, down = reciprocal(s[k] - poles[r]), reciprocal(s[k] - poles[r].conjugate())
            push, conjugate_push = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                conjugate_push += left[r, q].conjugate() * force[k, q]
            push *= up
            conjugate_push *= down
            even, odd = units[2][r] * (push + conjugate_push), 1j * units[2][r] * (push - conjugate_push)
            first = r * size
            for i in range(factor.shape[1]):
                seen, conjugate_seen = 0.0 + 0.0j, 0.0 + 0.0j
                for p in range(n):
                    seen += factor[k, i, p] * right[r, p]
                    conjugate_seen += factor[k, i, p] * right[r, p].conjugate()
                    _put(out, k, i, first + 2 + p, factor[k, i, p] * even)
                    _put(out, k, i, first + 2 + n + p, factor[k, i, p] * odd)
                seen *= up
                conjugate_seen *= down
                a, b = seen * push, conjugate_seen * conjugate_push
                _put(out, k, i, first, a * units[0][r] + b * units[0][r].conjugate())
                _put(out, k, i, first + 1, a * units[1][r] + b * units[1][r].conjugate())
                a, b = units[3][r] * (seen + conjugate_seen), 1j * units[3][r] * (seen - conjugate_seen)
                for q in range(m):
                    _put(out, k, i, first + 2 + 2 * n + q, a * force[k, q])
                    _put(out, k, i, first + 2 + 2 * n + m + q, b * force[k, q])


@compiled("(complex128[:,::1], float64[:,:,::1], complex128[:,::1], complex128[:,:,::1], float64[:,:,:,::1], int64)")
def outside_slopes(basis: Complex, units: Real, force: Complex, factor: Complex, out: Real, first: int) -> None:
    """Write the derivative of ``M (H F)`` by the numbers of modes outside the band, from column ``first`` on.

    ``basis`` (n_terms, n) holds the functions of frequency, ``units`` (n_terms, n_responses, n_excitations) the unit of
    each number; the other arguments are those of :func:`modal_slopes`.
    """
    n_terms, n, m = units.shape
    for k in range(len(force)):
        for i in range(factor.shape[1]):
            for t in range(n_terms):
                for p in range(n):
                    seen = factor[k, i, p] * basis[t, k]
                    for q in range(m):
                        _put(out, k, i, first + (t * n + p) * m + q, units[t, p, q] * seen * force[k, q])


@compiled("(complex128[:,::1], complex128[:,::1], int64, float64[:,:,:,::1])")
def add_outer(response: Complex, change: Complex, first: int, out: Real) -> None:
    """Add real and imaginary parts of ``b_k c_k^T`` to ``out`` (2, n, n_rows, n_columns) from column ``first`` on.

    ``response`` (n, n_rows) is the response b_k at line k to a unit of a quantity, for instance a force. ``change``
    (n, n_columns) is the derivative c_k of this quantity by fitted numbers.
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
    """Write the spectra of the real signals that combine to the derivative of a deflection by the modes' numbers.

    Let ``a = 1 / (s - p)`` and ``z = rho a^2 (left . F)`` for a mode, and b and w the same for the conjugate mode. The
    signals of the mode are ``z + w``, ``i (z - w)``, ``(a + b) F_q`` for all m forces, and ``i (a - b) F_q`` for all m
    forces. ``out`` has the shape (n or more, n_modes * (2 + 2 m)). Lines and force are those of `modal_displacement`.
    """
    poles, left, rho = modes
    m = fitted
    for k in range(len(s)):
        for r in range(len(poles)):
            first = r * (2 + 2 * m)
            up, down = reciprocal(s[k] - poles[r]), reciprocal(s[k] - poles[r].conjugate())
            push, conjugate_push = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                conjugate_push += left[r, q].conjugate() * force[k, q]
            for q in range(m):
                out[k, first + 2 + q] = (up + down) * force[k, q]
                out[k, first + 2 + m + q] = 1j * (up - down) * force[k, q]
            push *= rho[r] * up * up
            conjugate_push *= rho[r].conjugate() * down * down
            out[k, first] = push + conjugate_push
            out[k, first + 1] = 1j * (push - conjugate_push)


@compiled
def _put(out: Real, k: int, i: int, column: int, value: complex) -> None:
    out[0, k, i, column] = value.real
    out[1, k, i, column] = value.imag


def receptance_at(model: ModalModel, frequencies: Real) -> Complex:
    """Return the receptance (n, n_responses, n_excitations) at lines from 0 Hz on.

    A residual inertia describes modes below the band, but is not valid below these modes. It is left out below a third
    of the lowest mode; otherwise the mean cutting force would accelerate the tool for ever.
    """
    if model.residuals is None or not model.residuals.lower.any():
        return model.receptance(frequencies)
    plain = replace(model, residuals=replace(model.residuals, lower=np.zeros_like(model.residuals.lower)))
    values = plain.receptance(frequencies)
    inside = frequencies >= model.natural_frequencies.min() / 3
    values[inside] -= model.residuals.lower / (2 * np.pi * frequencies[inside, None, None]) ** 2
    return values


def displacement_at(model: ModalModel, frequencies: Real, force: Complex) -> Complex:
    """Return ``H F`` (n, n_responses), m, for force spectra F (n, n_excitations), N, without an array for H.

    The receptance H is that of :func:`receptance_at`.
    """
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    out = np.empty((len(s), model.right.shape[1]), dtype=complex)
    modal_displacement(s, model.poles, model.right, model.left, np.ascontiguousarray(force), out)
    _add_outside(model, s, force, out)
    return out * np.exp(-s * model.delay)[:, None] if model.delay else out


def outside_displacement(model: ModalModel, frequencies: Real, force: Complex) -> Complex:
    """Return the part of :func:`displacement_at` through the residual terms, which are modes outside the band."""
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    out = np.zeros((len(s), model.right.shape[1]), dtype=complex)
    _add_outside(model, s, force, out)
    return out * np.exp(-s * model.delay)[:, None] if model.delay else out


def _add_outside(model: ModalModel, s: Complex, force: Complex, out: Complex) -> None:
    residuals = model.residuals
    if residuals is None:
        return
    poles = np.zeros(0, dtype=complex) if residuals.poles is None else np.asarray(residuals.poles, dtype=complex)
    residues = np.zeros((0, *residuals.upper.shape)) if residuals.residues is None else residuals.residues
    lowest = 2 * np.pi * float(model.natural_frequencies.min()) / 3
    plain = (np.ascontiguousarray(residuals.upper, dtype=float), np.ascontiguousarray(residuals.lower, dtype=float))
    terms = (np.ascontiguousarray(poles), np.ascontiguousarray(residues, dtype=complex))
    add_outside(s, terms, plain, lowest, np.ascontiguousarray(force, dtype=complex), out)


def line_products(a: Complex, b: Complex) -> Complex:
    """Return ``A_k B_k`` of every line k, for A (n_lines, n, m) and B (n_lines, m) or (n_lines, m, n_columns).

    The loop is compiled because one BLAS call for each line would cost more than the product.

    >>> line_products(np.full((1, 2, 2), 1 + 0j), np.array([[1, 2j]])).tolist()
    [[(1+2j), (1+2j)]]
    """
    columns = np.ascontiguousarray(b, dtype=complex).reshape(*b.shape[:2], -1)
    out = np.empty((*a.shape[:2], columns.shape[2]), dtype=complex)
    _multiply(np.ascontiguousarray(a, dtype=complex), columns, out)
    return out.reshape(*a.shape[:2], *b.shape[2:])


def closed_loop(receptance: Complex, feedback: Complex) -> Complex:
    """Return ``(I + H K)^-1 H`` of every line, with H (n_lines, n, m or more) and K (n_lines, m, n).

    Raises ``numpy.linalg.LinAlgError`` if ``I + H K`` is singular at a line.
    """
    loop = line_products(receptance[:, :, : feedback.shape[1]], feedback)
    diagonal = np.arange(loop.shape[1])
    loop[:, diagonal, diagonal] += 1
    result = np.array(receptance, dtype=complex, order="C")
    if not _solve(loop, result):
        raise np.linalg.LinAlgError("the feedback around the structure is singular at a line")
    return result


@compiled("(complex128[:,:,::1], complex128[:,:,::1], complex128[:,:,::1])")
def _multiply(a: Complex, b: Complex, out: Complex) -> None:
    for k in range(len(a)):
        for i in range(a.shape[1]):
            for c in range(b.shape[2]):
                value = a[k, i, 0] * b[k, 0, c]
                for j in range(1, a.shape[2]):
                    value += a[k, i, j] * b[k, j, c]
                out[k, i, c] = value


@compiled("(complex128[:,:,::1], complex128[:,:,::1])")
def _solve(matrix: Complex, right: Complex) -> bool:
    """Overwrite ``right``, B, by ``A^-1 B`` for the matrix A of every line; return False if an A is singular.

    Elimination with partial pivoting is used.
    """
    n = matrix.shape[1]
    for k in range(len(matrix)):
        a, b = matrix[k], right[k]
        for j in range(n):
            if not _pivot(a, b, j):
                return False
            inverse = 1.0 / a[j, j]
            for i in range(j + 1, n):
                factor = a[i, j] * inverse
                for c in range(j + 1, n):
                    a[i, c] -= factor * a[j, c]
                for c in range(b.shape[1]):
                    b[i, c] -= factor * b[j, c]
        _substitute_back(a, b)
    return True


@compiled
def _pivot(matrix: Complex, right: Complex, column: int) -> bool:
    """Exchange rows so that the largest entry of a column is on the diagonal; return False if it is zero."""
    row = column
    for i in range(column + 1, len(matrix)):
        if abs(matrix[i, column]) > abs(matrix[row, column]):
            row = i
    if row != column:
        for c in range(len(matrix)):
            matrix[column, c], matrix[row, c] = matrix[row, c], matrix[column, c]
        for c in range(right.shape[1]):
            right[column, c], right[row, c] = right[row, c], right[column, c]
    regular: bool = abs(matrix[column, column]) != 0.0
    return regular


@compiled
def _substitute_back(upper: Complex, right: Complex) -> None:
    """Overwrite ``right``, B, by ``U^-1 B`` for an upper triangular matrix U."""
    n = len(upper)
    for i in range(n - 1, -1, -1):
        inverse = 1.0 / upper[i, i]
        for c in range(right.shape[1]):
            value = right[i, c]
            for j in range(i + 1, n):
                value -= upper[i, j] * right[j, c]
            right[i, c] = value * inverse
