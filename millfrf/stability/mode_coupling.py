"""Mode coupling: growth without regeneration, and whether it sets a limit."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess, average_directional_matrix
from modal_fit import ModalModel

from .certification import certified_lobes
from .milling_loop import DelaySystem, delay_system, with_static_high_modes
from .tip_receptance import with_residual_flexibility


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


SAME = 0.1
"""Share by which two limits differ before the words call them different."""

_MODES = 10
"""Lowest modes whose coupling is judged."""


@dataclass(frozen=True)
class CouplingJudgement:
    """Limits of one cut with and without what could set it.

    Parameters
    ----------
    limit : m
        Certified limit of the whole structure; infinite where there is none, NaN where it is not known.
    alone : m
        Lowest certified limit of the modes one by one, each as if the structure had no other.
    without_regeneration : m
        Depth from which the cut grows if no tooth meets the waves of another; infinite where there is none.
    decides
        ``mode coupling``, ``coupled regeneration``, ``regeneration``, ``no limit`` or ``cannot tell``.
    words
        The judgement and its ground in one sentence.
    """

    limit: float
    alone: float
    without_regeneration: float
    decides: str
    words: str


def judge_mode_coupling(
    model: ModalModel, process: MillingProcess, speed: float, max_depth: float
) -> CouplingJudgement:
    """Compare the limit at one speed with those of single modes and of the cut without regeneration.

    One mode alone cannot couple: its limit is regenerative. ``mode coupling``: together the modes have a limit that
    lies a tenth or more below that of each alone, and they grow without regeneration too, at no more than 1.1 times
    the limit (:func:`mode_coupling_limit`). ``coupled regeneration``: single modes alone have another limit, but
    without regeneration the cut is stable there. Else ``regeneration``. The ten lowest modes are judged.

    Parameters
    ----------
    model
        Modal model over TCP X, Y, Z in the axes of the cut.
    process
        Cutter and engagement; helix, pitch and process damping are left out of the comparison.
    speed : rad/s
        Spindle speed of the cut.
    max_depth : m
        Largest depth that is searched.
    """
    plain = replace(process, helix_angle=0.0, pitch_angles=(), process_damping=0.0)
    natural = np.sort(model.natural_frequencies)
    small = with_static_high_modes(
        with_residual_flexibility(model), natural[min(_MODES, len(natural)) - 1] * (1 + 1e-9)
    )
    limit = _limit(small, plain, speed, max_depth)
    single = [_limit(_alone(small, mode), plain, speed, max_depth) for mode in range(len(small.poles))]
    alone = float(np.min(single))
    try:
        free = mode_coupling_limit(replace(small, residuals=None), plain, max_depth).depth
    except InputError:
        free = np.nan
    decides, ground = _judged(limit, alone, free, max_depth)
    words = f"at {speed * 30 / np.pi:.5g} rpm {ground}"
    return CouplingJudgement(limit, alone, free, decides, words)


def _limit(model: ModalModel, process: MillingProcess, speed: float, max_depth: float) -> float:
    """Verified limit, m; infinite where there is none, NaN where it is not verified."""
    found = certified_lobes(model, process, np.array([speed]), max_depth)
    return float(found.depth_limits[0]) if found.status[0] == "verified" else np.nan


def _alone(model: ModalModel, mode: int) -> ModalModel:
    """The structure with one mode, and nothing else that gives way."""
    one = slice(mode, mode + 1)
    return replace(model, poles=model.poles[one], right=model.right[one], left=model.left[one], residuals=None)


def _judged(limit: float, alone: float, free: float, max_depth: float) -> tuple[str, str]:
    """Which of the three decides, and why."""
    if np.isnan(limit) or np.isnan(alone):
        return "cannot tell", "it cannot be told whether mode coupling decides: a limit there is not verified"
    if limit == np.inf:
        return "no limit", f"there is no limit up to {_mm(max_depth)}: mode coupling decides nothing"
    least = f"above {_mm(max_depth)}" if alone == np.inf else _mm(alone)
    ground = f"the limit is {_mm(limit)}, that of each mode alone {'' if alone == np.inf else 'at least '}{least}, "
    ground += "and without regeneration the cut "
    ground += f"is stable up to {_mm(max_depth)}" if free == np.inf else f"grows from {_mm(free)} on"
    apart = abs(min(alone, max_depth) / limit - 1) > SAME
    if np.isnan(free):
        return "cannot tell", f"it cannot be told whether mode coupling decides: {ground}"
    if apart and alone > limit and free <= (1 + SAME) * limit:
        return "mode coupling", f"mode coupling decides: {ground}"
    if apart:
        way = "lowers" if alone > limit else "raises"
        return "coupled regeneration", f"coupling of modes {way} the regenerative limit: {ground}"
    return "regeneration", f"regeneration decides, mode coupling does not: {ground}"


def _mm(depth: float) -> str:
    return f"{1e3 * depth:.3g} mm"
