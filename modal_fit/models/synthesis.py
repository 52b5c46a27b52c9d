"""What is derived from a model: synthesised FRFs, propagated errors, comparisons, modes as residual terms."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf
from millfrf.core import Band, Complex, InputError, Real, Result, Summary, counted, doubts_line, listed

from ..settings import SETTINGS
from ..shapes import modal_assurance
from .modal_model import ModalModel, modes_in_short
from .out_of_band import Residuals

if TYPE_CHECKING:
    from matplotlib.axes import Axes


NOT_CONVERGED = "the refinement stopped before it converged; treat the error bars as lower bounds"


class FittedModel(Result):
    """Base class of results that hold a modal model and warnings about it."""

    model: ModalModel
    warnings: tuple[str, ...]

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw the FRF of the model and return the axes; see `draw_model` for the choices."""
        return self.model.plot(axes, **choices)

    def _note(self) -> str:
        """Give one line on the quality of the model."""
        raise NotImplementedError

    def _summary(self) -> Summary:
        modes = modes_in_short(self.model.natural_frequencies, 100 * self.model.damping_ratios)
        table = self.model._summary()
        headline = f"{type(self).__name__}: {counted(len(modes), 'mode')}, {self.model.quantity} in {self.model.unit}"
        lines = (f"modes {listed(modes) or 'none'}", self._note(), *doubts_line(self.warnings))
        return Summary(headline, lines, table.columns, table.rows)


def fit_note(band: Band, chi_square: float) -> str:
    """Describe band (Hz) and reduced chi-square of a fit in one line."""
    quality = "not known" if np.isnan(chi_square) else f"{chi_square:.3g}"
    return f"fit of {band[0]:.4g} to {band[1]:.4g} Hz, reduced chi-square {quality}"


@dataclass(frozen=True)
class Synthesis:
    """Measured and synthesised FRFs on the same lines, in the measured quantity.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines that are compared.
    measured, synthesised : (n_lines, n_responses, n_excitations)
        FRFs of the measurement and of the model; the model's is NaN in entries that were not measured, or whose
        degrees of freedom it does not have.
    responses, excitations
        Degrees of freedom along the axes.
    misfit : (n_responses, n_excitations)
        Root mean square difference over the root mean square of the measured entry.
    correlation : (n_responses, n_excitations)
        Frequency response assurance criterion, ``|sum H conj(G)|^2 / (sum |H|^2 sum |G|^2)``: 1 where they differ by a
        factor only.
    """

    frequencies: Real
    measured: Complex
    synthesised: Complex
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    misfit: Real
    correlation: Real

    def ranked(self) -> tuple[tuple[int, int], ...]:
        """Return row and column of every entry that the model has, the largest misfit first."""
        order = np.argsort(-np.nan_to_num(self.misfit, nan=-1.0), axis=None, kind="stable")
        pairs = [np.unravel_index(int(flat), self.misfit.shape) for flat in order]
        return tuple((int(p), int(q)) for p, q in pairs if np.isfinite(self.misfit[p, q]))


def synthesis(frf: Frf, model: ModalModel, band: Band | None = None) -> Synthesis:
    """Evaluate a model on the lines of a measured FRF matrix, also under an exponential window.

    Parameters
    ----------
    frf
        Measured FRF; an accelerance or mobility is compared as such.
    model
        Modal model of receptance, or of a transfer in the FRF's unit.
    band : Hz
        Lowest and highest frequency; None: the model's, or all lines.

    Raises
    ------
    InputError
        A model of another unit, or no valid line in the band.
    """
    power = FRF_ORDERS.get(frf.quantity, 0) if model.quantity == "receptance" else 0
    if (model.quantity == "transfer") != (frf.quantity == "transfer") or (
        model.quantity == "transfer" and model.unit != frf.unit
    ):
        raise InputError(
            f"a model of {model.quantity} in {model.unit} cannot be compared with a {frf.quantity} in {frf.unit}; "
            "compare it with the FRF it was fitted to"
        )
    low, high = band or model.band or (0.0, np.inf)
    chosen = frf.valid & (frf.frequencies > 0) & (frf.frequencies >= low) & (frf.frequencies <= high)
    if not chosen.any():
        raise InputError(f"no valid line of the FRF lies between {low:g} and {high:g} Hz; choose another band")
    s, measured = frf.laplace[chosen], frf.values[chosen]
    synthesised = _aligned(s[:, None, None] ** power * model.at(s), model, frf)
    if frf.measured is not None:
        synthesised[:, ~frf.measured] = np.nan
    size = np.sum(np.abs(measured) ** 2, axis=0)
    model_size = np.sum(np.abs(synthesised) ** 2, axis=0)
    safe_size = np.where(size > 0, size, 1.0)  # an entry without signal has a misfit and correlation of 0
    product = np.abs(np.sum(measured * synthesised.conj(), axis=0)) ** 2
    return Synthesis(
        frf.frequencies[chosen],
        measured,
        synthesised,
        frf.responses,
        frf.excitations,
        np.sqrt(np.sum(np.abs(measured - synthesised) ** 2, axis=0) / safe_size),
        product / (safe_size * np.where(model_size > 0, model_size, 1.0)),
    )


def _aligned(values: Complex, model: ModalModel, frf: Frf) -> Complex:
    """Arrange values of the model in the order of the FRF's degrees of freedom; NaN where the model has none."""
    aligned = np.full((len(values), len(frf.responses), len(frf.excitations)), np.nan + 0j)
    rows = [(p, model.responses.index(dof)) for p, dof in enumerate(frf.responses) if dof in model.responses]
    columns = [(q, model.excitations.index(dof)) for q, dof in enumerate(frf.excitations) if dof in model.excitations]
    if rows and columns:
        (p, model_p), (q, model_q) = np.array(rows).T, np.array(columns).T
        aligned[:, p[:, None], q] = values[:, model_p[:, None], model_q]
    return aligned


def pack_parameters(model: ModalModel) -> Real:
    """Pack poles, right and left vectors into one real vector, in the order of ``ModalModel.covariance``."""
    arrays = (model.poles, model.right, model.left)
    return np.concatenate([part.ravel() for array in arrays for part in (array.real, array.imag)])


def unpack_parameters(model: ModalModel, packed: Real) -> ModalModel:
    """Return the model with the poles and vectors of ``packed``, the inverse of :func:`pack_parameters`."""
    changes: dict[str, Any] = {}
    start = 0
    for name in ("poles", "right", "left"):
        shape = getattr(model, name).shape
        size = int(np.prod(shape))
        changes[name] = (packed[start : start + size] + 1j * packed[start + size : start + 2 * size]).reshape(shape)
        start += 2 * size
    return replace(model, **changes)


def derived_covariance(model: ModalModel, derived: Callable[[ModalModel], Real]) -> Real | None:
    """Compute the covariance of any real vector derived from the model, ``J C J^T`` with J by central differences.

    Parameters
    ----------
    model
        Modal model with a covariance; without one the result is None.
    derived
        Function that takes a model and gives a real vector (n,).

    Returns
    -------
    (n, n) or None
    """
    if model.covariance is None:
        return None
    centre = pack_parameters(model)
    errors = np.sqrt(np.maximum(np.diag(model.covariance), 0.0))
    # a step must not turn a pole with a large error into one that grows, or into the other of its conjugate pair
    widest = np.full(len(centre), np.inf)
    widest[: 2 * len(model.poles)] = np.abs(centre[: 2 * len(model.poles)])
    columns = []
    for k in range(len(centre)):
        step = np.zeros_like(centre)
        # a tenth of the error keeps the function linear; the floors serve parameters without error
        step[k] = max(0.1 * min(errors[k], widest[k]), 1e-9 * abs(centre[k]), 1e-30)
        upper, lower = (derived(unpack_parameters(model, centre + sign * step)) for sign in (1, -1))
        columns.append((upper - lower) / (2 * step[k]))
    jacobian = np.column_stack(columns)
    return np.asarray(jacobian @ model.covariance @ jacobian.T)


@dataclass(frozen=True)
class ModePair:
    """One mode in two models.

    Parameters
    ----------
    first, second
        Index of the mode in the first and in the second model.
    frequency_change
        Natural frequency in the second model minus natural frequency in the first, Hz.
    frequency_error
        Standard error of the change, Hz; NaN where a model has no covariance.
    damping_change, damping_error
        Change of the damping ratio and its standard error.
    right_likeness, left_likeness
        Modal assurance criterion of the right and of the left vectors.
    """

    first: int
    second: int
    frequency_change: float
    frequency_error: float
    damping_change: float
    damping_error: float
    right_likeness: float
    left_likeness: float

    @property
    def significance(self) -> float:
        """Return the larger of the two changes over their standard errors."""
        changes = np.array([self.frequency_change, self.damping_change])
        return float(np.max(np.abs(changes) / np.array([self.frequency_error, self.damping_error])))

    @property
    def moved(self) -> bool:
        """Return whether frequency or damping moved by more than three standard errors of the change."""
        return self.significance > SETTINGS.significant_change


def compare_modes(first: ModalModel, second: ModalModel) -> tuple[ModePair, ...]:
    """Pair the modes of two models by their poles and compute their changes.

    Pairs minimise the summed distance ``|log(pole_2 / pole_1)|``; modes further apart than a tenth are not paired. The
    errors of the two fits are taken as independent.

    Parameters
    ----------
    first, second
        Models with the same responses and excitations, in the same order.

    Raises
    ------
    InputError
        Degrees of freedom that differ.

    Examples
    --------
    >>> import numpy as np
    >>> pole = 100 * (-0.02 + 1j)
    >>> first = ModalModel(np.array([pole]), np.ones((1, 1)), np.ones((1, 1)), ("TCP:+X",), ("TCP:+X",))
    >>> second = replace(first, poles=1.01 * first.poles)
    >>> [pair] = compare_modes(first, second)
    >>> round(pair.frequency_change, 3), pair.right_likeness
    (0.159, 1.0)
    """
    if (first.responses, first.excitations) != (second.responses, second.excitations):
        raise InputError(
            f"models of {', '.join(first.responses)} and of {', '.join(second.responses)} cannot be compared; "
            "give models of the same degrees of freedom"
        )
    distance = np.abs(np.log(first.poles)[:, None] - np.log(second.poles)[None, :])
    largest = SETTINGS.same_mode_distance
    # clipped, so that one pair that is far apart anyway does not pull the others to wrong partners
    rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(distance, 2 * largest))
    right, left = modal_assurance(first.right, second.right), modal_assurance(first.left, second.left)
    (f1, zeta1), (f2, zeta2) = ((m.natural_frequencies, m.damping_ratios) for m in (first, second))
    errors = [_errors(model) for model in (first, second)]
    pairs = []
    for i, j in zip(rows, columns, strict=True):
        if distance[i, j] <= largest:
            f_error, zeta_error = np.hypot(errors[0][:, i], errors[1][:, j])
            numbers = (f2[j] - f1[i], f_error, zeta2[j] - zeta1[i], zeta_error, right[i, j], left[i, j])
            pairs.append(ModePair(int(i), int(j), *map(float, numbers)))
    return tuple(pairs)


def _errors(model: ModalModel) -> Real:
    """Give standard errors of natural frequencies (Hz) and damping ratios, (2, n_modes); NaN where not known."""
    errors = model.standard_errors()
    return np.full((2, len(model.poles)), np.nan) if errors is None else np.stack(errors)


def outside_as_residuals(model: ModalModel, inside: NDArray[np.bool_]) -> ModalModel:
    """Move the modes for which ``inside`` (n_modes,) is false to the residuals of a model."""
    if inside.all():
        return model
    outer = ~inside
    covariance = model.covariance
    if covariance is not None:
        n_right, n_left = model.right.shape[1], model.left.shape[1]
        remaining = np.concatenate([np.repeat(inside, width) for width in (1, 1, n_right, n_right, n_left, n_left)])
        covariance = np.asarray(covariance[np.ix_(remaining, remaining)])
    none = np.zeros((len(model.responses), len(model.excitations)))
    residuals = model.residuals or Residuals(none, none)
    poles, residues = model.poles[outer], np.einsum("rp,rq->rpq", model.right[outer], model.left[outer])
    if residuals.poles is not None and residuals.residues is not None:
        poles, residues = np.concatenate([residuals.poles, poles]), np.concatenate([residuals.residues, residues])
    return replace(
        model,
        poles=model.poles[inside],
        right=model.right[inside],
        left=model.left[inside],
        residuals=replace(residuals, poles=poles, residues=residues),
        covariance=covariance,
        errors=None if model.errors is None else model.errors.ordered(np.flatnonzero(inside)),
    )


def with_outer_as_residuals(model: ModalModel) -> ModalModel:
    """Move the modes outside the band of a model to its residuals."""
    assert model.band is not None
    frequencies = model.natural_frequencies
    return outside_as_residuals(model, (frequencies > model.band[0]) & (frequencies < model.band[1]))
