"""How alike, how complex and how reciprocal modal vectors are."""

import numpy as np
from numpy.typing import NDArray

from estimation import shared_points

from .modal_model import ModalModel

Complex = NDArray[np.complex128]


def modal_assurance(first: Complex, second: Complex) -> NDArray[np.float64]:
    """Compute the MAC ``|a^H b|^2 / (a^H a b^H b)`` between all vectors (Allemang & Brown 1982).

    Parameters
    ----------
    first : (n, n_dof), complex
        Vectors a, one a row.
    second : (m, n_dof), complex
        Vectors b, one a row.

    Returns
    -------
    (n, m), 0 ... 1; the auto-MAC where both are the same vectors.

    Examples
    --------
    >>> modal_assurance(np.array([[1, 1j]]), np.array([[2j, -2], [1, 0]])).round(3).tolist()
    [[1.0, 0.5]]
    """
    product = np.abs(first.conj() @ second.T) ** 2
    sizes = np.outer(np.sum(np.abs(first) ** 2, axis=1), np.sum(np.abs(second) ** 2, axis=1))
    return np.asarray(np.divide(product, sizes, out=np.zeros(sizes.shape), where=sizes > 0))


def phase_collinearity(vectors: Complex) -> NDArray[np.float64]:
    """Modal phase collinearity: 1 for a real (monophase) vector, less for a complex one, shape (n,).

    From the eigenvalues of the 2 x 2 covariance of real and imaginary parts, ``((l1 - l2) / (l1 + l2))^2``
    (Pappa, Elliott & Schenk, AIAA J. Guidance 16, 1993).
    """
    real, imaginary = vectors.real, vectors.imag
    a, b = np.sum(real**2, axis=1), np.sum(imaginary**2, axis=1)
    c = np.sum(real * imaginary, axis=1)
    total = np.where(a + b > 0, a + b, 1.0)
    return np.asarray(((a - b) ** 2 + 4 * c**2) / total**2)


def phase_deviation(vectors: Complex) -> NDArray[np.float64]:
    """Mean phase deviation from the best straight line through the origin, rad, shape (n,), weighted by magnitude."""
    line = 0.5 * np.angle(np.sum(vectors**2, axis=1))
    turned = vectors * np.exp(-1j * line[:, None])
    magnitude = np.abs(vectors)
    deviation = np.arctan2(np.abs(turned.imag), np.abs(turned.real))
    return np.asarray(np.sum(magnitude * deviation, axis=1) / np.sum(magnitude, axis=1))


def reciprocity_residual(model: ModalModel) -> NDArray[np.float64]:
    """Share of each mode's residue matrix that is not symmetric, ``|A - A^T| / |A + A^T|``, shape (n_modes,).

    Over points that are both excited and measured, along one axis in either direction; NaN with fewer than two.
    """
    shared = shared_points(model.responses, model.excitations)
    if len(shared) < 2:
        return np.full(len(model.poles), np.nan)
    right = model.right[:, [point.row for point in shared]] * [point.response_sign for point in shared]
    left = model.left[:, [point.column for point in shared]] * [point.excitation_sign for point in shared]
    residue = np.einsum("rp,rq->rpq", right, left)
    mirrored = residue.transpose(0, 2, 1)
    return np.asarray(np.linalg.norm(residue - mirrored, axis=(1, 2)) / np.linalg.norm(residue + mirrored, axis=(1, 2)))
