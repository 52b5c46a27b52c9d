"""The parametric response of stacked tests: modes, out-of-band terms and transients, with derivatives."""

from dataclasses import dataclass, fields, replace

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


@dataclass(frozen=True)
class LikelihoodProblem:
    """The quantities that stay fixed during a fit: lines, out-of-band basis and polynomials over the band."""

    spectra: RecordSpectra
    basis: Complex  # (n_terms, n_lines): out-of-band functions of s, on receptance
    powers: Real  # (n_smooth, n_lines): polynomials over the band, scaled to -1 ... 1

    @property
    def differentiation(self) -> Complex:
        """Return s^derivative, shape (n_lines, n_responses)."""
        return np.asarray(self.spectra.s[:, None] ** self.spectra.derivative)


def transfer(model: LikelihoodModel, problem: LikelihoodProblem) -> Complex:
    """Return the FRF of the measured quantity on every line, shape (n_lines, n_responses, n_excitations)."""
    s = problem.spectra.s[:, None]
    poles, right, left = model.poles, model.right, model.left
    direct = np.einsum("kr,rp,rq->kpq", 1 / (s - poles), right, left, optimize=True)
    conjugate = np.einsum("kr,rp,rq->kpq", 1 / (s - poles.conj()), right.conj(), left.conj(), optimize=True)
    out_of_band = np.einsum("nk,npq->kpq", problem.basis, model.out_of_band)
    return np.asarray(problem.differentiation[:, :, None] * (direct + conjugate + out_of_band))


def prediction(model: LikelihoodModel, problem: LikelihoodProblem, frf: Complex) -> Complex:
    """Return the response lines of the model for the measured excitation, shape (n_lines, n_responses)."""
    spectra = problem.spectra
    forced = np.einsum("kpq,kq->kp", frf, spectra.excitation)
    decay = model.transient[spectra.test] / (spectra.s[:, None] - model.poles)
    polynomial = np.einsum("nk,knp->kp", problem.powers, model.smooth[spectra.test])
    return np.asarray(forced + problem.differentiation * (decay @ model.right) + polynomial)


def jacobian(model: LikelihoodModel, problem: LikelihoodProblem, excitation: Complex) -> Complex:
    """Return the derivatives of the prediction by the packed unknowns, shape (n_lines, n_responses, n_unknowns).

    ``excitation`` (n_lines, n_excitations) is the force at which the derivative is taken: the measured force,
    or where forces are noisy the best estimate of the true force.
    """
    spectra, s = problem.spectra, problem.spectra.s
    n_lines, n_responses = spectra.response.shape
    differentiation = problem.differentiation
    plus, minus = 1 / (s[:, None] - model.poles), 1 / (s[:, None] - model.poles.conj())
    drive = excitation @ model.left.T + model.transient[spectra.test]
    mirror = excitation @ model.left.conj().T
    unit = np.eye(n_responses)

    def pair(direct: Complex, conjugate: Complex) -> list[Complex]:
        """Return the columns for real and imaginary parts of unknowns that enter with their conjugate."""
        scaled = [differentiation[:, :, None] * term.reshape(n_lines, n_responses, -1) for term in (direct, conjugate)]
        return [scaled[0] + scaled[1], 1j * (scaled[0] - scaled[1])]

    columns = pair(
        np.einsum("kr,rp->kpr", plus**2 * drive, model.right),
        np.einsum("kr,rp->kpr", minus**2 * mirror, model.right.conj()),
    )
    columns += pair(
        np.einsum("kr,pu->kpru", plus * drive, unit).astype(complex),
        np.einsum("kr,pu->kpru", minus * mirror, unit).astype(complex),
    )
    columns += pair(
        np.einsum("kr,kq,rp->kprq", plus, excitation, model.right),
        np.einsum("kr,kq,rp->kprq", minus, excitation, model.right.conj()),
    )
    out_of_band = np.einsum("nk,kq,pu->kpnuq", problem.basis, excitation, unit)
    columns.append(differentiation[:, :, None] * out_of_band.reshape(n_lines, n_responses, -1))
    member = (spectra.test[:, None] == np.arange(len(model.transient))).astype(float)
    decay = np.einsum("kt,kr,rp->kptr", member, plus, model.right).reshape(n_lines, n_responses, -1)
    decay = differentiation[:, :, None] * decay
    smooth = np.einsum("kt,nk,pu->kptnu", member, problem.powers, unit).reshape(n_lines, n_responses, -1)
    columns += [decay, 1j * decay, smooth.astype(complex), 1j * smooth]
    return np.concatenate(columns, axis=-1)


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
