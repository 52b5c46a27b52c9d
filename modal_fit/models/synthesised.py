"""`Synthesis`: what a model says of every FRF that was measured, and how far it is off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf
from foundation import Band, InputError

from .modal_model import ModalModel


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
