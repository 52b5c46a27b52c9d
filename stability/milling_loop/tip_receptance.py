"""The 3 x 3 tip receptance that a stability solver works on, from a modal model or a measured FRF."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from foundation import DegreeOfFreedom, InputError
from modal_fit import ModalModel

from .beyond_band import with_residual_flexibility
from .measured_lines import known_lines

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class ToolReceptance:
    """Receptance between force and motion of the tool in X, Y, Z; directions that were not given are rigid.

    Parameters
    ----------
    evaluate
        Function that takes frequencies (n,) in Hz inside ``span`` and gives the receptance (n, 3, 3), m/N.
    grid : (n_lines,), Hz
        Frequencies so close that nothing between two of them is missed.
    span : Hz
        Lowest and highest frequency at which the receptance is known.
    warnings
        Doubts about the receptance, one sentence each.
    open_above
        Whether it may be evaluated above ``span`` too, as a modal model may.
    """

    evaluate: Callable[[Real], Complex]
    grid: Real
    span: tuple[float, float]
    warnings: tuple[str, ...] = ()
    open_above: bool = False


def tool_receptance(structure: Frf | ModalModel, *, node: str | None = None) -> ToolReceptance:
    """Take X, Y, Z of one node from a measured FRF or a modal model, signs and order put right.

    A measured FRF is interpolated linearly in real and imaginary part between its valid lines, those inside its band
    that are no noise (:func:`known_lines`); a modal model is
    evaluated where it is asked, from a twentieth of its lowest to three times its highest natural frequency.

    Parameters
    ----------
    structure
        FRF or modal model with responses and excitations at the tool.
    node
        Name of the tool's node; None: the excitations' only node.

    Raises
    ------
    InputError
        No common direction at the node, no receptance, or too few valid lines.
    """
    said: tuple[str, ...] = ()
    if isinstance(structure, Frf):
        structure, said = known_lines(to_receptance(structure))
    placed = tool_directions(structure, node).place
    if isinstance(structure, ModalModel):
        return _from_model(with_residual_flexibility(structure), placed)
    found = _from_frf(structure, placed)
    return replace(found, warnings=(*said, *found.warnings))


@dataclass(frozen=True)
class ToolDirections:
    """Rows and columns of a receptance that are X, Y, Z of the tool, with their signs."""

    rows: list[int]
    row_axes: list[int]
    row_signs: list[float]
    columns: list[int]
    column_axes: list[int]
    column_signs: list[float]

    def place(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values (..., n_responses, n_excitations) as (..., 3, 3), zero in directions that were not given."""
        full = np.zeros((*values.shape[:-2], 3, 3), dtype=values.dtype)
        chosen = values[..., self.rows, :][..., self.columns] * np.outer(self.row_signs, self.column_signs)
        full[..., np.array(self.row_axes)[:, None], np.array(self.column_axes)[None, :]] = chosen
        return full

    def place_rows(self, vectors: Complex) -> Complex:
        """Right vectors (n_modes, n_responses) as (n_modes, 3)."""
        full = np.zeros((len(vectors), 3), dtype=complex)
        full[:, self.row_axes] = vectors[:, self.rows] * np.array(self.row_signs)
        return full

    def place_columns(self, vectors: Complex) -> Complex:
        """Left vectors (n_modes, n_excitations) as (n_modes, 3)."""
        full = np.zeros((len(vectors), 3), dtype=complex)
        full[:, self.column_axes] = vectors[:, self.columns] * np.array(self.column_signs)
        return full


def tool_directions(structure: Frf | ModalModel, node: str | None = None) -> ToolDirections:
    """Find X, Y, Z of the tool among the degrees of freedom of a receptance.

    Raises
    ------
    InputError
        No receptance, excitations at several nodes, or no response or excitation at the tool.
    """
    if structure.quantity != "receptance" or structure.unit != "m/N":
        raise InputError(
            f"stability needs a receptance in m/N, this is {structure.quantity} in {structure.unit}; give a model or "
            "an FRF of receptance"
        )
    node = node or _only_node(structure.excitations)
    rows, row_axes, row_signs = _directions(structure.responses, node)
    columns, column_axes, column_signs = _directions(structure.excitations, node)
    if not rows or not columns:
        raise InputError(
            f"no response at the tool: excited at {node}, responses at {', '.join(structure.responses)}; "
            "calibrate the model to the tip first, or, if the sensor sat at the tip, name its node TCP in the mapping"
        )
    return ToolDirections(rows, row_axes, row_signs, columns, column_axes, column_signs)


def _only_node(labels: tuple[str, ...]) -> str:
    nodes = sorted({DegreeOfFreedom.parse(label).node for label in labels})
    if len(nodes) != 1:
        found = ", ".join(nodes) or "none"
        raise InputError(f"excitations at one node are needed, got {found}; name the tool's node or give an FRF of it")
    return nodes[0]


def _directions(labels: tuple[str, ...], node: str) -> tuple[list[int], list[int], list[float]]:
    places, axes, signs = [], [], []
    for place, label in enumerate(labels):
        dof = DegreeOfFreedom.parse(label)
        if dof.node == node and dof.axis in ("X", "Y", "Z"):
            axis = "XYZ".index(dof.axis)
            if axis in axes:
                raise InputError(f"direction {dof.axis} of {node} appears twice; give each direction once")
            places.append(place)
            axes.append(axis)
            signs.append(dof.sign)
    return places, axes, signs


def _from_model(model: ModalModel, placed: Callable[[Complex], Complex]) -> ToolReceptance:
    if not len(model.poles):
        raise InputError("the modal model has no mode; fit at least one")
    if model.poles.real.max() >= 0:
        worst = model.poles[model.poles.real.argmax()]
        raise InputError(f"the structure itself is unstable: pole {worst:.4g} rad/s does not decay; fit again")
    natural = model.natural_frequencies
    low, high = 0.05 * float(natural.min()), 3.0 * float(natural.max())
    steps = [np.geomspace(low, high, 400)]
    for pole in model.poles:
        width = -pole.real / (2 * np.pi)
        steps.append(pole.imag / (2 * np.pi) + width * np.sinh(np.linspace(-4, 4, 161)))
    grid = np.unique(np.concatenate(steps))
    grid = grid[(grid >= low) & (grid <= high)]

    def evaluate(frequencies: Real) -> Complex:
        return placed(model.receptance(frequencies))

    return ToolReceptance(evaluate, grid, (low, high), open_above=True)


def reaching(source: ToolReceptance, force: Real, max_depth: float) -> ToolReceptance:
    """Follow a modal model's receptance up to where no depth that is asked for can close the loop.

    That is where ``2 a |force| |H|`` stays below 1: at high spindle speed a damped structure chatters far above its
    natural frequencies, since cutting stiffens it. A measured FRF ends where it ends.

    Parameters
    ----------
    source
        Receptance at the tool; a measured one is returned as it is.
    force : (3, 3), Pa
        Cutting force per depth and motion.
    max_depth : m
        Largest axial depth that is asked for.
    """
    if not source.open_above:
        return source
    gain = 2 * max_depth * float(np.linalg.norm(force, 2))
    above = np.geomspace(source.span[1], 1e3 * source.span[1], 700)[1:]
    closing = gain * np.linalg.norm(source.evaluate(above), 2, axis=(1, 2)) > 1
    if not closing.any():
        return source
    above = above[: int(np.flatnonzero(closing)[-1]) + 2]
    return replace(source, grid=np.append(source.grid, above), span=(source.span[0], float(above[-1])))


def _from_frf(frf: Frf, placed: Callable[[Complex], Complex]) -> ToolReceptance:
    valid = frf.valid & (frf.frequencies > 0)
    if valid.sum() < 8:
        raise InputError(f"the FRF has {valid.sum()} valid lines above 0 Hz; too few to draw lobes from")
    lines, values = frf.frequencies[valid], frf.values[valid]

    def evaluate(frequencies: Real) -> Complex:
        upper = np.clip(np.searchsorted(lines, frequencies), 1, len(lines) - 1)
        share = (frequencies - lines[upper - 1]) / (lines[upper] - lines[upper - 1])
        between = values[upper - 1] + share[:, None, None] * (values[upper] - values[upper - 1])
        return placed(np.asarray(between))

    gaps = np.diff(lines) > 1.5 * np.median(np.diff(lines))
    warnings = (f"{gaps.sum()} gaps in the valid lines are bridged by straight lines",) if gaps.any() else ()
    return ToolReceptance(evaluate, lines, (float(lines[0]), float(lines[-1])), warnings)
