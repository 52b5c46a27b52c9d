"""A modal model as first-order states at the tool: what time-domain stability solvers work on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import DegreeOfFreedom, InputError
from modal_fit import ModalModel

Complex = NDArray[np.complex128]
AXES = "XYZ"


@dataclass(frozen=True)
class StructureStates:
    """``z' = diag(poles) z + inputs F``, ``X = outputs z`` at the tool, in X, Y, Z; conjugate states included.

    Parameters
    ----------
    poles : (n_states,), rad/s
    inputs : (n_states, 3)
    outputs : (3, n_states)
    warnings
        What the states leave out, one sentence each.
    """

    poles: Complex
    inputs: Complex
    outputs: Complex
    warnings: tuple[str, ...]


def structure_states(model: ModalModel, *, node: str | None = None) -> StructureStates:
    """States of every mode and of the fixed poles that stand for modes out of band.

    A residual's constant and ``1/s^2`` terms have no states; they are left out, and the warning says how much of the
    receptance that is.

    Parameters
    ----------
    model
        Receptance with responses and excitations at the tool.
    node
        The tool's; None: the excitations' only node.

    Raises
    ------
    InputError
        Not a receptance, no mode, an unstable pole, or no direction at the tool.
    """
    if model.quantity != "receptance" or model.unit != "m/N":
        raise InputError(f"stability needs a receptance in m/N, this is {model.quantity} in {model.unit}")
    if not len(model.poles):
        raise InputError("the modal model has no mode; fit at least one")
    if model.poles.real.max() >= 0:
        worst = model.poles[model.poles.real.argmax()]
        raise InputError(f"the structure itself is unstable: pole {worst:.4g} rad/s does not decay; fit again")
    places = [_placement(labels, node) for labels in (model.responses, model.excitations)]
    right, left = model.right @ places[0].T, model.left @ places[1].T
    poles, warnings = model.poles, []
    if model.residuals is not None:
        residuals = model.residuals
        if residuals.poles is not None and residuals.residues is not None:
            for pole, residue in zip(residuals.poles, residuals.residues, strict=True):
                u, sigma, vh = np.linalg.svd(places[0] @ residue @ places[1].T)
                kept = sigma > 1e-9 * sigma.max(initial=0.0)
                right = np.concatenate([right, (u[:, kept] * sigma[kept]).T])
                left = np.concatenate([left, vh[kept]])
                poles = np.concatenate([poles, np.full(kept.sum(), pole)])
        warnings = _left_out(model)
    return StructureStates(
        np.concatenate([poles, poles.conj()]),
        np.concatenate([left, left.conj()]),
        np.concatenate([right, right.conj()]).T,
        tuple(warnings),
    )


def _placement(labels: tuple[str, ...], node: str | None) -> NDArray[np.float64]:
    """Signed selection (3, n_labels) of the tool's directions."""
    parsed = [DegreeOfFreedom.parse(label) for label in labels]
    nodes = {dof.node for dof in parsed}
    if node is None and len(nodes) > 1:
        raise InputError(f"degrees of freedom at several nodes ({', '.join(sorted(nodes))}); name the tool's node")
    chosen = node or parsed[0].node
    placed = np.zeros((3, len(labels)))
    for column, dof in enumerate(parsed):
        if dof.node == chosen and dof.axis in AXES:
            if placed[AXES.index(dof.axis)].any():
                raise InputError(f"direction {dof.axis} of {chosen} appears twice; give each direction once")
            placed[AXES.index(dof.axis), column] = dof.sign
    if not placed.any():
        raise InputError(f"no direction X, Y or Z at {chosen}; calibrate the model to the tip first")
    return placed


def _left_out(model: ModalModel) -> list[str]:
    residuals = model.residuals
    assert residuals is not None
    f = np.linspace(0.7 * model.natural_frequencies.min(), 1.3 * model.natural_frequencies.max(), 50)
    s = 2j * np.pi * f
    plain = residuals.upper + residuals.lower / (s**2)[:, None, None]
    share = np.abs(plain).max() / np.abs(model.receptance(f)).max()
    if share < 1e-3:
        return []
    return [f"residual terms without states, {100 * share:.2g} % of the largest receptance, are left out"]
