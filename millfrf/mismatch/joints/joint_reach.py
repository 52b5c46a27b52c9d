"""`JointReach`: a modal model extended by motions and forces of joints without sensors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from millfrf.core import Complex, Real
from modal_fit import ModalModel, Residuals

from .joint_axis import JointAxis, ModalScales, tip_axes


@dataclass(frozen=True)
class JointPath:
    """How one joint's axis reaches the degrees of freedom of a widened model.

    Parameters
    ----------
    axis
        The joint's axis.
    rows : (n_responses, n_entries)
        Matrix from its entries to the widened model's responses.
    columns : (n_excitations, n_entries)
        Matrix from its entries to the widened model's excitations.
    """

    axis: JointAxis
    rows: Real
    columns: Real

    @property
    def along(self) -> Real:
        """The combination of responses that is the joint's deflection, (n_responses,)."""
        return np.asarray(self.rows @ self.axis.entries)

    @property
    def ends(self) -> tuple[Real, Real]:
        """Both :attr:`along` and :attr:`push`."""
        return self.along, self.push

    @property
    def push(self) -> Real:
        """The excitations by a unit of the joint's force, (n_excitations,)."""
        return np.asarray(self.columns @ self.axis.entries)


@dataclass(frozen=True)
class JointReach:
    """A modal model, and how each joint acts on it.

    Where a joint's axis lies in the modes, each part of a mode is one more response, and a force on it one more
    excitation: everything that holds between forces and responses then holds for the joint.

    Parameters
    ----------
    model
        The model with these responses and excitations behind its own; the model itself where all joints act at the tip.
    paths
        How each joint reaches it, in their order.
    """

    model: ModalModel
    paths: tuple[JointPath, ...]

    @cached_property
    def reduced(self) -> ModalModel:
        """The model's own degrees of freedom, and behind them one response and one excitation for each joint.

        The first is the joint's deflection, the second a unit of its force: what parts of modes a joint has does not
        count where only these are asked for, and there may be many.
        """
        more = sum(len(path.axis.entries) for path in self.paths if path.axis.scales is not None)
        n, m = len(self.model.responses) - more, len(self.model.excitations) - more
        rows = np.hstack([np.eye(len(self.model.responses), n), *(path.along[:, None] for path in self.paths)])
        columns = np.hstack([np.eye(len(self.model.excitations), m), *(path.push[:, None] for path in self.paths)])
        return combined_model(self.model, rows, columns)

    def forces(self, force: Complex) -> Complex:
        """Forces (n_lines, n) on the model's own excitations as forces on all, (n_lines, n_excitations)."""
        more = len(self.model.excitations) - force.shape[1]
        return np.pad(force, ((0, 0), (0, more))) if more else force


def joint_reach(model: ModalModel, axes: Sequence[JointAxis]) -> JointReach:
    """How joints act on a modal model.

    Parameters
    ----------
    model
        Modal model of the linear structure.
    axes
        Axes of the joints.
    """
    n, m, count = len(model.responses), len(model.excitations), len(model.poles)
    inner = [axis.scales for axis in axes if axis.scales is not None]
    more = sum(len(scales.seen) for scales in inner)
    widened = model
    if inner:
        names = tuple(f"MODE {place % count + 1}:+S" for place in range(more))
        widened = replace(
            model,
            right=np.hstack([model.right, *(_of_modes(scales.seen, count) for scales in inner)]),
            left=np.hstack([model.left, *(_of_modes(scales.pushed, count) for scales in inner)]),
            responses=(*model.responses, *names),
            excitations=(*model.excitations, *names),
            residuals=_widened_residuals(model, more),
            covariance=None,
        )
    paths, first = [], 0
    for axis in axes:
        if axis.scales is None:
            rows, columns, _ = tip_axes(model)
            paths.append(JointPath(axis, np.pad(rows, ((0, more), (0, 0))), np.pad(columns, ((0, more), (0, 0)))))
        else:
            parts = len(axis.entries)
            rows, columns = (np.zeros((size + more, parts)) for size in (n, m))
            rows[n + first : n + first + parts] = columns[m + first : m + first + parts] = np.eye(parts)
            paths.append(JointPath(axis, rows, columns))
            first += parts
    return JointReach(widened, tuple(paths))


def combined_model(model: ModalModel, rows: Real, columns: Real) -> ModalModel:
    """The model between combinations of its responses and combinations of its excitations.

    Parameters
    ----------
    model
        Modal model whose responses and excitations are combined.
    rows : (n_responses, n_wanted)
        Each column is one combination of responses.
    columns : (n_excitations, m_wanted)
        Each column is the excitations by one unit.
    """
    residuals = model.residuals
    if residuals is not None:
        residues = None if residuals.residues is None else rows.T @ residuals.residues @ columns
        upper, lower = (rows.T @ one @ columns for one in (residuals.upper, residuals.lower))
        residuals = replace(residuals, upper=upper, lower=lower, residues=residues)
    return replace(
        model,
        right=model.right @ rows,
        left=model.left @ columns,
        responses=tuple(f"COMBINATION {k + 1}:+S" for k in range(rows.shape[1])),
        excitations=tuple(f"COMBINATION {k + 1}:+S" for k in range(columns.shape[1])),
        residuals=residuals,
        covariance=None,
        errors=None,
    )


def _of_modes(scales: Complex, count: int) -> Complex:
    """Entries (n_modes, n_parts) of the modes' vectors for the scales (n_parts,) of one or two parts of each mode."""
    return np.hstack([np.diag(part) for part in scales.reshape(-1, count)])


def _widened_residuals(model: ModalModel, more: int) -> Residuals | None:
    """Residuals that say nothing about the added responses and excitations."""
    own = model.residuals
    if own is None:
        return None
    wide = ((0, more), (0, more))
    residues = None if own.residues is None else np.pad(own.residues, ((0, 0), *wide))
    return replace(own, upper=np.pad(own.upper, wide), lower=np.pad(own.lower, wide), residues=residues)


def modal_scales(model: ModalModel) -> ModalScales:
    """Scales in which a mode's part in a joint is one real number.

    A reciprocal structure with real mode shapes ``phi`` has residues ``phi_p phi_q / (2 i omega m)``: along each mode,
    motion and push at a point are one real number, times a right and a left scale whose product lags by a quarter of a
    turn where the structure is passive. Their sizes are those of the mode's vectors over the common axes, so that a
    part of one is that of a joint at the tip which moves as the tip does; their phases are fitted to both vectors.

    Parameters
    ----------
    model
        Modal model whose common axes (:func:`tip_axes`) show right against left vectors.
    """
    rows, columns, _ = tip_axes(model)
    right, left = model.right @ rows, model.left @ columns
    seen, pushed = np.linalg.norm(right, axis=1), np.linalg.norm(left, axis=1)
    turn = _doubled_phase(right) - np.conj(_doubled_phase(left))
    phase = np.exp(0.5j * np.angle(turn))
    return ModalScales(seen * phase, -1j * pushed * np.conj(phase))


def inside_of(model: ModalModel, axis: JointAxis) -> JointAxis:
    """The axis over the modes, each with a phase, that moves and pushes most like one at the tip.

    Parameters
    ----------
    model
        Modal model whose modes take part.
    axis
        A direction at the tip.
    """
    scales = modal_scales(model)
    rows, columns, _ = tip_axes(model)
    seen, pushed = model.right @ rows @ axis.entries / scales.seen, model.left @ columns @ axis.entries / scales.pushed
    parts = 0.5 * (seen + pushed)
    size = float(np.linalg.norm(parts))
    entries = np.append(parts.real, parts.imag) / size
    return JointAxis(entries, ModalScales(size * scales.seen, size * scales.pushed).with_phases())


def _doubled_phase(vectors: Complex) -> Complex:
    """Unit numbers with twice the phase that vectors (n_modes, n) are closest to, (n_modes,)."""
    squares = np.sum(vectors**2, axis=1)
    return np.asarray(squares / np.maximum(np.abs(squares), 1e-300))
