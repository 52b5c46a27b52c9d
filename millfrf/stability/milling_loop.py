"""The regenerative milling loop as a delayed state equation with periodic coefficients."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from millfrf.core import Complex, Index, Real
from millfrf.core.compilation import STABILITY, compile_kernels
from millfrf.cutting import MillingProcess, directional_matrix, thin_chip_immersions
from modal_fit import ModalModel, Residuals

from .settings import SETTINGS
from .tip_receptance import check_modes, lost_share, tool_directions, with_residual_flexibility


@dataclass(frozen=True, eq=False)  # compared by identity, so that what follows from a system is remembered
class DelaySystem:
    """Regenerative milling of a modal structure, ``q' = p q + left F`` and ``X = 2 Re(right q) + upper F``.

    With ``F = a K_tc alpha(t) (X(t) - X(t - tau))`` and x = (Re q, Im q) this is
    ``x' = A x + a B D(t) C (x - x_tau)``, D = K_tc alpha (Insperger & Stepan, Semi-Discretization for Time-Delay
    Systems, section 5.3, for modal coordinates and vectors that need not be reciprocal).
    """

    poles: Complex  # (n_modes,), rad/s: upper half of each conjugate pair, all decaying
    right: Complex  # (n_modes, 3): vectors at the tool in X, Y, Z; zero in a direction that was not measured (rigid)
    left: Complex  # (n_modes, 3), as `right`
    upper: Real  # (3, 3), m/N: residual flexibility, zero if the model has none
    process: MillingProcess
    warnings: tuple[str, ...] = ()

    @property
    def state_matrix(self) -> Real:
        """Return the state matrix A, shape (2 n_modes, 2 n_modes), 1/s."""
        decay, turn = np.diag(self.poles.real), np.diag(self.poles.imag)
        return np.asarray(np.block([[decay, -turn], [turn, decay]]))

    @property
    def input_matrix(self) -> Real:
        """Return the input matrix B from forces in X, Y, Z, shape (2 n_modes, 3)."""
        return np.concatenate([self.left.real, self.left.imag])

    @property
    def output_matrix(self) -> Real:
        """Return the output matrix C to the tool's motion in X, Y, Z, shape (3, 2 n_modes)."""
        return np.asarray(2 * np.concatenate([self.right.real, -self.right.imag]).T)

    def receptance(self, omega: Real) -> Complex:
        """Return the receptance at the tool at frequencies (n,) of either sign, rad/s, shape (n, 3, 3), m/N."""
        s, products = 1j * omega[:, None], (self.right[:, :, None] * self.left[:, None, :]).reshape(-1, 9)
        values = (1 / (s - self.poles)) @ products + (1 / (s - self.poles.conj())) @ products.conj()
        return np.asarray(values.reshape(-1, 3, 3) + self.upper)

    def cutting_stiffness(self, angles: Real) -> Real:
        """Return ``D = K_tc alpha`` at spindle angles (n,), rad, shape (n, 3, 3), N/m per m of depth."""
        return self.process.ktc * directional_matrix(self.process, angles)


def delay_system(model: ModalModel, process: MillingProcess) -> DelaySystem:
    """Express a modal model in the tool's X, Y, Z, and combine it with a process.

    A residual flexibility is kept. A residual inertia is left out with a warning: it stands for a rigid body that
    would drift away. The out-of-band terms of a fit count as a residual flexibility
    (:func:`with_residual_flexibility`), with a warning where they shape the FRF inside the band.

    Parameters
    ----------
    model
        Receptance in m/N at the tool, the only node that is excited.
    process
        Cutter and engagement.

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
    directions = tool_directions(model)
    check_modes(model)
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
        if (share := lost_share(model)) > SETTINGS.lost_share:
            warnings += (
                f"modes just outside the fitted band make {100 * share:.0f} % of the FRF at the resonances inside it, "
                "and limits leave that out; fit a wider band",
            )
    missed = process.missed_shares
    if not process.runout_decides and np.mean(missed) > SETTINGS.certain:
        warnings += (
            f"runout of {1e6 * process.runout:.3g} um takes a tooth out of {100 * max(missed):.0f} % of its cut, and "
            "limits leave that out: check runout_m and feed_per_tooth_m, or true the cutter",
        )
    right, left = directions.responses.place(model.right), directions.excitations.place(model.left)
    return DelaySystem(model.poles, right, left, directions.place(upper), process, warnings)


@dataclass(frozen=True)
class Piece:
    """An interval of the period in which the same teeth cut."""

    begin: float  # rad, spindle angle from the beginning of the period
    end: float
    immersions: tuple[float, ...]  # rad, immersion angle of each engaged tooth at ``begin``

    def split(self, count: int) -> list["Piece"]:
        """Divide the interval into ``count`` equal pieces."""
        edges = np.linspace(self.begin, self.end, count + 1)
        return [
            Piece(float(a), float(b), tuple(phi + float(a) - self.begin for phi in self.immersions))
            for a, b in pairwise(edges)
        ]


def engagement_pieces(process: MillingProcess) -> list[Piece]:
    """List the pieces of one tooth period in which teeth cut; the spindle angle is 0 where a tooth enters.

    A piece ends where a tooth enters or leaves, and where the chip law would not be smooth.

    Examples
    --------
    >>> slot_of_three = MillingProcess(3, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
    >>> [(round(p.begin, 3), round(p.end, 3), len(p.immersions)) for p in engagement_pieces(slot_of_three)]
    [(0.0, 1.047, 2), (1.047, 2.094, 1)]
    """
    pitch = 2 * np.pi / process.teeth
    width = process.exit_angle - process.start_angle
    thin = [float(np.mod(mark - process.start_angle, pitch)) for mark in thin_chip_immersions(process, 0)]
    edges = sorted([0.0, float(np.mod(width, pitch)), *thin, pitch])
    pieces = []
    for begin, end in pairwise(edges):
        middle = (begin + end) / 2
        engaged = [k for k in range(process.teeth) if middle + k * pitch < width]
        if engaged and end - begin > 1e-9 * pitch:
            pieces.append(Piece(begin, end, tuple(process.start_angle + begin + k * pitch for k in engaged)))
    return pieces


def with_static_high_modes(model: ModalModel, highest_frequency: float) -> ModalModel:
    """Return the model with the modes above a frequency replaced by their flexibility at 0 Hz.

    The flexibility is ``R = 2 Re sum_r right_r left_r^T / (-pole_r)`` over the replaced modes r. At a limit with
    chatter frequency f, about ``(f / f_r)^2`` of the effect of mode r is lost; compare with limits from more modes.

    Parameters
    ----------
    model
        Any modal model.
    highest_frequency : Hz
        Natural frequency up to which modes are kept; the lowest mode is always kept.

    Examples
    --------
    >>> poles = np.array([-2 + 100j, -20 + 9000j])
    >>> model = ModalModel(poles, np.array([[-1e-4j], [-1e-5j]]), np.ones((2, 1)) + 0j, ("T:+X",), ("T:+X",))
    >>> small = with_static_high_modes(model, 100.0)
    >>> len(small.poles), np.allclose(small.receptance(np.zeros(1)), model.receptance(np.zeros(1)))
    (1, True)
    """
    low = model.natural_frequencies <= max(highest_frequency, float(model.natural_frequencies.min()))
    if low.all():
        return model
    flexible = 2 * np.real(np.einsum("rp,rq->pq", model.right[~low] / -model.poles[~low, None], model.left[~low]))
    if model.residuals is None:
        residuals = Residuals(flexible, np.zeros_like(flexible))
    else:
        residuals = replace(model.residuals, upper=model.residuals.upper + flexible)
    return replace(model, poles=model.poles[low], right=model.right[low], left=model.left[low], residuals=residuals)


def speed_groups(speeds: Real, ratio: float) -> list[Index]:
    """Group the indices of speeds, increasing, so that speeds of a group differ by less than ``ratio``.

    The speeds of a group share their nodes.
    """
    band = np.floor(np.log(speeds / speeds.min()) / np.log(ratio)).astype(int)
    order = np.lexsort([speeds, band])
    return np.split(order, np.flatnonzero(np.diff(band[order])) + 1)
