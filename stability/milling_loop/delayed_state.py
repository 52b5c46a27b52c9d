"""The milling loop as a delayed state equation with periodic coefficients."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, directional_matrix
from foundation import InputError
from modal_fit import ModalModel

from .beyond_band import lost_inside, with_residual_flexibility
from .tip_receptance import tool_directions

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

LOST = 0.1
"""Share of the FRF at the resonances that may be left out without a word; a limit moves by about as much."""


@dataclass(frozen=True)
class DelaySystem:
    """Regenerative milling of a modal structure, ``q' = p q + left F`` and ``X = 2 Re(right q) + upper F``.

    With ``F = a K_tc alpha(t) (X(t) - X(t - tau))`` and x = (Re q, Im q) this is
    ``x' = A x + a B D(t) C (x - x_tau)``, D = K_tc alpha (Insperger & Stepan, Semi-Discretization for Time-Delay
    Systems, section 5.3, for modal coordinates and vectors that need not be reciprocal).

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Upper half of each conjugate pair, all decaying.
    right, left : (n_modes, 3)
        Vectors at the tool in X, Y, Z; zero in a direction that was not given (rigid there).
    upper : (3, 3), m/N
        Residual flexibility, zero if the model has none.
    process
        Cutter and engagement.
    warnings
        One sentence each.
    """

    poles: Complex
    right: Complex
    left: Complex
    upper: Real
    process: MillingProcess
    warnings: tuple[str, ...] = ()

    @property
    def state_matrix(self) -> Real:
        """A, shape (2 n_modes, 2 n_modes), 1/s."""
        decay, turn = np.diag(self.poles.real), np.diag(self.poles.imag)
        return np.asarray(np.block([[decay, -turn], [turn, decay]]))

    @property
    def input_matrix(self) -> Real:
        """B, shape (2 n_modes, 3)."""
        return np.concatenate([self.left.real, self.left.imag])

    @property
    def output_matrix(self) -> Real:
        """C, shape (3, 2 n_modes)."""
        return np.asarray(2 * np.concatenate([self.right.real, -self.right.imag]).T)

    def cutting_stiffness(self, angles: Real) -> Real:
        """D at spindle angles (n,), rad: K_tc alpha, shape (n, 3, 3), N/m per m of depth."""
        return self.process.ktc * directional_matrix(self.process, angles)


def delay_system(model: ModalModel, process: MillingProcess, *, node: str | None = None) -> DelaySystem:
    """Bring a modal model to the tool's X, Y, Z and join it with a process.

    A residual flexibility is kept; a residual inertia is left out with a warning: it stands for a body that would
    drift away. The out-of-band terms of a fit, whose poles lie outside its band, count as one residual flexibility
    (:func:`with_residual_flexibility`), with a warning where they shape the FRF inside the band.

    Parameters
    ----------
    model
        Receptance in m/N at the tool.
    process
        Cutter and engagement.
    node
        Name of the tool's node; None: the excitations' only node.

    Raises
    ------
    InputError
        No receptance, no mode, an unstable structure or no direction at the tool.

    Examples
    --------
    >>> mode = ModalModel(np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",))
    >>> cut = MillingProcess(2, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
    >>> delay_system(mode, cut).state_matrix
    array([[  -2., -100.],
           [ 100.,   -2.]])
    """
    directions = tool_directions(model, node)
    if not len(model.poles):
        raise InputError("the modal model has no mode; fit at least one")
    poles, right, left = model.poles, model.right, model.left
    upper = np.zeros((len(model.responses), len(model.excitations)))
    warnings: tuple[str, ...] = ()
    residuals = with_residual_flexibility(model).residuals
    if residuals is not None:
        upper = residuals.upper
        if residuals.lower.any():
            warnings = (
                "what modes below the fitted band add (the residual inertia) is not in the limits: those whose chatter "
                "frequency is near the band's lower end may be off; fit from a lower frequency",
            )
        if (share := lost_inside(model)) > LOST:
            warnings += (
                f"modes just outside the fitted band make {100 * share:.0f} % of the FRF at the resonances inside it, "
                "and limits leave that out; fit a wider band",
            )
    if poles.real.max() >= 0:
        worst = poles[poles.real.argmax()]
        raise InputError(f"the structure itself is unstable: pole {worst:.4g} rad/s does not decay; fit again")
    return DelaySystem(
        poles, directions.place_rows(right), directions.place_columns(left), directions.place(upper), process, warnings
    )
