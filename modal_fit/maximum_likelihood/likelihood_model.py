"""The parametric response of stacked tests: modes, out-of-band terms and transients, with derivatives."""

from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, Real

from .whole_records import RecordSpectra


@dataclass(frozen=True)
class LikelihoodModel:
    """Unknowns of the fit, in the order in which they are packed into one real vector.

    Response of line k in test t, with D_k = s_k^derivative:
    ``D_k [sum_r right_r left_r^T / (s - p_r) + conjugate + out-of-band] F
    + D_k sum_r right_r transient_tr / (s - p_r) + smooth polynomial_t(s)``.

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Poles in the upper half plane.
    right : (n_modes, n_responses)
        Right vectors (mode shapes at the responses).
    left : (n_modes, n_excitations)
        Left vectors (participation of the excitations).
    outside : (n_terms, n_responses, n_excitations), real
        Coefficients of the out-of-band functions ``basis``.
    transient : (n_tests, n_modes), or (0, n_modes) where there is no leakage
        Free decay left by each record's start and end, in units of ``left`` times force.
    smooth : (n_tests, n_smooth, n_responses), or (0, n_smooth, n_responses)
        The same for all that lies outside the band: a polynomial over the scaled band.
    """

    poles: Complex
    right: Complex
    left: Complex
    outside: Real
    transient: Complex
    smooth: Complex

    def pack(self) -> Real:
        """All unknowns as one real vector; complex ones as all real parts, then all imaginary parts."""
        pieces = []
        for array in (self.poles, self.right, self.left):
            pieces += [array.real.ravel(), array.imag.ravel()]
        pieces.append(self.outside.ravel())
        for array in (self.transient, self.smooth):
            pieces += [array.real.ravel(), array.imag.ravel()]
        return np.concatenate(pieces)

    def unpack(self, packed: Real) -> "LikelihoodModel":
        """The model with the same shapes and the unknowns of ``packed``."""
        changes = {}
        start = 0
        for name in ("poles", "right", "left", "outside", "transient", "smooth"):
            shape = getattr(self, name).shape
            size = int(np.prod(shape))
            if name == "outside":
                changes[name] = packed[start : start + size].reshape(shape)
                start += size
            else:
                real, imaginary = packed[start : start + size], packed[start + size : start + 2 * size]
                changes[name] = (real + 1j * imaginary).reshape(shape)
                start += 2 * size
        return replace(self, **changes)


@dataclass(frozen=True)
class Setting:
    """The quantities that stay fixed during a fit: lines, out-of-band basis and scaled polynomial.

    Parameters
    ----------
    spectra
        Lines of all tests.
    basis : (n_terms, n_lines)
        Out-of-band functions of s, on receptance.
    powers : (n_smooth, n_lines)
        Polynomials over the band, scaled to -1 ... 1.
    """

    spectra: RecordSpectra
    basis: Complex
    powers: Real

    @property
    def differentiation(self) -> Complex:
        """s^derivative, shape (n_lines, n_responses)."""
        return np.asarray(self.spectra.s[:, None] ** self.spectra.derivative)


def transfer(model: LikelihoodModel, setting: Setting) -> Complex:
    """FRF of the measured quantity on every line, shape (n_lines, n_responses, n_excitations)."""
    s = setting.spectra.s
    direct = np.einsum("kr,rp,rq->kpq", 1 / (s[:, None] - model.poles), model.right, model.left, optimize=True)
    other = np.einsum(
        "kr,rp,rq->kpq", 1 / (s[:, None] - model.poles.conj()), model.right.conj(), model.left.conj(), optimize=True
    )
    outside = np.einsum("nk,npq->kpq", setting.basis, model.outside)
    return np.asarray(setting.differentiation[:, :, None] * (direct + other + outside))


def prediction(model: LikelihoodModel, setting: Setting, frf: Complex) -> Complex:
    """Response lines that the model gives for the measured excitation, shape (n_lines, n_responses)."""
    spectra = setting.spectra
    forced = np.einsum("kpq,kq->kp", frf, spectra.excitation)
    if not len(model.transient):
        return np.asarray(forced)
    decay = model.transient[spectra.test] / (spectra.s[:, None] - model.poles)
    polynomial = np.einsum("nk,knp->kp", setting.powers, model.smooth[spectra.test])
    return np.asarray(forced + setting.differentiation * (decay @ model.right) + polynomial)


def jacobian(model: LikelihoodModel, setting: Setting, excitation: Complex) -> Complex:
    """Derivative of the prediction by the packed unknowns, shape (n_lines, n_responses, n_unknowns).

    ``excitation`` (n_lines, n_excitations) is the force the derivative is taken at: the measured one, or the
    best estimate of the true one where forces are noisy.
    """
    spectra, s = setting.spectra, setting.spectra.s
    n_lines, n_responses = spectra.response.shape
    differentiation = setting.differentiation
    plus, minus = 1 / (s[:, None] - model.poles), 1 / (s[:, None] - model.poles.conj())
    drive = excitation @ model.left.T
    if len(model.transient):
        drive = drive + model.transient[spectra.test]
    mirror = excitation @ model.left.conj().T
    unit = np.eye(n_responses)

    def pair(direct: Complex, conjugate: Complex) -> list[Complex]:
        """Columns for real and imaginary parts of unknowns that enter with their conjugate."""
        scaled = [differentiation[:, :, None] * part.reshape(n_lines, n_responses, -1) for part in (direct, conjugate)]
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
    outside = np.einsum("nk,kq,pu->kpnuq", setting.basis, excitation, unit)
    columns.append(differentiation[:, :, None] * outside.reshape(n_lines, n_responses, -1))
    member = (spectra.test[:, None] == np.arange(len(model.transient))).astype(float)
    decay = np.einsum("kt,kr,rp->kptr", member, plus, model.right).reshape(n_lines, n_responses, -1)
    decay = differentiation[:, :, None] * decay
    smooth = np.einsum("kt,nk,pu->kptnu", member, setting.powers, unit).reshape(n_lines, n_responses, -1)
    columns += [decay, 1j * decay, smooth.astype(complex), 1j * smooth]
    return np.concatenate(columns, axis=-1)


def gauge_directions(model: LikelihoodModel) -> Real:
    """Directions that change no prediction, shape (n_unknowns, 2 n_modes), orthonormal.

    ``right_r`` may be multiplied by any complex number that ``left_r`` and the transients are divided by.
    """
    directions = []
    for r in range(len(model.poles)):
        for factor in (1.0, 1j):
            step = replace(
                model,
                poles=np.zeros_like(model.poles),
                right=np.zeros_like(model.right),
                left=np.zeros_like(model.left),
                outside=np.zeros_like(model.outside),
                transient=np.zeros_like(model.transient),
                smooth=np.zeros_like(model.smooth),
            )
            step.right[r] = factor * model.right[r]
            step.left[r] = -factor * model.left[r]
            step.transient[:, r] = -factor * model.transient[:, r]
            directions.append(step.pack())
    return np.asarray(np.linalg.qr(np.array(directions).T)[0])
