"""The parametric response of stacked tests: modes, out-of-band terms, transients; their start by least squares."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from millfrf.core import Complex, Real

from .whole_records import RecordSpectra


@dataclass(frozen=True)
class LikelihoodModel:
    """Unknowns of the fit, in the order in which they are packed into one real vector.

    Response of line k in test t, with D_k = s_k^derivative:
    ``D_k [sum_r right_r left_r^T / (s - p_r) + conjugate + out-of-band] F
    + D_k sum_r right_r transient_tr / (s - p_r) + smooth polynomial_t(s)``.
    """

    poles: Complex  # (n_modes,), rad/s, in the upper half plane
    right: Complex  # (n_modes, n_responses)
    left: Complex  # (n_modes, n_excitations)
    out_of_band: Real  # (n_terms, n_responses, n_excitations): coefficients of the basis
    transient: Complex  # (n_tests, n_modes): free decay from each record's ends, in units of left times force
    smooth: Complex  # (n_tests, n_smooth, n_responses): transients from outside the band, a polynomial

    @property
    def n_free(self) -> int:
        """Return the number of free real unknowns: all but the scaling of each pair of vectors."""
        return self.pack().size - 2 * len(self.poles)

    def pack(self) -> Real:
        """Return all unknowns in a real vector; each complex array as its real parts, then its imaginary parts."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return np.concatenate(
            [part.ravel() for a in arrays for part in ((a.real, a.imag) if np.iscomplexobj(a) else (a,))]
        )

    def unpack(self, packed: Real) -> "LikelihoodModel":
        """Return a model whose arrays have the shapes of this one and the values of the vector ``packed``."""
        changes = {}
        start = 0
        for field in fields(self):
            array = getattr(self, field.name)
            values, start = packed[start : start + array.size], start + array.size
            if np.iscomplexobj(array):
                values, start = values + 1j * packed[start : start + array.size], start + array.size
            changes[field.name] = values.reshape(array.shape)
        return replace(self, **changes)

    def places(self) -> "LikelihoodModel":
        """Return a model whose values are the places of the unknowns in the packed vector."""
        return self.unpack(np.arange(self.pack().size, dtype=float))


@dataclass(frozen=True)
class LikelihoodProblem:
    """The quantities that stay fixed during a fit: lines, out-of-band basis and polynomials over the band.

    Arrays of the fit have the lines on their last axis, so that sums over the lines of a test are matrix products.
    """

    spectra: RecordSpectra
    basis: Complex  # (n_terms, n_lines): out-of-band functions of s, on receptance
    powers: Real  # (n_smooth, n_lines): polynomials over the band, scaled to -1 ... 1

    @cached_property
    def force(self) -> Complex:
        """Return the measured forces, (n_excitations, n_lines)."""
        return np.ascontiguousarray(self.spectra.excitation.T)

    @cached_property
    def response(self) -> Complex:
        """Return the measured responses, (n_responses, n_lines)."""
        return np.ascontiguousarray(self.spectra.response.T)

    @cached_property
    def differentiation(self) -> Complex:
        """Return s^derivative, shape (n_responses, n_lines)."""
        return np.asarray(self.spectra.s ** self.spectra.derivative[:, None])


def transfer(model: LikelihoodModel, problem: LikelihoodProblem) -> Complex:
    """Return the FRF of the measured quantity on every line, shape (n_responses, n_excitations, n_lines)."""
    s, n_modes = problem.spectra.s, len(model.poles)
    residues = (model.right[:, :, None] * model.left[:, None, :]).reshape(n_modes, -1)
    functions = np.concatenate([1 / (s - model.poles[:, None]), 1 / (s - model.poles.conj()[:, None]), problem.basis])
    factors = np.concatenate([residues, residues.conj(), model.out_of_band.reshape(len(problem.basis), -1)])
    receptance = (factors.T @ functions).reshape(*model.out_of_band.shape[1:], -1)
    return np.asarray(problem.differentiation[:, None] * receptance)


def prediction(model: LikelihoodModel, problem: LikelihoodProblem, frf: Complex) -> Complex:
    """Return the response lines of the model for the measured excitation, shape (n_responses, n_lines)."""
    test = problem.spectra.test
    forced = np.sum(frf * problem.force, axis=1)
    decay = model.transient.T[:, test] / (problem.spectra.s - model.poles[:, None])
    polynomial = np.einsum("nk,npk->pk", problem.powers, model.smooth.transpose(1, 2, 0)[:, :, test])
    return np.asarray(forced + problem.differentiation * (model.right.T @ decay) + polynomial)


def gauge_directions(model: LikelihoodModel) -> Real:
    """Return orthonormal directions in the unknowns that change no prediction, shape (n_unknowns, 2 n_modes).

    ``right_r`` may be multiplied by any complex number by which ``left_r`` and the transients are divided.
    """
    directions = []
    n_unknowns = model.pack().size
    for r in range(len(model.poles)):
        for factor in (1.0, 1j):
            step = model.unpack(np.zeros(n_unknowns))
            step.right[r] = factor * model.right[r]
            step.left[r] = -factor * model.left[r]
            step.transient[:, r] = -factor * model.transient[:, r]
            directions.append(step.pack())
    return np.asarray(np.linalg.qr(np.array(directions).T)[0])


def linear_start(poles: Complex, problem: LikelihoodProblem) -> LikelihoodModel:
    """Solve for the unknowns by least squares at fixed ``poles`` (rad/s), with residue matrices reduced to rank one.

    Responses of one kind have the same regressors, so that they share one factorisation. The transients of each test
    are eliminated from its lines; the other unknowns are solved for over all tests. The residue matrices have full rank
    at first; their leading singular vectors are the right and left vectors.
    """
    spectra = problem.spectra
    n_modes, n_excitations, n_terms = len(poles), spectra.excitation.shape[1], len(problem.basis)
    n_responses, n_tests = spectra.response.shape[1], spectra.n_tests
    shared = np.empty((2 * n_modes * n_excitations + n_terms * n_excitations, n_responses))
    own = np.empty((n_tests, 2 * (n_modes + len(problem.powers)), n_responses))
    for derivative in np.unique(spectra.derivative):
        chosen = spectra.derivative == derivative
        shared[:, chosen], own[:, :, chosen] = _solution(poles, problem, int(derivative), spectra.response[:, chosen])
    residues, out_of_band = np.split(shared, [2 * n_modes * n_excitations])
    residues = residues.reshape(n_modes, n_excitations, 2, -1)
    out_of_band = np.moveaxis(out_of_band.reshape(n_terms, n_excitations, -1), 1, 2)
    free = own.reshape(n_tests, -1, 2, n_responses)
    decays = free[:, :, 0] + 1j * free[:, :, 1]
    matrices = np.moveaxis(residues[:, :, 0] + 1j * residues[:, :, 1], 1, 2)
    return _rank_one(poles, matrices, out_of_band, decays[:, :n_modes], decays[:, n_modes:])


def regressors(poles: Complex, problem: LikelihoodProblem, derivative: int) -> Complex:
    """Return the columns that all tests share, for real unknowns, shape (n_lines, n_unknowns).

    First the residues, mode by mode and excitation by excitation (real and imaginary part), then the out-of-band terms.
    """
    spectra = problem.spectra
    s, force = spectra.s, spectra.excitation
    plus, minus = _resonances(poles, s, derivative)
    residues = np.einsum("krc,kq->krqc", np.stack([plus + minus, 1j * (plus - minus)], axis=2), force)
    out_of_band = np.einsum("nk,kq->knq", s**derivative * problem.basis, force)
    return np.concatenate([block.reshape(len(s), -1) for block in (residues, out_of_band)], axis=1)


def _resonances(poles: Complex, s: Complex, derivative: int) -> tuple[Complex, Complex]:
    """Return ``s^d / (s - p)`` of each pole p, and of its conjugate, (n_lines, n_modes) each."""
    factor = (s**derivative)[:, None]
    return factor / (s[:, None] - poles), factor / (s[:, None] - poles.conj())


def _transients(poles: Complex, problem: LikelihoodProblem, derivative: int) -> Complex:
    """Return the columns of the transients of a line's own test: decays, then polynomials, (n_lines, n_unknowns)."""
    decays, _ = _resonances(poles, problem.spectra.s, derivative)
    free = np.concatenate([decays, problem.powers.T], axis=1)
    return np.asarray((free[:, :, None] * np.array([1, 1j])).reshape(len(free), -1))


def _solution(poles: Complex, problem: LikelihoodProblem, derivative: int, response: Complex) -> tuple[Real, Real]:
    """Solve for the shared unknowns (n_shared, n_responses) and those of each test (n_tests, n_own, n_responses)."""
    own, shared = _transients(poles, problem, derivative), regressors(poles, problem, derivative)
    joined = np.concatenate([own, shared, response], axis=1)
    n_own, n_columns = own.shape[1], own.shape[1] + shared.shape[1]
    # the triangular factor of a test holds all that its lines say: first rows with its transients, then without
    factors = [_triangle(joined[lines]) for lines in problem.spectra.lines_of_tests]
    reduced = np.concatenate([factor[n_own:, n_own:] for factor in factors])
    common = _least_squares(reduced[:, : n_columns - n_own], reduced[:, n_columns - n_own :])
    ends = [
        _least_squares(rows[:, :n_own], rows[:, n_columns:] - rows[:, n_own:n_columns] @ common)
        for rows in (factor[:n_own] for factor in factors)
    ]
    return common, np.array(ends)


def _triangle(columns: Complex) -> Real:
    """Return the triangular factor of the real parts above the imaginary parts."""
    return np.asarray(np.linalg.qr(np.concatenate([columns.real, columns.imag]), mode="r"))


def _least_squares(design: Real, target: Real) -> Real:
    """Solve by least squares, with columns scaled to unit length."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    return np.asarray(np.linalg.lstsq(design / scale, target, rcond=1e-12)[0] / scale[:, None])


def _rank_one(
    poles: Complex, matrices: Complex, out_of_band: Real, decays: Complex, smooth: Complex
) -> LikelihoodModel:
    """Reduce the residue matrices to their leading singular pair and express the transients by the right vectors."""
    u, sigma, vh = np.linalg.svd(matrices)
    root = np.sqrt(sigma[:, :1])
    right, left = u[:, :, 0] * root, vh[:, 0] * root
    length = np.sum(np.abs(right) ** 2, axis=1)
    transient = np.einsum("trp,rp->tr", decays, right.conj()) / np.where(length > 0, length, 1.0)
    poles = np.asarray(poles, dtype=complex)
    return LikelihoodModel(poles, right, left, np.ascontiguousarray(out_of_band), transient, smooth)
