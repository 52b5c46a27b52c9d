"""The regenerative milling loop as a delayed state equation with periodic coefficients."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from millfrf.core import Complex, InputError, Real
from millfrf.core.compilation import STABILITY, compile_kernels
from millfrf.cutting import MillingProcess, directional_matrix
from modal_fit import ModalModel, Residuals

from .tip_receptance import lost_inside, tool_directions, with_residual_flexibility

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
    compile_kernels(*STABILITY)
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


@dataclass(frozen=True)
class Piece:
    """A stretch of the period in which the same teeth cut.

    Parameters
    ----------
    begin, end : rad
        Spindle angles of begin and end, from the beginning of the period.
    immersions : rad
        Immersion angle of each engaged tooth at ``begin``.
    """

    begin: float
    end: float
    immersions: tuple[float, ...]

    def split(self, count: int) -> list["Piece"]:
        """Cut into ``count`` equal pieces."""
        edges = np.linspace(self.begin, self.end, count + 1)
        return [
            Piece(float(a), float(b), tuple(phi + float(a) - self.begin for phi in self.immersions))
            for a, b in pairwise(edges)
        ]


def engagement_pieces(process: MillingProcess) -> list[Piece]:
    """Pieces of one tooth period (spindle angle 0 ... 2 pi / N, 0 where a tooth enters) with a tooth in the cut.

    Examples
    --------
    >>> slot_of_three = MillingProcess(3, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
    >>> [(round(p.begin, 3), round(p.end, 3), len(p.immersions)) for p in engagement_pieces(slot_of_three)]
    [(0.0, 1.047, 2), (1.047, 2.094, 1)]
    """
    pitch = 2 * np.pi / process.teeth
    width = process.exit_angle - process.start_angle
    edges = [0.0, float(np.mod(width, pitch)), pitch]
    pieces = []
    for begin, end in pairwise(edges):
        middle = (begin + end) / 2
        engaged = [k for k in range(process.teeth) if middle + k * pitch < width]
        if engaged and end - begin > 1e-9 * pitch:
            pieces.append(Piece(begin, end, tuple(process.start_angle + begin + k * pitch for k in engaged)))
    return pieces


def with_static_high_modes(model: ModalModel, highest_frequency: float) -> ModalModel:
    """The model without the modes above a frequency, whose flexibility at 0 Hz stays.

    ``R = 2 Re sum_r right_r left_r^T / (-pole_r)`` over the modes left out. A limit at frequency f loses about
    ``(f / f_r)^2`` of what such a mode does; whether that matters shows in limits with more modes.

    Parameters
    ----------
    model
        Any modal model.
    highest_frequency : Hz
        Natural frequency up to which modes are kept; at least one is.

    Examples
    --------
    >>> poles = np.array([-2 + 100j, -20 + 9000j])
    >>> model = ModalModel(poles, np.array([[-1e-4j], [-1e-5j]]), np.ones((2, 1)) + 0j, ("T:+X",), ("T:+X",))
    >>> small = with_static_high_modes(model, 100.0)
    >>> len(small.poles), np.allclose(small.receptance(np.zeros(1)), model.receptance(np.zeros(1)))
    (1, True)
    """
    kept = model.natural_frequencies <= max(highest_frequency, float(model.natural_frequencies.min()))
    if kept.all():
        return model
    out = ~kept
    flexible = 2 * np.real(np.einsum("rp,rq->pq", model.right[out] / -model.poles[out, None], model.left[out]))
    known = model.residuals
    if known is None:
        residuals = Residuals(flexible, np.zeros_like(flexible))
    else:
        residuals = replace(known, upper=known.upper + flexible)
    return replace(model, poles=model.poles[kept], right=model.right[kept], left=model.left[kept], residuals=residuals)
