"""`MatrixFit`: what a fit of an FRF matrix gives, and how far its refinement goes."""

from dataclasses import dataclass

from ..models import ModalModel
from ..stabilisation import PoleGroup, StabilisationChart

STEPS = 40
"""Steps of a refinement at most."""

TOLERANCE = 1e-7
"""Relative fall of the misfit below which a refinement ends."""

REFINED = "refined"
NOT_REFINED = "poly-reference poles"


@dataclass(frozen=True)
class MatrixFit:
    """A fit of an FRF matrix.

    Parameters
    ----------
    model
        Modes, residuals, errors.
    chart
        Poles over order.
    refused
        Groups of poles that are no modes, each with its reason.
    chi_square
        Misfit over the noise expected.
    status
        ``refined``, or ``poly-reference poles`` where the refinement did not hold on held-out lines.
    converged
        Whether the refinement came to its end.
    """

    model: ModalModel
    chart: StabilisationChart
    refused: tuple[PoleGroup, ...]
    chi_square: float
    status: str
    converged: bool
