"""Start of the likelihood fit: all unknowns but the poles by linear least squares, test by test."""

import numpy as np

from millfrf.core import Complex, Real

from .likelihood_model import LikelihoodModel, LikelihoodProblem


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
