"""Parameters of a nominal model in units of a laboratory's uncertainty, and modes outside its band."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from modal_fit import ModalModel, Residuals

from ..inference.settings import LabError
from .modal_loops import modal_slopes, outside_slopes

TERMS = 3
"""Flexibility of the modes above, its curvature, inertia of the modes below."""

FAR, DAMPING = 2.0, 0.05
"""Frequency of the mode whose curvature is taken, over the band's upper end, and its damping; both matter little."""

POINTS = 128
"""Number of points in the band at which the size of the terms is set."""


@dataclass(frozen=True)
class OutsideBand:
    """Terms on receptance, ``sum_k c_k[p, q] b_k(s)``, each c_k one unit where it is as large as a shape error.

    Parameters
    ----------
    units : (TERMS, n_responses, n_excitations), m/N
        Size of each term in the band that counts as one unit.
    scale : (TERMS,)
        Root mean square of each basis over the band.
    pole
        Pole of the mode that gives the curvature, rad/s.
    lowest
        Angular frequency below which the inertia of lower modes says nothing and is left out, rad/s.
    """

    units: Real
    scale: Real
    pole: complex
    lowest: float

    @property
    def size(self) -> int:
        """Number of all coefficients of the terms."""
        return int(self.units.size)

    def basis(self, s: Complex) -> Complex:
        """The three functions at ``s`` (n,), rad/s, each about one in the band, (TERMS, n)."""
        return _basis(s, self.pole, self.lowest) / self.scale[:, None]

    def added(self, residuals: Residuals | None, numbers: Real) -> Residuals:
        """A model's residual terms with these numbers (size,) on top."""
        upper, bend, lower = numbers.reshape(self.units.shape) * self.units / self.scale[:, None, None]
        if residuals is not None:
            upper, lower = residuals.upper + upper, residuals.lower + lower
        poles, residues = np.array([self.pole]), (bend * _residue(self.pole))[None]
        if residuals is not None and residuals.poles is not None and residuals.residues is not None:
            poles = np.append(residuals.poles, poles)
            residues = np.concatenate([residuals.residues, residues])
        return Residuals(upper, lower, poles, residues)


def outside_band(model: ModalModel, share: float) -> OutsideBand | None:
    """Terms for a model that states its band; None for one that does not, which is compared with all its reach.

    Parameters
    ----------
    model
        The model as the lab believes it.
    share
        Share of the receptance's root mean square over the band that counts as one unit: the lab's error of shapes.
    """
    if model.band is None:
        return None
    frequencies = np.linspace(max(model.band[0], 0.02 * model.band[1]), model.band[1], POINTS)
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    size = np.sqrt(np.mean(np.abs(model.receptance(frequencies)) ** 2, axis=0))
    omega = 2 * np.pi * FAR * model.band[1]
    pole = complex(omega * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2)))
    lowest = 2 * np.pi * float(model.natural_frequencies.min()) / 3
    scale = np.sqrt(np.mean(np.abs(_basis(s, pole, lowest)) ** 2, axis=1))
    return OutsideBand(np.tile(share * size, (TERMS, 1, 1)), scale, pole, lowest)


def _residue(pole: complex) -> complex:
    """Residue of the mode ``|pole|^2 / (s^2 + 2 zeta |pole| s + |pole|^2)``."""
    return abs(pole) ** 2 / (2j * pole.imag)


def _basis(s: Complex, pole: complex, lowest: float) -> Complex:
    residue = _residue(pole)
    mode = residue / (s - pole) + np.conj(residue) / (s - np.conj(pole))
    lower = np.divide(1.0, s**2, out=np.zeros_like(s), where=np.abs(s) >= lowest)
    return np.array([np.ones_like(s), mode, lower])


@dataclass(frozen=True)
class ModelShape:
    """Parameters u of a modal model, all zero at the nominal one, in units of :class:`LabError`.

    Order, mode by mode: ln frequency, ln damping ratio, Re right, Im right, Re left, Im left. Behind them, where the
    nominal model states its band, what modes outside it leave inside (``OutsideBand``).

    Parameters
    ----------
    nominal
        The model that is believed, with added modes behind its own.
    lab
        Error of a lab's fit that one unit stands for.
    added
        Number of modes at the end that the believed model did not have: nothing is believed about them.
    """

    nominal: ModalModel
    lab: LabError
    added: int = 0

    @property
    def belief(self) -> Real:
        """Precision of the belief that u is zero, (size,): 1, and all but nothing for added modes."""
        precision = np.ones(self.size)
        if self.added:
            precision[self.modal_size - self.added * self.per_mode : self.modal_size] = 1e-4
        return precision

    @cached_property
    def outside(self) -> OutsideBand | None:
        """Terms for modes outside the nominal model's band; None where it states none."""
        return outside_band(_modes_of(self.nominal, np.arange(self.believed)), self.lab.shape)

    @property
    def believed(self) -> int:
        """Number of modes that the nominal model has."""
        return len(self.nominal.poles) - self.added

    @property
    def bare(self) -> "ModelShape":
        """The parameters of the model without added modes."""
        return ModelShape(_modes_of(self.nominal, np.arange(self.believed)), self.lab)

    def without_mode(self, place: int, u: Real) -> tuple["ModelShape", Real]:
        """The parameters without one of the added modes, and u (size,) without that mode's numbers.

        ``place`` counts added modes from 0, in the order in which they were added.
        """
        gone = self.believed + place
        kept = np.delete(np.arange(len(self.nominal.poles)), gone)
        own = np.delete(self.modal_rows(u), gone, axis=0).ravel()
        shape = ModelShape(_modes_of(self.nominal, kept), self.lab, self.added - 1)
        return shape, np.concatenate([own, u[self.modal_size :]])

    @property
    def modal_size(self) -> int:
        """Number of parameters that belong to the modes."""
        return int(self.per_mode * len(self.nominal.poles))

    def modal_rows(self, values: Real) -> Real:
        """The entries of ``values`` (size,) that belong to the modes, (n_modes, per_mode)."""
        return values[: self.modal_size].reshape(-1, self.per_mode)

    def with_mode(self, pole: complex, right: Complex, left: Complex) -> "ModelShape":
        """The parameters of the model with one more mode at the end."""
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
        """Number of parameters that each mode has."""
        return 2 + 2 * int(self.nominal.right.shape[1] + self.nominal.left.shape[1])

    @property
    def size(self) -> int:
        """Number of all parameters, those for modes outside the band included."""
        return self.modal_size + (self.outside.size if self.outside is not None else 0)

    def scales(self) -> tuple[Real, Real]:
        """Unit of a right and of a left entry, each (n_modes,)."""
        right, left = (np.sqrt(np.mean(np.abs(v) ** 2, axis=1)) for v in (self.nominal.right, self.nominal.left))
        return self.lab.shape * right, self.lab.shape * left

    def model(self, u: Real) -> ModalModel:
        """The modal model at ``u``, (size,)."""
        rows = self.modal_rows(u)
        omega = np.abs(self.nominal.poles) * np.exp(self.lab.frequency * rows[:, 0])
        damping = np.clip(self.nominal.damping_ratios * np.exp(self.lab.damping * rows[:, 1]), 1e-5, 0.95)
        poles = omega * (-damping + 1j * np.sqrt(1 - damping**2))
        n, m = self.nominal.right.shape[1], self.nominal.left.shape[1]
        right_unit, left_unit = self.scales()
        right = self.nominal.right + right_unit[:, None] * (rows[:, 2 : 2 + n] + 1j * rows[:, 2 + n : 2 + 2 * n])
        rest = rows[:, 2 + 2 * n :]
        left = self.nominal.left + left_unit[:, None] * (rest[:, :m] + 1j * rest[:, m:])
        residuals = self.nominal.residuals
        if self.outside is not None and u[self.modal_size :].any():
            residuals = self.outside.added(residuals, u[self.modal_size :])
        return replace(
            self.nominal, poles=poles, right=right, left=left, residuals=residuals, covariance=None, errors=None
        )

    def jacobian(self, u: Real, frequencies: Real, force: Complex) -> Complex:
        """Derivative of the displacement lines by u for force lines, (n_lines, n_responses, size).

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
        """Write the derivative of ``M (H F)`` by u: the numbers that are fitted come first in a line's columns.

        Parameters
        ----------
        model
            The modal model at which the derivative is taken, or one widened by joints: what they reach is not fitted.
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
        """Change of each pole of the model by a unit of ln frequency and of ln damping ratio, each (n_modes,)."""
        poles = model.poles
        zeta = -poles.real / np.abs(poles)
        along = np.abs(poles) * zeta * self.lab.damping * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))
        return poles * self.lab.frequency, along


def _modes_of(model: ModalModel, chosen: NDArray[np.int64]) -> ModalModel:
    """A model with some of its modes."""
    return replace(
        model,
        poles=model.poles[chosen],
        right=model.right[chosen],
        left=model.left[chosen],
        covariance=None,
        errors=None,
    )
