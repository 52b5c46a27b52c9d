"""What a tap test shows at the tip where the cut excited nothing: modes, and the flexibility beyond its own band."""

from dataclasses import dataclass, replace

import numpy as np

from estimation import Frf
from millfrf.core import Band, Complex, Real

from ..frf_fit.measured_lines import entry_noise
from ..models.modal_model import ModalModel
from ..models.out_of_band import Residuals, fixed_poles, out_of_band_basis, residuals_from
from ..models.synthesis import derived_covariance, pack_parameters
from ..settings import SETTINGS
from .mode_sets import parameter_places
from .rest_and_cut import RestAndCut


def at_tip(hammer: ModalModel, responses: tuple[str, ...]) -> ModalModel:
    """Return the hammer modes with motion at the tip only, whose rows are the first, and without residuals."""
    n, covariance = len(responses), hammer.covariance
    if covariance is not None:
        modes, p, q = len(hammer.poles), hammer.right.shape[1], hammer.left.shape[1]
        rows = np.tile(np.arange(p) < n, modes)
        kept = np.concatenate([np.ones(2 * modes, dtype=bool), rows, rows, np.ones(2 * modes * q, dtype=bool)])
        covariance = covariance[np.ix_(kept, kept)]
    return replace(
        hammer, right=hammer.right[:, :n], responses=responses, residuals=None, covariance=covariance, errors=None
    )


def in_the_cut(tapped: ModalModel, change: RestAndCut) -> ModalModel:
    """Return tapped modes as they are expected in the cut, with the errors of the change in their covariance.

    Poles change with frequency and damping; the right vectors carry the change of the residues.
    """
    covariance = derived_covariance(tapped, lambda m: pack_parameters(_changed(m, change)))
    changed = _changed(tapped, change)
    if covariance is None:
        return replace(changed, errors=None)
    return replace(changed, covariance=covariance + _change_covariance(tapped, change), errors=None)


def _changed(tapped: ModalModel, change: RestAndCut) -> ModalModel:
    factors = change.residue_factors(tapped.poles)
    return replace(tapped, poles=change.poles(tapped.poles), right=tapped.right * factors[:, None])


def _change_covariance(tapped: ModalModel, change: RestAndCut) -> Real:
    """Return the covariance by the errors of the change: one shared by all modes, and a scatter of each."""
    n, changed = len(tapped.poles), _changed(tapped, change)
    centre = pack_parameters(changed)
    total = np.zeros((len(centre),) * 2)
    for name in ("frequency", "damping", "residue"):
        part = getattr(change, name)
        more = replace(change, **{name: replace(part, mean=part.mean + SETTINGS.slope_step)})
        slope = (pack_parameters(_changed(tapped, more)) - centre) / SETTINGS.slope_step
        total += part.error**2 * np.outer(slope, slope)
        for mode in range(n):
            own = np.zeros_like(slope)
            places = parameter_places(tapped, np.array([mode]))
            own[places] = slope[places]
            total += part.scatter**2 * np.outer(own, own)
    return total


def static_flexibility(modes: ModalModel) -> float:
    """Return the largest singular value of the modes' static flexibility plus two standard errors of its size, m/N."""
    if not len(modes.poles):
        return 0.0

    def static(m: ModalModel) -> Real:
        return np.asarray(-2 * np.real((m.right / m.poles[:, None]).T @ m.left))

    covariance = derived_covariance(modes, lambda m: static(m).ravel())
    error = 0.0 if covariance is None else float(np.sqrt(np.trace(covariance)))
    return float(np.linalg.norm(static(modes), 2)) + 2 * error


@dataclass(frozen=True)
class BeyondTaps:
    """Contribution of modes outside the band of the tap test, and a bound of the static flexibility of those above.

    Parameters
    ----------
    residuals
        Residual flexibility and residual inertia where one is significant in an entry; None: neither is.
    flexibility_bound : m/N
        Largest singular value of the residual flexibility plus two standard errors of its size.
    """

    residuals: Residuals | None
    flexibility_bound: float


def beyond_taps(tip: Frf, modes: ModalModel, band: Band) -> BeyondTaps:
    """Fit what the modes leave of a receptance at the tip, by weighted least squares.

    Modes well above the band act in it by their static flexibility ``U = sum phi phi^T / w^2`` (Ewins, Modal Testing,
    2nd ed., section 4.5), which is all that the band shows of them: their sum bounds each of them. It is fitted as
    ``U + L / s^2``. As the receptance of these modes grows towards their resonance, a mean over the band is never below
    the static value. The standard error contains the noise of the lines, the misfit where that is larger, and the
    errors of the modes; ``|U + E| <= |U| + |E|``, with the Frobenius norm of the errors for the second term.

    The residuals have fixed poles above the band as well, where the misfit without them is larger.

    Parameters
    ----------
    tip
        Receptance at the tip, with the degrees of freedom of ``modes``.
    modes
        Modes fitted to it, at rest, without residuals.
    band : Hz
        Band of that fit.
    """
    chosen = tip.valid & (tip.frequencies >= band[0]) & (tip.frequencies <= band[1])
    lines = _Lines(tip.laplace[chosen], tip.values[chosen], entry_noise(tip, chosen))
    plain = lines.least_squares(out_of_band_basis(lines.s, band, []))
    result, variance, misfit = plain.solved(modes)
    by_modes = derived_covariance(modes, lambda m: plain.coefficients(m).ravel())
    if by_modes is not None:
        variance = variance + np.diag(by_modes).reshape(variance.shape)
    bound = np.linalg.norm(result[0], 2) + 2 * np.sqrt(variance[0].sum())
    needed = np.any(np.abs(result) > SETTINGS.significant_change * np.sqrt(variance), axis=(1, 2))
    poles = fixed_poles(band, below=())
    kept = np.array([True, needed[1], *[True] * (2 * len(poles))])
    curved, _, least = lines.least_squares(out_of_band_basis(lines.s, band, poles)[kept]).solved(modes)
    if misfit > SETTINGS.terms_misfit**2 * least:
        coefficients = np.zeros((len(kept), *curved.shape[1:]))
        coefficients[kept] = curved
        return BeyondTaps(residuals_from(coefficients, band, poles), float(bound))
    residuals = residuals_from(result * needed[:, None, None], band, []) if needed.any() else None
    return BeyondTaps(residuals, float(bound))


@dataclass(frozen=True)
class _Lines:
    """Lines of a receptance: ``s`` (n,), rad/s, values and noise variances (n, n_responses, n_excitations)."""

    s: Complex
    values: Complex
    noise: Real

    def least_squares(self, basis: Complex) -> "_LeastSquares":
        """Prepare fits of the values without some modes by real multiples of the basis (n_terms, n)."""
        terms = _stacked(basis.T)
        solutions, variances = [], []
        for variance in self.noise.reshape(len(self.s), -1).T:
            weights = np.tile(2 / variance, 2)  # half of the variance in the real part, half in the imaginary part
            inverse = np.linalg.pinv(terms.T @ (weights[:, None] * terms), rcond=1e-14, hermitian=True)
            solutions.append(inverse @ (terms.T * weights))
            variances.append(np.diag(inverse))
        return _LeastSquares(self, basis, np.array(solutions), np.array(variances).T)


@dataclass(frozen=True)
class _LeastSquares:
    """Weighted least squares of each entry: solutions (n_entries, n_terms, 2 n), variances (n_terms, n_entries)."""

    lines: _Lines
    basis: Complex
    solutions: Real
    variances: Real

    def coefficients(self, modes: ModalModel) -> Real:
        """Return the coefficients (n_terms, n_responses, n_excitations) of what the modes leave."""
        rest = _stacked(self.lines.values - modes.at(self.lines.s)).reshape(self.solutions.shape[2], -1)
        coefficients = np.matmul(self.solutions, rest.T[:, :, None])[:, :, 0].T
        return np.asarray(coefficients.reshape(len(self.basis), *self.lines.values.shape[1:]))

    def solved(self, modes: ModalModel) -> tuple[Real, Real, float]:
        """Return the coefficients, their variances of the same shape, and the mean squared misfit over the noise."""
        coefficients = self.coefficients(modes)
        rest = self.lines.values - modes.at(self.lines.s) - np.tensordot(self.basis.T, coefficients, axes=1)
        misfit = np.mean(np.abs(rest) ** 2 / self.lines.noise, axis=0)
        return coefficients, self.variances.reshape(coefficients.shape) * np.maximum(misfit, 1.0), float(misfit.mean())


def _stacked(values: Complex) -> Real:
    return np.concatenate([values.real, values.imag])
