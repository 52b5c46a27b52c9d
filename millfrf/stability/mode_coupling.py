"""Mode coupling: growth without regeneration, and whether it determines a limit."""

from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, InputError, Real
from millfrf.cutting import MillingProcess, average_directional_matrix, refuse_varied
from modal_fit import ModalModel

from .certification import certified_numerics
from .milling_loop import DelaySystem, delay_system, with_static_high_modes
from .settings import SETTINGS
from .tip_receptance import with_residual_flexibility


@dataclass(frozen=True)
class ModeCouplingLimit:
    """Lowest depth at which a cut destabilises the structure if no tooth meets waves of an earlier tooth.

    It is no bound for regenerative cuts, whose force follows the motion minus the motion one tooth period ago. Their
    limits can be lower (waves feed chatter) or higher (at high speed the difference of both motions is small).

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


def mode_coupling_limit(model: ModalModel, process: MillingProcess, max_depth: float) -> ModeCouplingLimit:
    """Find the stability limit of ``x' = (A + B G C) x``, in which no tooth meets waves of another one.

    ``G = a (I - a D U)^-1 D`` with the mean cutting stiffness ``D = K_tc alpha_0`` per depth and the residual
    flexibility U, which follows the force without delay: ``F = a D (C x + U F)``.

    A robot's modes are far below the tooth passing frequency, so that the force is averaged over the tooth period. It
    then depends only on the tool's position. Force and motion have different directions, so that the matrix is not
    symmetric: the frequencies of two close modes approach each other until both modes form one growing mode (Pan,
    Zhang, Zhu & Wang 2006, Chatter analysis of robotic machining process; Cen & Melkote 2017 add damping, which the
    poles contain here). The spindle speed has no effect, because the delayed term is left out: each tooth is assumed to
    cut a surface without waves, as in a first cut or at very large feed. In ordinary cuts, where each tooth cuts the
    surface of the tooth before, the limits of :func:`certified_lobes` apply.

    Where ``I - a D U`` becomes singular the cutting stiffness exceeds that of the residual flexibility, and the limit
    is a fold there. Modes of the residual flexibility do not couple with each other.

    Parameters
    ----------
    model
        Structure at the tool tip.
    process
        Cutter and engagement; helix and pitch do not change the mean.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        A depth that is not positive, or a structure that cannot be used.

    Examples
    --------
    >>> stiff = ModalModel(np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",))
    >>> cut = MillingProcess(2, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
    >>> mode_coupling_limit(stiff, cut, 1e-3).kind
    'none'
    """
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise InputError(f"largest depth {max_depth!r} m must be positive")
    refuse_varied(process, "mode coupling", "give a cylindrical cutter", takes=("turning", "helix", "pitch", "damping"))
    system = delay_system(model, process)
    top = min(max_depth, _stiffness_lost(system))
    # closer and closer to the depth at which I - a D U is singular, which is not computed itself
    scan = np.append(np.linspace(0, top, 400, endpoint=top == max_depth), top * (1 - np.logspace(-3, -8, 6)))
    scan = np.unique(scan)[1:]
    unstable = np.flatnonzero(_growth(system, scan).real > 0)
    if not len(unstable):
        return ModeCouplingLimit(top, 0.0, "fold") if top < max_depth else ModeCouplingLimit(np.inf, np.nan, "none")
    high = float(scan[unstable[0]])
    low = float(scan[unstable[0] - 1]) if unstable[0] else 0.0
    while high - low > 1e-9 * max_depth:
        middle = (low + high) / 2
        if _growth(system, np.array([middle]))[0].real > 0:
            high = middle
        else:
            low = middle
    growing = complex(_growth(system, np.array([high]))[0])
    kind = "hopf" if abs(growing.imag) > 1e-6 * abs(system.poles).max() else "fold"
    return ModeCouplingLimit(high, abs(growing.imag) / (2 * np.pi), kind)


def _stiffness_lost(system: DelaySystem) -> float:
    """Return the depth (m) at which the mean cutting stiffness reaches that of the residual flexibility."""
    values = np.linalg.eigvals(system.process.ktc * average_directional_matrix(system.process) @ system.upper)
    real = values.real[np.abs(values.imag) <= 1e-9 * np.abs(values)]
    return float(1 / real.max()) if real.max(initial=0.0) > 0 else np.inf


def _growth(system: DelaySystem, depths: Real) -> Complex:
    """Compute the eigenvalue with the largest real part at each depth, rad/s."""
    stiffness = system.process.ktc * average_directional_matrix(system.process)
    force = depths[:, None, None] * stiffness
    force = np.asarray(np.linalg.solve(np.eye(3) - force @ system.upper, force))
    values = np.linalg.eigvals(system.state_matrix + system.input_matrix @ force @ system.output_matrix)
    return np.asarray(np.take_along_axis(values, values.real.argmax(axis=1)[:, None], axis=1)[:, 0], dtype=complex)


@dataclass(frozen=True)
class CouplingJudgement:
    """Comparison of the limit of a cut with the limits of single modes and of the cut without regeneration.

    Parameters
    ----------
    limit : m
        Certified limit of the whole structure; infinite where there is none, NaN where it is not known.
    alone : m
        Lowest certified limit of structures that have a single mode each.
    without_regeneration : m
        Depth above which vibration grows if no tooth meets waves of an earlier tooth; infinite: no such depth.
    decides
        ``mode coupling``, ``coupled regeneration``, ``regeneration``, ``no limit`` or ``cannot tell``.
    words
        The result and its reason in one sentence.
    """

    limit: float
    alone: float
    without_regeneration: float
    decides: str
    words: str


def judge_mode_coupling(
    model: ModalModel, process: MillingProcess, speed: float, max_depth: float
) -> CouplingJudgement:
    """Compare the limit at one speed with the limits of single modes and of the cut without regeneration.

    A single mode cannot couple: its limit is regenerative. ``mode coupling``: the limit of all modes is at least a
    tenth below the limit of each single mode, and without regeneration the cut is unstable at 1.1 times the limit
    (:func:`mode_coupling_limit`). ``coupled regeneration``: the limit differs from those of single modes, but without
    regeneration the cut is stable there. Otherwise ``regeneration``. The ten lowest modes are compared.

    Parameters
    ----------
    model
        Modal model over TCP X, Y, Z in the axes of the cut.
    process
        Cutter and engagement; helix, pitch and process damping are ignored.
    speed : rad/s
        Spindle speed of the cut.
    max_depth : m
        Largest depth that is searched.
    """
    plain = replace(process, helix_angle=0.0, pitch_angles=(), process_damping=0.0)
    natural = np.sort(model.natural_frequencies)
    highest = natural[min(SETTINGS.coupled_modes, len(natural)) - 1] * (1 + 1e-9)
    reduced = with_static_high_modes(with_residual_flexibility(model), highest)
    limit = _limit(reduced, plain, speed, max_depth)
    single = [_limit(_single_mode(reduced, mode), plain, speed, max_depth) for mode in range(len(reduced.poles))]
    alone = float(np.min(single))
    unregenerated = mode_coupling_limit(reduced, plain, max_depth).depth
    decides, reason = _judged(limit, alone, unregenerated, max_depth)
    return CouplingJudgement(limit, alone, unregenerated, decides, f"at {speed * 30 / np.pi:.5g} rpm {reason}")


def _limit(model: ModalModel, process: MillingProcess, speed: float, max_depth: float) -> float:
    """Return the verified limit at one speed, m; infinite: no limit; NaN: the limit could not be verified."""
    lobes = certified_numerics(model, process, np.array([speed]), max_depth)
    return float(lobes.depth_limits[0]) if lobes.status[0] == "verified" else np.nan


def _single_mode(model: ModalModel, mode: int) -> ModalModel:
    """Return the structure with a single mode and without residual flexibility."""
    rows = slice(mode, mode + 1)
    return replace(model, poles=model.poles[rows], right=model.right[rows], left=model.left[rows], residuals=None)


def _judged(limit: float, alone: float, unregenerated: float, max_depth: float) -> tuple[str, str]:
    """Return what decides the limit, and the reason in one sentence."""
    if np.isnan(limit) or np.isnan(alone):
        return "cannot tell", "it is not known whether mode coupling decides: a limit is not verified"
    if limit == np.inf:
        return "no limit", f"there is no limit up to {_mm(max_depth)}: mode coupling decides nothing"
    single = f"above {_mm(max_depth)}" if alone == np.inf else f"at least {_mm(alone)}"
    growth = f"is stable up to {_mm(max_depth)}" if unregenerated == np.inf else f"grows from {_mm(unregenerated)} on"
    reason = f"the limit is {_mm(limit)}, that of each mode alone {single}, and without regeneration the cut {growth}"
    different = abs(min(alone, max_depth) / limit - 1) > SETTINGS.equal_limits
    if different and alone > limit and unregenerated <= (1 + SETTINGS.equal_limits) * limit:
        return "mode coupling", f"mode coupling decides: {reason}"
    if different:
        effect = "lowers" if alone > limit else "raises"
        return "coupled regeneration", f"coupling of modes {effect} the regenerative limit: {reason}"
    return "regeneration", f"regeneration decides, mode coupling does not: {reason}"


def _mm(depth: float) -> str:
    return f"{1e3 * depth:.3g} mm"
