"""The parametric response of stacked tests: modes, out-of-band terms and transients."""

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
        """Return all unknowns as one real vector; each complex array as its real parts, then its imaginary parts."""
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
