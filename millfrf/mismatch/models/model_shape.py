"""Parameters of a nominal model in units of the laboratory uncertainty, and modes outside its band."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from modal_fit import ModalModel, Residuals

from ..inference.settings import LabError
from .modal_lines import modal_slopes, outside_slopes

TERMS = 3  # flexibility of the modes above, its curvature, inertia of the modes below

# mode that gives the curvature: frequency over the upper end of the band, and damping ratio; both have little effect
FAR_MODE, FAR_DAMPING = 2.0, 0.05

FACTOR_STEPS = 20  # steps to the factor between the vectors of a mode, which converge linearly

POINTS = 128  # frequencies in the band at which the terms are scaled


@dataclass(frozen=True)
class OutsideBand:
    """Receptance terms ``sum_k c_k[p, q] b_k(s)`` for modes outside the band.

    A coefficient c_k of 1 makes the term as large as the effect of a laboratory error of the shapes.
    """

    units: Real  # size of each term in the band that counts as a unit, (TERMS, n_responses, n_excitations), m/N
    scale: Real  # root mean square of each basis over the band, (TERMS,)
    pole: complex  # pole of the mode that gives the curvature, rad/s
    lowest: float  # angular frequency below which the inertia of lower modes is left out, rad/s

    @property
    def size(self) -> int:
        """Number of all coefficients of the terms."""
        return int(self.units.size)

    def basis(self, s: Complex) -> Complex:
        """Return the three functions b_k at ``s`` (n,), rad/s, each of size about 1 in the band, (TERMS, n)."""
        return _basis(s, self.pole, self.lowest) / self.scale[:, None]

    def added(self, residuals: Residuals | None, numbers: Real) -> Residuals:
        """Return residual terms to which the terms with the coefficients ``numbers`` (size,) are added."""
        upper, bend, lower = numbers.reshape(self.units.shape) * self.units / self.scale[:, None, None]
        if residuals is not None:
            upper, lower = residuals.upper + upper, residuals.lower + lower
        poles, residues = np.array([self.pole]), (bend * _residue(self.pole))[None]
        if residuals is not None and residuals.poles is not None and residuals.residues is not None:
            poles = np.append(residuals.poles, poles)
            residues = np.concatenate([residuals.residues, residues])
        return Residuals(upper, lower, poles, residues)


def outside_band(model: ModalModel, share: float) -> OutsideBand | None:
    """Return the terms outside the band of a model; None if the model states no band."""
    if model.band is None:
        return None
    frequencies = np.linspace(max(model.band[0], 0.02 * model.band[1]), model.band[1], POINTS)
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    size = np.sqrt(np.mean(np.abs(model.receptance(frequencies)) ** 2, axis=0))
    omega = 2 * np.pi * FAR_MODE * model.band[1]
    pole = complex(omega * (-FAR_DAMPING + 1j * np.sqrt(1 - FAR_DAMPING**2)))
    lowest = 2 * np.pi * float(model.natural_frequencies.min()) / 3
    scale = np.sqrt(np.mean(np.abs(_basis(s, pole, lowest)) ** 2, axis=1))
    return OutsideBand(np.tile(share * size, (TERMS, 1, 1)), scale, pole, lowest)


def _residue(pole: complex) -> complex:
    """Return the residue of the mode ``|pole|^2 / (s^2 + 2 zeta |pole| s + |pole|^2)``."""
    return abs(pole) ** 2 / (2j * pole.imag)


def _basis(s: Complex, pole: complex, lowest: float) -> Complex:
    residue = _residue(pole)
    mode = residue / (s - pole) + np.conj(residue) / (s - np.conj(pole))
    lower = np.divide(1.0, s**2, out=np.zeros_like(s), where=np.abs(s) >= lowest)
    return np.array([np.ones_like(s), mode, lower])


@dataclass(frozen=True)
class ModelShape:
    """Parameters u of a modal model, all zero at the nominal one, in units of :class:`LabError`.

    Order, mode by mode: ln frequency, ln damping ratio, Re right, Im right, Re left, Im left. If the nominal model
    states its band, the numbers of the modes outside it follow (``OutsideBand``).

    Parameters
    ----------
    nominal
        Nominal model, followed by added modes.
    lab
        Laboratory error of one unit.
    added
        Number of added modes at the end, which have no prior.
    """

    nominal: ModalModel
    lab: LabError
    added: int = 0

    @property
    def prior_precision(self) -> Real:
        """Precision of the prior that u is zero, (size,): 1, and nearly 0 for added modes."""
        precision = np.ones(self.size)
        if self.added:
            precision[self.modal_size - self.added * self.per_mode : self.modal_size] = 1e-4
        return precision

    @cached_property
    def outside(self) -> OutsideBand | None:
        """Terms for modes outside the band of the nominal model; None if it states none."""
        return outside_band(_modes_of(self.nominal, np.arange(self.nominal_modes)), self.lab.shape)

    @property
    def nominal_modes(self) -> int:
        """Number of modes of the nominal model, which have a prior."""
        return len(self.nominal.poles) - self.added

    @property
    def bare(self) -> "ModelShape":
        """The parameters of the model without added modes."""
        return ModelShape(_modes_of(self.nominal, np.arange(self.nominal_modes)), self.lab)

    def without_mode(self, place: int, u: Real) -> tuple["ModelShape", Real]:
        """Return the parameters and u (size,) without one of the added modes, ``place`` from 0."""
        removed = self.nominal_modes + place
        others = np.delete(np.arange(len(self.nominal.poles)), removed)
        own = np.delete(self.modal_rows(u), removed, axis=0).ravel()
        shape = ModelShape(_modes_of(self.nominal, others), self.lab, self.added - 1)
        return shape, np.concatenate([own, u[self.modal_size :]])

    @property
    def modal_size(self) -> int:
        """Number of parameters of the modes."""
        return int(self.per_mode * len(self.nominal.poles))

    def modal_rows(self, values: Real) -> Real:
        """Return those entries of ``values`` (size,) that belong to the modes, one row for each mode."""
        return values[: self.modal_size].reshape(-1, self.per_mode)

    def deviations(self, u: Real) -> Real:
        """Return the numbers of the nominal modes with the factor between their vectors that is nearest to nominal.

        The residues ``psi l^T`` do not change if psi is multiplied by a complex factor z and l divided by it. The
        factor of each mode that makes ``|u|^2`` least is found by Gauss-Newton steps for ln z.

        Parameters
        ----------
        u : (size,)
            Deviation from the nominal model in lab errors.

        Returns
        -------
        (nominal_modes, per_mode)
            Numbers of each mode in lab errors.
        """
        rows = self.modal_rows(u)[: self.nominal_modes].copy()
        n, m = self.nominal.right.shape[1], self.nominal.left.shape[1]
        sides = zip((self.nominal.right, self.nominal.left), self.scales(), strict=True)
        nominal = [(vectors / unit[:, None])[: self.nominal_modes] for vectors, unit in sides]
        right = nominal[0] + rows[:, 2 : 2 + n] + 1j * rows[:, 2 + n : 2 + 2 * n]
        left = nominal[1] + rows[:, 2 + 2 * n : 2 + 2 * n + m] + 1j * rows[:, 2 + 2 * n + m :]
        sizes = (np.abs(right) ** 2).sum(axis=1) + (np.abs(left) ** 2).sum(axis=1)
        for _ in range(FACTOR_STEPS):
            change = np.sum(right.conj() * (nominal[0] - right), axis=1)
            change -= np.sum(left.conj() * (nominal[1] - left), axis=1)
            factor = np.exp(change / sizes)[:, None]
            right, left = right * factor, left / factor
        right, left = right - nominal[0], left - nominal[1]
        rows[:, 2:] = np.hstack([right.real, right.imag, left.real, left.imag])
        return rows

    def with_mode(self, pole: complex, right: Complex, left: Complex) -> "ModelShape":
        """Return the parameters of the model with one more mode at the end."""
        model = replace(
            self.nominal,
            poles=np.append(self.nominal.poles, pole),
            right=np.vstack([self.nominal.right, right]),
            left=np.vstack([self.nominal.left, left]),
            covariance=None,
            errors=None,
        )
        return ModelShape(model, self.lab, self.added + 1)

    @property
    def per_mode(self) -> int:
        """Number of parameters of each mode."""
        return 2 + 2 * int(self.nominal.right.shape[1] + self.nominal.left.shape[1])

    @property
    def size(self) -> int:
        """Number of all parameters, with those for modes outside the band."""
        return self.modal_size + (self.outside.size if self.outside is not None else 0)

    def scales(self) -> tuple[Real, Real]:
        """Return the unit of a right and of a left entry, each (n_modes,)."""
        right, left = (np.sqrt(np.mean(np.abs(v) ** 2, axis=1)) for v in (self.nominal.right, self.nominal.left))
        return self.lab.shape * right, self.lab.shape * left

    def model(self, u: Real) -> ModalModel:
        """Return the modal model at ``u``, (size,)."""
        rows = self.modal_rows(u)
        omega = np.abs(self.nominal.poles) * np.exp(self.lab.frequency * rows[:, 0])
        damping = np.clip(self.nominal.damping_ratios * np.exp(self.lab.damping * rows[:, 1]), 1e-5, 0.95)
        poles = omega * (-damping + 1j * np.sqrt(1 - damping**2))
        n, m = self.nominal.right.shape[1], self.nominal.left.shape[1]
        right_unit, left_unit = self.scales()
        right = self.nominal.right + right_unit[:, None] * (rows[:, 2 : 2 + n] + 1j * rows[:, 2 + n : 2 + 2 * n])
        left_rows = rows[:, 2 + 2 * n :]
        left = self.nominal.left + left_unit[:, None] * (left_rows[:, :m] + 1j * left_rows[:, m:])
        residuals = self.nominal.residuals
        if self.outside is not None and u[self.modal_size :].any():
            residuals = self.outside.added(residuals, u[self.modal_size :])
        return replace(
            self.nominal, poles=poles, right=right, left=left, residuals=residuals, covariance=None, errors=None
        )

    def jacobian(self, u: Real, frequencies: Real, force: Complex) -> Complex:
        """Return the derivative of the displacement lines by u, (n_lines, n_responses, size).

        Parameters
        ----------
        u : (size,)
            Deviation at which the derivative is taken, in lab errors.
        frequencies : (n_lines,), Hz
            Frequencies of the lines.
        force : (n_lines, n_excitations), N
            Force spectrum at the lines.
        """
        n = self.nominal.right.shape[1]
        parts = np.empty((2, len(frequencies), n, self.size))
        identity = np.tile(np.eye(n, dtype=complex), (len(frequencies), 1, 1))
        self.write_slopes(self.model(u), frequencies, force, identity, parts)
        return np.asarray(parts[0] + 1j * parts[1])

    def write_slopes(self, model: ModalModel, frequencies: Real, force: Complex, factor: Complex, out: Real) -> None:
        """Write the derivative of ``M (H F)`` by u into the first columns of ``out``.

        Parameters
        ----------
        frequencies : (n_lines,), Hz
            Frequencies of the lines.
        force : (n_lines, n_excitations), N
            Force spectrum at the lines, on all excitations of that model.
        factor : (n_lines, n_rows, n_responses)
            Matrix M that the displacement at each line is multiplied by.
        out : (2, n_lines, n_rows, size or more)
            Receives real and imaginary parts.
        """
        s = np.asarray(2j * np.pi * frequencies, dtype=complex)
        force, factor = np.ascontiguousarray(force), np.ascontiguousarray(factor)
        n, m = self.nominal.right.shape[1], self.nominal.left.shape[1]
        modes = (model.poles, np.ascontiguousarray(model.right[:, :n]), model.left)
        modal_slopes(s, force, modes, (*self.pole_units(model), *self.scales()), factor, m, out)
        if self.outside is not None:
            own = np.ascontiguousarray(force[:, :m])
            outside_slopes(self.outside.basis(s), self.outside.units, own, factor, out, self.modal_size)

    def pole_units(self, model: ModalModel) -> tuple[Complex, Complex]:
        """Return the change of each pole by a unit of ln frequency and of ln damping ratio, each (n_modes,)."""
        poles = model.poles
        zeta = -poles.real / np.abs(poles)
        along = np.abs(poles) * zeta * self.lab.damping * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))
        return poles * self.lab.frequency, along


def _modes_of(model: ModalModel, chosen: NDArray[np.int64]) -> ModalModel:
    """Return a model with some of its modes."""
    return replace(
        model,
        poles=model.poles[chosen],
        right=model.right[chosen],
        left=model.left[chosen],
        covariance=None,
        errors=None,
    )
