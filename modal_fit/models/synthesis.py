"""Quantities derived from a model: synthesised FRFs, propagated errors, comparison of two models."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf
from millfrf.core import Band, InputError, Real, Summary, counted, doubts_line, listed

from ..shapes import modal_assurance
from .modal_model import ModalModel, modes_in_short


@dataclass(frozen=True)
class Synthesis:
    """Measured and synthesised FRFs on the same lines, in the quantity that was measured.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines that are compared.
    measured, synthesised : (n_lines, n_responses, n_excitations)
        FRFs of the measurement and of the model; NaN in entries whose degrees of freedom the model does not have.
    responses, excitations
        Degrees of freedom along the axes.
    misfit : (n_responses, n_excitations)
        Root mean square difference over the root mean square of the measured entry.
    correlation : (n_responses, n_excitations)
        Frequency response assurance criterion, ``|sum H conj(G)|^2 / (sum |H|^2 sum |G|^2)``: 1 where they differ by a
        factor only.
    """

    frequencies: NDArray[np.float64]
    measured: NDArray[np.complex128]
    synthesised: NDArray[np.complex128]
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    misfit: NDArray[np.float64]
    correlation: NDArray[np.float64]

    def ranked(self) -> tuple[tuple[int, int], ...]:
        """Row and column of every entry that the model has, the largest misfit first."""
        order = np.argsort(-np.nan_to_num(self.misfit, nan=-1.0), axis=None, kind="stable")
        pairs = [np.unravel_index(int(flat), self.misfit.shape) for flat in order]
        return tuple((int(p), int(q)) for p, q in pairs if np.isfinite(self.misfit[p, q]))


def synthesis(frf: Frf, model: ModalModel, band: Band | None = None) -> Synthesis:
    """Evaluate a model beside a measured FRF matrix, also on the line of an exponential window.

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
            f"a model of {model.quantity} in {model.unit} cannot stand for a {frf.quantity} in {frf.unit}; compare it "
            "with the FRF it was fitted to"
        )
    low, high = band or model.band or (0.0, np.inf)
    inside = frf.valid & (frf.frequencies > 0) & (frf.frequencies >= low) & (frf.frequencies <= high)
    if not inside.any():
        raise InputError(f"no valid line of the FRF lies between {low:g} and {high:g} Hz; choose another band")
    s, measured = frf.laplace[inside], frf.values[inside]
    synthesised = _placed(s[:, None, None] ** power * model.at(s), model, frf)
    size = np.sum(np.abs(measured) ** 2, axis=0)
    other = np.sum(np.abs(synthesised) ** 2, axis=0)
    safe = np.where(size > 0, size, 1.0)
    product = np.abs(np.sum(measured * synthesised.conj(), axis=0)) ** 2
    return Synthesis(
        frf.frequencies[inside],
        measured,
        synthesised,
        frf.responses,
        frf.excitations,
        np.sqrt(np.sum(np.abs(measured - synthesised) ** 2, axis=0) / safe),
        product / (safe * np.where(other > 0, other, 1.0)),
    )


def _placed(values: NDArray[np.complex128], model: ModalModel, frf: Frf) -> NDArray[np.complex128]:
    """Entries of the model where the FRF has them."""
    placed = np.full((len(values), len(frf.responses), len(frf.excitations)), np.nan + 0j)
    rows = [(p, model.responses.index(dof)) for p, dof in enumerate(frf.responses) if dof in model.responses]
    columns = [(q, model.excitations.index(dof)) for q, dof in enumerate(frf.excitations) if dof in model.excitations]
    if rows and columns:
        into, out_of = np.array(rows).T, np.array(columns).T
        placed[:, into[0][:, None], out_of[0]] = values[:, into[1][:, None], out_of[1]]
    return placed


def fit_summary(name: str, model: ModalModel, notes: Sequence[str], warnings: Sequence[str]) -> Summary:
    """Summary of a result that holds a model.

    Parameters
    ----------
    name
        Name of the result's type.
    model
        Modal model that was found.
    notes
        At most one line on how good it is.
    warnings
        Doubts about the model, one sentence each.
    """
    modes = modes_in_short(model.natural_frequencies, 100 * model.damping_ratios)
    table = model._summary()
    headline = f"{name}: {counted(len(modes), 'mode')}, {model.quantity} in {model.unit}"
    lines = (f"modes {listed(modes) or 'none'}", *notes, *doubts_line(warnings))
    return Summary(headline, lines, table.columns, table.rows)


def pack_parameters(model: ModalModel) -> Real:
    """Poles, right and left vectors as one real vector, in the order of ``ModalModel.covariance``."""
    pieces = []
    for array in (model.poles, model.right, model.left):
        pieces += [array.real.ravel(), array.imag.ravel()]
    return np.concatenate(pieces)


def unpack_parameters(model: ModalModel, packed: Real) -> ModalModel:
    """The model with the parameters of ``packed``."""
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
    spread = np.sqrt(np.maximum(np.diag(model.covariance), 0.0))
    columns = []
    for k in range(len(centre)):
        step = np.zeros_like(centre)
        step[k] = max(0.1 * spread[k], 1e-9 * abs(centre[k]), 1e-30)
        upper, lower = (derived(unpack_parameters(model, centre + sign * step)) for sign in (1, -1))
        columns.append((upper - lower) / (2 * step[k]))
    jacobian = np.column_stack(columns)
    return np.asarray(jacobian @ model.covariance @ jacobian.T)


def frequency_and_damping_errors(model: ModalModel) -> tuple[Real, Real] | None:
    """Standard errors of natural frequencies (Hz) and damping ratios, each (n_modes,); None where none is known.

    A model's :class:`ModeErrors` are taken where it has them, else its covariance, which holds the noise alone.
    """
    return model.standard_errors()


_REACH = 0.1  # relative distance of poles beyond which two modes are not the same


@dataclass(frozen=True)
class ModePair:
    """One mode in two models.

    Parameters
    ----------
    first, second
        Numbers of the mode in either model.
    frequency_change
        Natural frequency of the second less that of the first, Hz.
    frequency_error
        Standard error of the change, Hz; NaN where a model has no covariance.
    damping_change, damping_error
        The same of the damping ratio.
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
        """Larger of the two changes over their standard errors."""
        changes = np.array([self.frequency_change, self.damping_change])
        return float(np.max(np.abs(changes) / np.array([self.frequency_error, self.damping_error])))

    @property
    def moved(self) -> bool:
        """Whether frequency or damping moved by more than three standard errors of the change."""
        return self.significance > 3.0


def compare_modes(first: ModalModel, second: ModalModel) -> tuple[ModePair, ...]:
    """Pair the modes of two models by their poles and say how far they moved.

    Pairs minimise the summed distance ``|log(pole_2 / pole_1)|``; modes further apart than a tenth stay without a
    partner. The two fits' errors are taken as independent.

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
    >>> one = ModalModel(np.array([pole]), np.ones((1, 1)), np.ones((1, 1)), ("TCP:+X",), ("TCP:+X",))
    >>> two = ModalModel(np.array([1.01 * pole]), np.ones((1, 1)), np.ones((1, 1)), ("TCP:+X",), ("TCP:+X",))
    >>> [pair] = compare_modes(one, two)
    >>> round(pair.frequency_change, 3), pair.right_likeness
    (0.159, 1.0)
    """
    if (first.responses, first.excitations) != (second.responses, second.excitations):
        raise InputError(
            f"models of {', '.join(first.responses)} and of {', '.join(second.responses)} cannot be compared; "
            "give models of the same degrees of freedom"
        )
    distance = np.abs(np.log(first.poles)[:, None] - np.log(second.poles)[None, :])
    rows, columns = scipy.optimize.linear_sum_assignment(np.minimum(distance, 2 * _REACH))
    right, left = modal_assurance(first.right, second.right), modal_assurance(first.left, second.left)
    errors = [_errors(model) for model in (first, second)]
    pairs = []
    for i, j in zip(rows, columns, strict=True):
        if distance[i, j] > _REACH:
            continue
        change = np.array(
            [
                second.natural_frequencies[j] - first.natural_frequencies[i],
                second.damping_ratios[j] - first.damping_ratios[i],
            ]
        )
        spread = np.hypot(errors[0][:, i], errors[1][:, j])
        pairs.append(
            ModePair(
                int(i),
                int(j),
                float(change[0]),
                float(spread[0]),
                float(change[1]),
                float(spread[1]),
                float(right[i, j]),
                float(left[i, j]),
            )
        )
    return tuple(pairs)


def _errors(model: ModalModel) -> np.ndarray:
    found = frequency_and_damping_errors(model)
    return np.full((2, len(model.poles)), np.nan) if found is None else np.stack(found)
