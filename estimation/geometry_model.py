"""`Geometry`: nodes with their positions and local axes, and the trace lines between them."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from millfrf.core import DegreeOfFreedom, InputError, Real, listed

from .settings import FRFS

_MOST_NAMES = 5  # that a message lists


@dataclass(frozen=True)
class Geometry:
    """Nodes of a structure with their positions, local axes and connecting lines.

    Parameters
    ----------
    nodes
        Names of the nodes, as they appear before the colon of a degree of freedom.
    positions : (n_nodes, 3), m
        Positions of the nodes in the axes X, Y, Z of the structure.
    axes : (n_nodes, 3, 3) or None
        Local axes: ``axes[k, 0]`` is the direction of +X at node k. They are scaled to unit vectors. None: the axes of
        the structure at every node.
    lines
        Chains of node names to draw as lines.

    Raises
    ------
    InputError
        Shapes that do not agree, a name that is given twice, positions that are not finite, axes without right angles,
        or a line to a missing node.

    Examples
    --------
    >>> rotated = np.array([np.eye(3), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]])
    >>> beam = Geometry(("1", "TCP"), np.array([[0, 0, 0], [0.5, 0, 0]]), rotated, (("1", "TCP"),))
    >>> beam.position("TCP"), beam.direction("TCP:-X")
    (array([0.5, 0. , 0. ]), array([-0., -1., -0.]))
    """

    nodes: tuple[str, ...]
    positions: Real
    axes: Real | None = None
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
            raise InputError(f"node {listed(twice, _MOST_NAMES)} is given twice; give each node once")
        if self.axes is not None:
            object.__setattr__(self, "axes", _unit_axes(np.asarray(self.axes, dtype=float), self.nodes))
        missing = [name for line in self.lines for name in line if name not in self.nodes]
        if missing:
            names = listed(missing, _MOST_NAMES)
            raise InputError(f"a line goes to node {names}, which is not there; add it or take it out")

    def position(self, node: str) -> Real:
        """Return the position of a node, m, shape (3,).

        Raises
        ------
        InputError
            No such node.
        """
        return np.asarray(self.positions[self._index(node)])

    def direction(self, degree_of_freedom: str) -> Real:
        """Compute the unit vector (3,) of a degree of freedom such as ``12:-X`` in the axes of the structure.

        For a rotation it is the right-handed axis of rotation.

        Raises
        ------
        InputError
            No such node, or a degree of freedom without a direction.
        """
        dof = DegreeOfFreedom.parse(degree_of_freedom)
        index = self._index(dof.node)
        if dof.axis == "S":
            raise InputError(f"{degree_of_freedom} has no direction; give one of X, Y, Z")
        local = np.eye(3) if self.axes is None else self.axes[index]
        return np.asarray(dof.sign * local["XYZ".index(dof.axis[-1])])

    def _index(self, node: str) -> int:
        if node not in self.nodes:
            raise InputError(f"the geometry has no node {node}; it has {listed(self.nodes, _MOST_NAMES)}")
        return self.nodes.index(node)


def _unit_axes(axes: Real, nodes: tuple[str, ...]) -> Real:
    if axes.shape != (len(nodes), 3, 3):
        raise InputError(f"{len(nodes)} nodes have axes of shape {axes.shape}; give three vectors of three each")
    length = np.linalg.norm(axes, axis=2, keepdims=True)
    unit = axes / np.where(length > 0, length, 1)
    cosines = unit @ unit.transpose(0, 2, 1) - np.eye(3)
    # written as "not smaller", so that NaN is wrong as well
    wrong = ~(np.abs(cosines).max(axis=(1, 2), initial=0) <= FRFS.right_angle)
    if wrong.any():
        raise InputError(
            f"the local axes of node {nodes[int(wrong.argmax())]} are not three directions at right angles; give the "
            "directions of its X, Y and Z"
        )
    return np.asarray(unit)
