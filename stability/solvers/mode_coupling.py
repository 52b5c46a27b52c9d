"""Mode coupling: growth in a cut without regeneration, of robots whose lowest modes are soft and close."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, average_directional_matrix
from foundation import InputError
from modal_fit import ModalModel

from ..milling_loop.delayed_state import DelaySystem, delay_system

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ModeCouplingLimit:
    """Lowest depth at which a cut destabilises the structure if no tooth meets waves that another one left.

    It is no bound of regenerative cuts, in which the force follows the difference of the motion from that of a tooth
    period ago: their limits can lie below it (waves feed chatter) or above it (fast teeth see no difference).

    Parameters
    ----------
    depth : m
        Lowest unstable depth; infinite where there is none up to the largest depth.
    frequency : Hz
        Frequency of the growing vibration; 0 where the tool is drawn in without oscillation; NaN where there is no
        limit.
    kind
        ``hopf`` (two modes couple), ``fold`` (cutting stiffness exceeds the structure's), ``none``.
    """

    depth: float
    frequency: float
    kind: str


def mode_coupling_limit(
    model: ModalModel, process: MillingProcess, max_depth: float, *, n_depths: int = 400
) -> ModeCouplingLimit:
    """Judge the stability of ``x' = (A + a K_tc B alpha_0 C) x``: the mean force follows the tool's place alone.

    The robot's modes lie far below tooth passing, so that the force is its average over the tooth; the force's
    direction differs from the motion's, the matrix is not symmetric, and two close modes are drawn together until
    they form one that grows (Pan, Zhang, Zhu & Wang 2006, Chatter analysis of robotic machining process; Cen &
    Melkote 2017, who add damping, as the poles do here). Spindle speed plays no part, because the delayed term is left
    out: each tooth is taken to cut a surface without waves, as in a first cut, or with a feed so large that no tooth
    meets what another one left. Where teeth follow each other the limits of :func:`certified_lobes` hold.

    Parameters
    ----------
    model
        Structure at the tool tip, without residual flexibility.
    process
        Cutter and engagement; helix and pitch do not change the mean.
    max_depth : m
        Largest axial depth that is searched.
    n_depths
        Number of steps of the scan; the limit is then halved to 1e-9 of ``max_depth``.

    Raises
    ------
    InputError
        A depth that is not positive, a structure that cannot be used or has a residual flexibility.

    Examples
    --------
    >>> stiff = ModalModel(np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",))
    >>> cut = MillingProcess(2, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
    >>> mode_coupling_limit(stiff, cut, 1e-3).kind
    'none'
    """
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise InputError(f"largest depth {max_depth!r} m must be positive")
    system = delay_system(model, process)
    if system.upper.any():
        raise InputError("mode coupling cannot take a residual flexibility; fit a further mode instead")
    scan = np.linspace(0, max_depth, n_depths + 1)[1:]
    unstable = np.flatnonzero(_growth(system, scan).real > 0)
    if not len(unstable):
        return ModeCouplingLimit(np.inf, np.nan, "none")
    high = float(scan[unstable[0]])
    low = high - max_depth / n_depths
    while high - low > 1e-9 * max_depth:
        middle = (low + high) / 2
        if _growth(system, np.array([middle]))[0].real > 0:
            high = middle
        else:
            low = middle
    growing = complex(_growth(system, np.array([high]))[0])
    kind = "hopf" if abs(growing.imag) > 1e-6 * abs(system.poles).max() else "fold"
    return ModeCouplingLimit(high, abs(growing.imag) / (2 * np.pi), kind)


def _growth(system: DelaySystem, depths: Real) -> NDArray[np.complex128]:
    """Eigenvalue with the largest real part at each depth, rad/s."""
    cutting = system.process.ktc * system.input_matrix @ average_directional_matrix(system.process)
    values = np.linalg.eigvals(system.state_matrix + depths[:, None, None] * (cutting @ system.output_matrix))
    return np.asarray(np.take_along_axis(values, values.real.argmax(axis=1)[:, None], axis=1)[:, 0], dtype=complex)
