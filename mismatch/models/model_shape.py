"""The nominal model's numbers as deviations in units of what a lab's own fit may be off."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..inference import LabError
from .lines import modal_slopes, outside_slopes
from .outside_band import OutsideBand, outside_band

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


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
