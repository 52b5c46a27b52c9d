"""Spindle orders of the forces of one cut, with what is known of it."""

from dataclasses import dataclass

from millfrf.core import Complex, Real
from millfrf.cutting import MillingProcess


@dataclass(frozen=True)
class CutForces:
    """Spindle orders of the forces of one cut, with what is known of the cut.

    Parameters
    ----------
    name
        Name of the recording.
    process
        Cutter, engagement and feed of this cut.
    depth : m
        Axial depth of cut.
    mean, error : (n_orders, n_axes), N
        Fourier coefficients over a revolution and their standard errors, orders 0, 1, 2 ...
    drift : (n_axes,), N
        Drift of the mean force over the recording.
    axes : (n_axes,)
        Directions of the forces: 0, 1, 2 for X, Y, Z.
    turning : (n_speeds,), Hz
        Spindle frequencies, each for an equal share of the recording.
    transfer : (n_orders, n_axes, n_axes)
        Measured over applied force at each order; None: not known, the dynamometer is taken as rigid.
    doubts
        Sentences on what the recording leaves open.
    """

    name: str
    process: MillingProcess
    depth: float
    mean: Complex
    error: Real
    drift: Real
    axes: tuple[int, ...]
    turning: Real
    transfer: Complex | None = None
    doubts: tuple[str, ...] = ()

    @property
    def top(self) -> int:
        """Highest spindle order."""
        return len(self.mean) - 1
