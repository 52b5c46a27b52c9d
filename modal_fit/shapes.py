"""Measures of modal vectors: MAC, MPC, MPD, complexity and reciprocity."""

from dataclasses import dataclass

import numpy as np

from estimation import shared_points
from millfrf.core import Complex, InputError, Real

from .models.modal_model import ModalModel


def mode_complexity(vectors: Complex) -> Real:
    r"""Compute the share of the circle through the largest component that the components of a vector span.

    Imregun & Ewins, *Complex modes: origins and limits*, Proc. IMAC 13, 1995:
    ``area(hull of all components and the origin) / (pi max|x|^2)``. It is 0 for components on one line through the
    origin, as of a real mode, and 1 for very many components evenly around a circle, as of a travelling wave.
    ``vectors`` (n_modes, n_dof) holds one mode a row.

    A square in a circle covers ``2 / pi`` of it:

    >>> mode_complexity(np.array([[1, 1j, -1, -1j], [1, -2, 3, 0.5]])).round(3).tolist()
    [0.637, 0.0]
    """
    return np.array([_hull_share(vector) for vector in vectors], dtype=float)


def _hull_share(vector: Complex) -> float:
    from scipy.spatial import ConvexHull, QhullError  # loads slowly, and only this function needs it

    largest = float(np.abs(vector).max(initial=0.0))
    if largest == 0.0:
        return 0.0
    points = np.append(vector, 0.0) / largest
    try:
        hull = ConvexHull(np.column_stack([points.real, points.imag]))
    except QhullError:  # all points lie on one line
        return 0.0
    return float(hull.volume) / np.pi  # in two dimensions the volume is the area


def modal_assurance(first: Complex, second: Complex) -> Real:
    """Compute the MAC ``|a^H b|^2 / (a^H a b^H b)`` between all vectors (Allemang & Brown 1982).

    ``first`` (n, n_dof) and ``second`` (m, n_dof) hold one vector a row; the result is (n, m), 0 to 1.

    >>> modal_assurance(np.array([[1, 1j]]), np.array([[2j, -2], [1, 0]])).round(3).tolist()
    [[1.0, 0.5]]
    """
    product = np.abs(first.conj() @ second.T) ** 2
    sizes = np.outer(np.sum(np.abs(first) ** 2, axis=1), np.sum(np.abs(second) ** 2, axis=1))
    return np.asarray(np.divide(product, sizes, out=np.zeros(sizes.shape), where=sizes > 0))


def phase_collinearity(vectors: Complex) -> Real:
    """Compute the modal phase collinearity, (n_modes,): 1 for a real (monophase) vector, less for a complex one.

    It follows from the eigenvalues l1, l2 of the 2 x 2 covariance of real and imaginary parts,
    ``((l1 - l2) / (l1 + l2))^2`` (Pappa, Elliott & Schenk, AIAA J. Guidance 16, 1993).
    """
    real, imaginary = vectors.real, vectors.imag
    a, b = np.sum(real**2, axis=1), np.sum(imaginary**2, axis=1)
    c = np.sum(real * imaginary, axis=1)
    total = np.where(a + b > 0, a + b, 1.0)
    return np.asarray(((a - b) ** 2 + 4 * c**2) / total**2)


def phase_deviation(vectors: Complex) -> Real:
    """Compute the magnitude-weighted mean phase deviation from the best line through the origin, rad, (n_modes,)."""
    turned = vectors * np.exp(-1j * _line_angle(vectors))
    magnitude = np.abs(vectors)
    deviation = np.arctan2(np.abs(turned.imag), np.abs(turned.real))
    return np.asarray(np.sum(magnitude * deviation, axis=1) / np.sum(magnitude, axis=1))


def _line_angle(vectors: Complex) -> Real:
    """Return the angle (rad) of the straight line through the origin that fits each vector best, shape (n_modes, 1)."""
    return np.asarray(0.5 * np.angle(np.sum(vectors**2, axis=1, keepdims=True)))


def reciprocity_residual(model: ModalModel) -> Real:
    """Compute the asymmetric share of each mode's residue matrix, ``|A - A^T| / |A + A^T|``, shape (n_modes,).

    Only points that are both excited and measured along the same axis count; NaN with fewer than two of them.
    """
    _, right, left = _vectors_at_shared_points(model)
    if right.shape[1] < 2:
        return np.full(len(model.poles), np.nan)
    residue = np.einsum("rp,rq->rpq", right, left)
    mirrored = residue.transpose(0, 2, 1)
    return np.asarray(np.linalg.norm(residue - mirrored, axis=(1, 2)) / np.linalg.norm(residue + mirrored, axis=(1, 2)))


def _vectors_at_shared_points(model: ModalModel) -> tuple[tuple[str, ...], Complex, Complex]:
    """Return the points that are both excited and measured, and right and left vectors there, (n_modes, n_points)."""
    points = shared_points(model.responses, model.excitations)
    right = model.right[:, [point.row for point in points]] * [point.response_sign for point in points]
    left = model.left[:, [point.column for point in points]] * [point.excitation_sign for point in points]
    return tuple(point.name for point in points), right, left


@dataclass(frozen=True)
class ModeShapes:
    """The shapes of a model, with measures of how real and how distinct they are.

    Parameters
    ----------
    vectors : (n_modes, n_dof), complex
        Each turned so that its best straight line is the real axis, and scaled so that its largest component is 1.
    dofs
        Degrees of freedom of the components.
    side
        ``right`` (responses) or ``left`` (excitations): the side with more degrees of freedom, right if equal.
    assurance : (n_modes, n_modes)
        Auto-MAC: modal assurance of all pairs of shapes, 0 to 1.
    collinearity : (n_modes,)
        Modal phase collinearity (MPC), 1 for a real mode.
    deviation : (n_modes,), rad
        Mean phase deviation (MPD), 0 for a real mode.
    complexity : (n_modes,)
        Share of the circle that the components cover, 0 for a real mode.
    """

    vectors: Complex
    dofs: tuple[str, ...]
    side: str
    assurance: Real
    collinearity: Real
    deviation: Real
    complexity: Real

    def most_alike(self, mode: int) -> tuple[int, float] | None:
        """Return the mode with the largest MAC to ``mode``, and that MAC; None where there is no other mode."""
        others = self.assurance[mode].copy()
        others[mode] = -1.0
        return None if len(others) < 2 else (int(others.argmax()), float(others.max()))

    def alike(self, least: float = 0.9) -> tuple[tuple[int, int], ...]:
        """Return the pairs of modes whose MAC is ``least`` or more."""
        rows, columns = np.nonzero(np.triu(self.assurance, 1) >= least)
        return tuple((int(i), int(j)) for i, j in zip(rows, columns, strict=True))


def mode_shapes(model: ModalModel) -> ModeShapes:
    """Measure the shapes of a model on the side with more degrees of freedom.

    Raises
    ------
    InputError
        Neither side has two degrees of freedom: there is no shape.

    Examples
    --------
    >>> vectors = np.array([[1, 2, 1], [1, 0, -1]]) * np.exp(0.3j)
    >>> poles = np.array([-1 + 100j, -1 + 180j])
    >>> model = ModalModel(poles, vectors, vectors[:, :1], ("1:+Z", "2:+Z", "3:+Z"), ("1:+Z",))
    >>> shapes = mode_shapes(model)
    >>> shapes.side, shapes.assurance.round(3).tolist(), shapes.collinearity.round(3).tolist()
    ('right', [[1.0, 0.0], [0.0, 1.0]], [1.0, 1.0])
    """
    use_right = len(model.responses) >= len(model.excitations)
    vectors, dofs = (model.right, model.responses) if use_right else (model.left, model.excitations)
    if len(dofs) < 2:
        raise InputError(f"the model has one degree of freedom, {dofs[0]}: a shape needs two or more")
    return ModeShapes(
        _normalised(vectors),
        dofs,
        "right" if use_right else "left",
        modal_assurance(vectors, vectors),
        phase_collinearity(vectors),
        phase_deviation(vectors),
        mode_complexity(vectors),
    )


def _normalised(vectors: Complex) -> Complex:
    """Turn and scale vectors as ``ModeShapes.vectors`` states."""
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    turned = vectors * np.exp(-1j * _line_angle(vectors)) / np.where(largest > 0, largest, 1.0)
    main = np.take_along_axis(turned, np.abs(turned).argmax(axis=1, keepdims=True), axis=1)
    return np.asarray(turned * np.where(main.real < 0, -1.0, 1.0))


@dataclass(frozen=True)
class ModeReciprocity:
    """Agreement of left and right vectors of each mode on the points that are both excited and measured.

    Parameters
    ----------
    points
        Points that are compared, ``node:axis``.
    assurance : (n_modes,)
        MAC of right and left vector on these points: 1 for a reciprocal structure.
    residual : (n_modes,)
        ``|A - A^T| / |A + A^T|`` of the residue matrix: 0 for a reciprocal structure.
    """

    points: tuple[str, ...]
    assurance: Real
    residual: Real


def mode_reciprocity(model: ModalModel) -> ModeReciprocity | None:
    """Compare left and right vectors; None with fewer than two shared points, or for a ``transfer``.

    Reciprocity ``A = A^T`` of the residues ``A = right left^T`` makes both vectors parallel.

    Examples
    --------
    >>> dofs = ("A:+X", "A:+Y")
    >>> model = ModalModel(np.array([-1 + 50j]), np.array([[1, 2j]]), np.array([[2, -1j]]), dofs, dofs)
    >>> round(float(mode_reciprocity(model).assurance[0]), 3)
    0.0
    """
    points, right, left = _vectors_at_shared_points(model)
    if len(points) < 2 or not len(model.poles) or model.quantity == "transfer":
        return None
    return ModeReciprocity(points, np.diag(modal_assurance(right, left)).copy(), reciprocity_residual(model))
