"""`ModeShapes`: auto-MAC, phase collinearity, phase deviation and complexity of a model's modes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..models.modal_model import ModalModel
from ..models.shape_measures import modal_assurance, phase_collinearity, phase_deviation
from .complexity import mode_complexity

Real = NDArray[np.float64]


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
        ``right`` (responses) or ``left`` (excitations): the side with more degrees of freedom, right if even.
    assurance : (n_modes, n_modes)
        Auto-MAC: modal assurance of all pairs of shapes, 0 to 1.
    collinearity : (n_modes,)
        Modal phase collinearity (MPC), 1 for a real mode.
    deviation : (n_modes,), rad
        Mean phase deviation (MPD), 0 for a real mode.
    complexity : (n_modes,)
        Share of the circle that the components cover, 0 for a real mode.
    """

    vectors: NDArray[np.complex128]
    dofs: tuple[str, ...]
    side: str
    assurance: Real
    collinearity: Real
    deviation: Real
    complexity: Real

    def most_alike(self, mode: int) -> tuple[int, float] | None:
        """The other mode with the largest MAC and that MAC; None where the mode is the only one."""
        others = self.assurance[mode].copy()
        others[mode] = -1.0
        return None if len(others) < 2 else (int(others.argmax()), float(others.max()))

    def alike(self, least: float = 0.9) -> tuple[tuple[int, int], ...]:
        """Pairs of modes whose MAC is ``least`` or more."""
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
    >>> shapes = np.array([[1, 2, 1], [1, 0, -1]]) * np.exp(0.3j)
    >>> poles = np.array([-1 + 100j, -1 + 180j])
    >>> model = ModalModel(poles, shapes, shapes[:, :1], ("1:+Z", "2:+Z", "3:+Z"), ("1:+Z",))
    >>> found = mode_shapes(model)
    >>> found.side, found.assurance.round(3).tolist(), found.collinearity.round(3).tolist()
    ('right', [[1.0, 0.0], [0.0, 1.0]], [1.0, 1.0])
    """
    right = len(model.responses) >= len(model.excitations)
    vectors, dofs = (model.right, model.responses) if right else (model.left, model.excitations)
    if len(dofs) < 2:
        raise InputError(f"the model has one degree of freedom, {dofs[0]}: a shape needs two or more")
    return ModeShapes(
        _upright(vectors),
        dofs,
        "right" if right else "left",
        modal_assurance(vectors, vectors),
        phase_collinearity(vectors),
        phase_deviation(vectors),
        mode_complexity(vectors),
    )


def _upright(vectors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    line = 0.5 * np.angle(np.sum(vectors**2, axis=1, keepdims=True))
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    turned = vectors * np.exp(-1j * line) / np.where(largest > 0, largest, 1.0)
    main = np.take_along_axis(turned, np.abs(turned).argmax(axis=1, keepdims=True), axis=1)
    return np.asarray(turned * np.where(main.real < 0, -1.0, 1.0))
