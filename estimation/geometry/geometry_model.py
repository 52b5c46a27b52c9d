"""`Geometry`: nodes with their places and local axes, and the trace lines between them."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import DegreeOfFreedom, InputError

_NAMED = 5
_SQUARE = 1e-3
"""Cosine by which local axes may depart from right angles: files hold them with few digits."""


@dataclass(frozen=True)
class Geometry:
    """Nodes of a structure.

    Parameters
    ----------
    nodes
        Names of the nodes, as they stand before the colon of a degree of freedom.
    positions : (n_nodes, 3), m
        Positions of the nodes in the structure's own axes X, Y, Z.
    axes : (n_nodes, 3, 3) or None
        Local axes: ``axes[k, 0]`` is the direction of +X at node k. They are made unit vectors. None: the structure's
        own axes everywhere.
    lines
        Chains of node names to draw as lines.

    Raises
    ------
    InputError
        Shapes that do not agree, names given twice, places that are not finite, axes that are no right-angled triple,
        or a line to a node that is not there.

    Examples
    --------
    >>> turned = np.array([np.eye(3), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]])
    >>> beam = Geometry(("1", "TCP"), np.array([[0, 0, 0], [0.5, 0, 0]]), turned, (("1", "TCP"),))
    >>> beam.position("TCP"), beam.direction("TCP:-X")
    (array([0.5, 0. , 0. ]), array([-0., -1., -0.]))
    """

    nodes: tuple[str, ...]
    positions: NDArray[np.float64]
    axes: NDArray[np.float64] | None = None
    lines: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        n = len(self.nodes)
        object.__setattr__(self, "positions", np.asarray(self.positions, dtype=float))
        if n == 0:
            raise InputError("a geometry needs a node at least; give each a name and a position")
        if self.positions.shape != (n, 3):
            raise InputError(f"{n} nodes have positions of shape {self.positions.shape}; give three coordinates each")
        if not np.isfinite(self.positions).all():
            wrong = self.nodes[int(np.argmin(np.isfinite(self.positions).all(axis=1)))]
            raise InputError(f"the position of node {wrong} is not finite; correct or leave out the node")
        twice = [name for name, count in Counter(self.nodes).items() if count > 1]
        if twice:
            raise InputError(f"node {_some(twice)} is given twice; give each node once")
        if self.axes is not None:
            object.__setattr__(self, "axes", _unit_axes(np.asarray(self.axes, dtype=float), self.nodes))
        known = set(self.nodes)
        missing = [name for line in self.lines for name in line if name not in known]
        if missing:
            raise InputError(f"a line goes to node {_some(missing)}, which is not there; add it or take it out")

    def position(self, node: str) -> NDArray[np.float64]:
        """Give the position of a node, m, shape (3,).

        Raises
        ------
        InputError
            No such node.
        """
        return np.asarray(self.positions[self._place(node)])

    def direction(self, degree_of_freedom: str) -> NDArray[np.float64]:
        """Unit vector of a degree of freedom such as ``12:-X`` in the structure's own axes, shape (3,).

        For a rotation it gives the axis, right-handed.

        Raises
        ------
        InputError
            No such node, or a degree of freedom without a direction.
        """
        dof = DegreeOfFreedom.parse(degree_of_freedom)
        place = self._place(dof.node)
        if dof.axis == "S":
            raise InputError(f"{degree_of_freedom} has no direction; give one of X, Y, Z")
        local = np.eye(3) if self.axes is None else self.axes[place]
        return np.asarray(dof.sign * local["XYZ".index(dof.axis[-1])])

    def _place(self, node: str) -> int:
        if node not in self.nodes:
            raise InputError(f"the geometry has no node {node}; it has {_some(self.nodes)}")
        return self.nodes.index(node)


def _unit_axes(axes: NDArray[np.float64], nodes: tuple[str, ...]) -> NDArray[np.float64]:
    if axes.shape != (len(nodes), 3, 3):
        raise InputError(f"{len(nodes)} nodes have axes of shape {axes.shape}; give three vectors of three each")
    length = np.linalg.norm(axes, axis=2, keepdims=True)
    unit = axes / np.where(length > 0, length, 1)
    angles = unit @ unit.transpose(0, 2, 1) - np.eye(3)
    wrong = ~(np.abs(angles).max(axis=(1, 2), initial=0) <= _SQUARE)
    if wrong.any():
        raise InputError(
            f"the local axes of node {nodes[int(wrong.argmax())]} are not three directions at right angles; give the "
            "directions of its X, Y and Z"
        )
    return np.asarray(unit)


def _some(names: list[str] | tuple[str, ...]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
