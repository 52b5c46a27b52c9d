"""Gauss-Newton equations of the likelihood fit, summed test by test over the unknowns that act there."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, Index, Real

from .likelihood_model import LikelihoodModel, LikelihoodProblem, prediction, transfer
from .whole_records import NoiseLevels

PIECE = 512  # lines whose derivatives are computed at a time: they stay in the processor's cache


@dataclass(frozen=True)
class LineWeights:
    """Inverse covariance of the equation error on every line, ``V^-1 = diag(inverse) - factor factor^H``.

    ``V = diag(v) + G G^H``, with one column of ``G = H diag(w)^(1/2)`` for each noisy force, is inverted by Woodbury's
    identity: only matrices with a row for each noisy force are factorised.
    """

    inverse: Real  # (n_responses, n_lines)
    factor: Complex  # (n_responses, n_noisy_forces, n_lines)
    log_determinant: float  # of V, summed over the lines

    def between(self, row: int, column: int, lines: slice) -> Complex:
        """Return the entry (n_lines,) of V^-1 between two responses."""
        entry = -np.sum(self.factor[row, :, lines] * self.factor[column, :, lines].conj(), axis=0)
        return np.asarray(entry + self.inverse[row, lines] if row == column else entry)

    def weighted(self, values: Complex, lines: slice) -> Complex:
        """Return V^-1 times ``values`` (n, n_responses, n_lines)."""
        result = self.inverse[:, lines] * values
        for column in self.factor[..., lines].swapaxes(0, 1):
            result -= column * np.sum(column.conj() * values, axis=1)[:, None]
        return np.asarray(result)


def line_weights(noise: NoiseLevels, frf: Complex, test: Index) -> LineWeights:
    """Invert the covariance of ``X - H F`` on every line, for an FRF (n_responses, n_excitations, n_lines)."""
    variance = noise.response.T[:, test]
    inverse = 1 / variance
    noisy = noise.excitation.any(axis=0)
    by_force = frf[:, noisy] * np.sqrt(noise.excitation[:, noisy]).T[:, test]
    scaled = inverse[:, None] * by_force
    n_noisy = by_force.shape[1]
    inner = np.sum(by_force.conj()[:, :, None] * scaled[:, None], axis=0)
    inner[np.arange(n_noisy), np.arange(n_noisy)] += 1
    # Cholesky factor C of the inner matrix, column by column, and at once C^-1 scaled^H
    rows, logarithms = scaled.conj().swapaxes(0, 1), np.log(variance).sum()
    for k in range(n_noisy):
        pivot = np.sqrt(inner[k, k].real)
        below = inner[k + 1 :, k] / pivot
        rows[k] /= pivot
        rows[k + 1 :] -= below[:, None] * rows[k]
        inner[k + 1 :, k + 1 :] -= below[:, None] * below.conj()
        logarithms += 2 * np.log(pivot).sum()
    return LineWeights(inverse, np.ascontiguousarray(rows.conj().swapaxes(0, 1)), float(logarithms))


@dataclass(frozen=True)
class Evaluation:
    """FRF, error and weights of a model on every line."""

    model: LikelihoodModel
    frf: Complex  # (n_responses, n_excitations, n_lines)
    error: Complex  # (n_responses, n_lines): equation error, response minus prediction
    weights: LineWeights
    weighted_error: Complex  # (n_responses, n_lines): V^-1 e
    cost: float  # e^H V^-1 e, summed over the lines


def evaluate(model: LikelihoodModel, problem: LikelihoodProblem, noise: NoiseLevels) -> Evaluation:
    """Compute the FRF, the error and the cost of a model."""
    frf = transfer(model, problem)
    error = problem.response - prediction(model, problem, frf)
    weights = line_weights(noise, frf, problem.spectra.test)
    weighted = weights.weighted(error[None], slice(None))[0]
    return Evaluation(model, frf, error, weights, weighted, float(np.real(np.vdot(error, weighted))))


def normal_equations(problem: LikelihoodProblem, noise: NoiseLevels, at: Evaluation) -> tuple[Real, Real]:
    """Return matrix and right side of the Gauss-Newton step of the packed unknowns.

    The transients of a test act on its lines only. Each test therefore adds a block of the unknowns that act there; the
    derivatives of the other tests' transients, which are zero, are not computed.
    """
    places = at.model.places()
    n_unknowns = at.model.pack().size
    matrix, right_side = np.zeros((n_unknowns, n_unknowns)), np.zeros(n_unknowns)
    force = corrected_force(problem, noise, at)
    for number, lines in enumerate(problem.spectra.lines_of_tests):
        where = unknowns_of_test(places, number)
        for first in range(lines.start, lines.stop, PIECE):
            piece = slice(first, min(first + PIECE, lines.stop))
            products = _products(problem, at, force[:, piece], number, piece)
            matrix[np.ix_(where, where)] += products[:-1, :-1]
            right_side[where] += products[:-1, -1]
    return matrix, right_side


def gradient(problem: LikelihoodProblem, noise: NoiseLevels, at: Evaluation, error: Complex) -> Real:
    """Return the right side of :func:`normal_equations` for another ``error`` (n_responses, n_lines)."""
    places = at.model.places()
    right_side = np.zeros(at.model.pack().size)
    force = corrected_force(problem, noise, at)
    weighted = at.weights.weighted(error[None], slice(None))
    for number, lines in enumerate(problem.spectra.lines_of_tests):
        where = unknowns_of_test(places, number)
        for first in range(lines.start, lines.stop, PIECE):
            piece = slice(first, min(first + PIECE, lines.stop))
            functions = _single_response_functions(problem, at.model, force[:, piece], number, piece)
            joint = _joint_derivatives(problem, at.model, force[:, piece], number, piece)
            single = [real_products(own, weighted[:, row, piece]) for row, own in enumerate(functions)]
            right_side[where] += np.concatenate([*single, real_products(joint, weighted[..., piece])])[:, 0]
    return right_side


def force_noise_information(problem: LikelihoodProblem, noise: NoiseLevels, at: Evaluation) -> Real:
    """Return the part of the matrix of :func:`normal_equations` that noise of the corrected force adds to its mean.

    The corrected force has an error of the covariance ``C = W - W H^H V^-1 H W``, and derivatives are linear in the
    force; with columns c of ``C = sum c c^H`` the part is ``sum J(c)^H V^-1 J(c)``. It is as smooth over the lines as
    the modes, so that lines a quarter of the narrowest half bandwidth apart are enough.
    """
    n_unknowns, matrix = at.model.pack().size, np.zeros((at.model.pack().size,) * 2)
    if not noise.excitation.any():
        return matrix
    places = at.model.places()
    without_ends = replace(at, model=replace(at.model, transient=np.zeros_like(at.model.transient)))
    for number, lines in enumerate(problem.spectra.lines_of_tests):
        spacing = np.ptp(problem.spectra.s[lines].imag) / (lines.stop - lines.start - 1)
        apart = max(1, int(np.min(-at.model.poles.real) / spacing / 4))
        where = unknowns_of_test(places, number)
        part = np.zeros((len(where), len(where)))
        for first in range(lines.start, lines.stop, apart * PIECE):
            piece = slice(first, min(first + apart * PIECE, lines.stop), apart)
            for column in _errors_of_force(noise.excitation[number], at, piece):
                part += _products(problem, without_ends, column, number, piece)[:-1, :-1]
        n_lines = lines.stop - lines.start
        matrix[np.ix_(where, where)] += part * n_lines / -(-n_lines // apart)
    driven = places.unpack(np.ones(n_unknowns))  # the ends of the recordings act without a force
    driven.transient[...], driven.smooth[...] = 0.0, 0.0
    return np.asarray(matrix * np.outer(driven.pack(), driven.pack()))


def _errors_of_force(power: Real, at: Evaluation, lines: slice) -> Iterator[Complex]:
    """Yield the columns (n_excitations, n_lines) of the corrected force's covariance."""
    frf = at.frf[..., lines]
    weighted = at.weights.weighted(frf.swapaxes(0, 1), lines).transpose(2, 1, 0)
    covariance = np.diag(power) - power[:, None] * (frf.transpose(2, 1, 0).conj() @ weighted) * power
    values, vectors = np.linalg.eigh(covariance)
    for column in np.moveaxis(vectors * np.sqrt(np.maximum(values, 0.0))[:, None], 2, 0):
        yield np.ascontiguousarray(column.T)


def corrected_force(problem: LikelihoodProblem, noise: NoiseLevels, at: Evaluation) -> Complex:
    """Return the force minus its estimated noise, F + W H^H V^-1 e; see :func:`maximise_likelihood`."""
    if not noise.excitation.any():
        return problem.force
    correction = np.sum(at.frf.conj() * at.weighted_error[:, None], axis=0)
    return np.asarray(problem.force + noise.excitation.T[:, problem.spectra.test] * correction)


def unknowns_of_test(places: LikelihoodModel, test: int) -> Index:
    """Return the places of the unknowns of a test in the packed vector, in the order of :func:`_products`."""
    n_responses = places.right.shape[1]
    smooth = places.smooth[test]
    own = (
        *(places.right.real, places.right.imag),
        places.out_of_band.swapaxes(1, 2).reshape(-1, n_responses),
        *(smooth.real, smooth.imag),
    )
    shared = (places.poles, places.left.ravel(), places.transient[test])
    joint = [part for array in shared for part in (array.real, array.imag)]
    return np.concatenate([np.concatenate(own).T.ravel(), *joint]).astype(np.int64)


def _products(problem: LikelihoodProblem, at: Evaluation, force: Complex, number: int, lines: slice) -> Real:
    """Return the products of all derivatives and of the error on the lines of a test, weighted by V^-1.

    First the unknowns of one response each, response by response; their derivatives are the same functions for all
    responses. Then those that act on all responses, and last the error.
    """
    functions = _single_response_functions(problem, at.model, force, number, lines)
    joint = np.concatenate([_joint_derivatives(problem, at.model, force, number, lines), at.error[None, :, lines]])
    weighted = at.weights.weighted(joint, lines)
    n_responses, n_functions = len(functions), len(functions[0])
    n_single = n_responses * n_functions
    products = np.zeros((n_single + len(joint),) * 2)
    coupled = at.weights.factor.shape[1] > 0
    for row, own in enumerate(functions):
        begin = row * n_functions
        for column in range(row, n_responses if coupled else row + 1):
            entry = at.weights.between(row, column, lines)
            there = slice(column * n_functions, (column + 1) * n_functions)
            products[begin : begin + n_functions, there] = real_products(own, entry * functions[column])
        products[begin : begin + n_functions, n_single:] = real_products(own, weighted[:, row])
    products[n_single:, n_single:] = real_products(joint, weighted)
    upper = np.triu(products)
    return np.asarray(upper + np.triu(upper, 1).T)


def real_products(first: Complex, second: Complex) -> Real:
    """Return the real parts of the scalar products of rows, (n_first, n_second)."""
    of_first, of_second = (np.ascontiguousarray(rows).reshape(len(rows), -1).view(float) for rows in (first, second))
    return np.asarray(of_first @ of_second.T)


def _single_response_functions(
    problem: LikelihoodProblem, model: LikelihoodModel, force: Complex, number: int, lines: slice
) -> list[Complex]:
    """Return the derivatives of each response by its unknowns: right vectors, out-of-band terms, polynomial.

    The list has an array (n_functions, n_lines) for each response; responses of one kind share it.
    """
    s = problem.spectra.s[lines]
    drive = model.left @ force + model.transient[number][:, None]
    direct, conjugate = (
        drive / (s - model.poles[:, None]),
        (model.left.conj() @ force) / (s - model.poles.conj()[:, None]),
    )
    terms = (problem.basis[:, None, lines] * force).reshape(-1, len(s))
    moving = np.concatenate([direct + conjugate, 1j * (direct - conjugate), terms])
    powers = problem.powers[:, lines]
    kinds, kind_of_response = np.unique(problem.spectra.derivative, return_inverse=True)
    arrays = [np.concatenate([s**kind * moving, powers, 1j * powers]) for kind in kinds]
    return [arrays[kind] for kind in kind_of_response]


def constant_derivatives(
    problem: LikelihoodProblem, model: LikelihoodModel, force: Complex, number: int, lines: slice
) -> Complex:
    """Return the derivatives (n_unknowns, n_responses, n_lines) of a test by :func:`unknowns_of_test`."""
    functions = _single_response_functions(problem, model, force, number, lines)
    n_responses, n_functions, n_lines = len(functions), *functions[0].shape
    single = np.zeros((n_responses, n_functions, n_responses, n_lines), dtype=complex)
    for response, own in enumerate(functions):
        single[response, :, response] = own
    joint = _joint_derivatives(problem, model, force, number, lines)
    return np.concatenate([single.reshape(-1, n_responses, n_lines), joint])


def _joint_derivatives(
    problem: LikelihoodProblem, model: LikelihoodModel, force: Complex, number: int, lines: slice
) -> Complex:
    """Return the derivatives of all responses by poles, left vectors and the test's transients.

    The shape is (n_joint, n_responses, n_lines): real parts before imaginary parts of each kind of unknown.
    """
    s, n_modes = problem.spectra.s[lines], len(model.poles)
    plus, minus = 1 / (s - model.poles[:, None]), 1 / (s - model.poles.conj()[:, None])
    drive = model.left @ force + model.transient[number][:, None]
    differentiation = problem.differentiation[None, :, lines]

    def columns(direct: Complex, conjugate: Complex) -> list[Complex]:
        """Return derivatives by real and imaginary parts; each function belongs to a mode, mode by mode."""
        owner = np.repeat(np.arange(n_modes), len(direct) // n_modes)
        first = direct[:, None] * (differentiation * model.right[owner][:, :, None])
        second = conjugate[:, None] * (differentiation * model.right.conj()[owner][:, :, None])
        return [first + second, 1j * (first - second)]

    by_pole = columns(plus**2 * drive, minus**2 * (model.left.conj() @ force))
    by_left = columns(*((each[:, None] * force).reshape(-1, len(s)) for each in (plus, minus)))
    decay = plus[:, None] * (differentiation * model.right[:, :, None])
    return np.concatenate([*by_pole, *by_left, decay, 1j * decay])
