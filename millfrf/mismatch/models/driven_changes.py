"""Derivatives of a joint's driven motion by the fitted parameters."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from ..joints.joint_reach import JointPath, combined_model
from ..joints.modal_filters import ModalFilters, modal_filters
from .hypothesis import Hypothesis
from .modal_lines import displacement_at, outside_displacement
from .modal_loops import driven_basis, modal_displacement
from .model_shape import ModelShape, OutsideBand


def driven_mix(shape: ModelShape, model: ModalModel, along: Real) -> Real:
    """How signals make up the changes of a deflection by u, (n_signals, size).

    The signals are, for each mode, the two of its pole and 2 m of its shapes, as
    :func:`millfrf.mismatch.models.modal_loops.driven_basis` writes them; behind those of all modes, the forces through
    each of the
    terms that stand for modes outside the band.
    """
    n, m = shape.nominal.right.shape[1], shape.nominal.left.shape[1]
    each, per = 2 + 2 * m, 2 + 2 * n + 2 * m
    poles = shape.pole_units(model)
    units = shape.scales()
    ahead = model.right @ along
    mix = np.zeros((len(model.poles) * each, len(model.poles) * per))
    for r in range(len(model.poles)):
        own = mix[r * each : (r + 1) * each, r * per : (r + 1) * per]
        own[:2, :2] = [[unit[r].real for unit in poles], [unit[r].imag for unit in poles]]
        even, odd = np.arange(2, 2 + m), np.arange(2 + m, each)
        left, rho = model.left[r, :m], ahead[r]
        for p in range(n):
            share = units[0][r] * along[p]
            own[even, 2 + p], own[odd, 2 + p] = share * left.real, share * left.imag
            own[even, 2 + n + p], own[odd, 2 + n + p] = -share * left.imag, share * left.real
        first = 2 + 2 * n + np.arange(m)
        own[even, first], own[odd, first] = units[1][r] * rho.real, units[1][r] * rho.imag
        own[even, first + m], own[odd, first + m] = -units[1][r] * rho.imag, units[1][r] * rho.real
    if shape.outside is None:
        return mix
    terms = shape.outside.units * along[:n, None]
    beyond = np.zeros((len(terms) * m, shape.size - mix.shape[1]))
    for t, q in np.ndindex(len(terms), m):
        beyond[t * m + q, (t * n + np.arange(n)) * m + q] = terms[t, :, q]
    whole = np.zeros((len(mix) + len(beyond), shape.size))
    whole[: len(mix), : mix.shape[1]] = mix
    whole[len(mix) :, mix.shape[1] :] = beyond
    return whole


Signals = NDArray[np.float32]

SLOW = 0.6
"""Largest step of a pole, ``|p| h``, at which a mode is followed in time; faster ones are transformed."""


@dataclass(frozen=True)
class Moved:
    """A change of the forces that drive joints.

    Parameters
    ----------
    push : (n_excitations, 1) or (n_lines, n_excitations)
        The excitations by a unit of each signal, or one signal's own force at padded lines, N.
    spectra : (n_lines, n_signals) or None
        Spectra of the signals; None where ``push`` is the signal itself.
    mix : (n_signals, size)
        How they make up the change by all that is fitted.
    """

    push: NDArray[np.number]
    spectra: NDArray[np.complexfloating] | None
    mix: Real


@dataclass(frozen=True)
class Driving:
    """What drives a joint, at padded lines.

    Parameters
    ----------
    force : (n_lines, n_excitations), N
        Outer force, less those of the joints before.
    joints
        Force (n_lines,) of each joint before, N, and the excitations by a unit of it.
    moved
        Changes of this force.
    """

    force: Complex
    joints: tuple[tuple[Complex, Real], ...]
    moved: tuple[Moved, ...]


@dataclass(frozen=True)
class DrivenChange:
    """Derivative of a joint's driven motion.

    Parameters
    ----------
    filters
        Signals that are modal filters.
    given
        All other signals: changes of deflection (m) and, where wanted, velocity (m/s), each (n, n_given).
    mix : (n_signals, size)
        How both together make up the change by all that is fitted.
    """

    filters: ModalFilters
    given: tuple[Signals, Signals]
    mix: Real


@dataclass(frozen=True)
class DrivenJoint:
    """A joint at which the derivative of the driven motion is taken.

    Parameters
    ----------
    path
        How it reaches the model.
    force : (n_lines,), N
        Its force at padded lines.
    angles
        Column of its first angle among all that is fitted.
    """

    path: JointPath
    force: Complex
    angles: int


def driven_change(
    hypothesis: Hypothesis, joint: DrivenJoint, driving: Driving, lines: WindowedSpectrum, size: tuple[int, bool]
) -> DrivenChange:
    """Derivative of a joint's driven motion by all that is fitted.

    A mode of n responses and m excitations has ``2 + 2 n + 2 m`` numbers, and ``2 + 2 m`` signals; the terms that
    stand for modes outside the band have m signals each. The joint's own force moves it through the modes alone, as in
    the free simulation, and so these terms see the outer force alone.

    Parameters
    ----------
    hypothesis
        Hypothesis at which the derivative is taken.
    joint
        The joint whose driven motion changes.
    driving
        Forces at padded lines that drive it, and their changes.
    lines
        Windowed spectrum of the recording.
    size
        Instants for each sample, and whether velocities are wanted.
    """
    often, rates = size
    shape, model, along = hypothesis.shape, hypothesis.reach.model, joint.path.along
    frequencies, m = lines.padded_frequencies[: len(driving.force)], shape.nominal.left.shape[1]
    felt = driving.force - joint.force[:, None] * joint.path.push
    step = 1 / (often * lines.recording.rate)
    slow = np.abs(model.poles) * step <= SLOW
    sources, pushes = _sources(model, (felt, m), (*driving.joints, (joint.force, joint.path.push)))
    modes = (model.poles[slow], pushes[slow], (model.right @ along)[slow])
    filters = modal_filters(often * sources, (often * lines.padded, step), modes, (m, rates))
    # modes outside the band take no part in a joint inside
    outside = None if joint.path.axis.scales is not None else shape.outside
    signals: list[NDArray[np.complexfloating]] = [
        _fast_signals(model, ~slow, frequencies, (felt, m), along),
        _outside_signals(outside, frequencies, driving.force[:, :m]),
        _angle_signals(model, joint, frequencies, driving.force, (sources, pushes)),
    ]
    turns = np.eye(signals[-1].shape[1], hypothesis.size, joint.angles)
    signals += [_moved_signal(model, moved, frequencies, along) for moved in driving.moved]
    modal = np.pad(driven_mix(shape, model, along), ((0, 0), (0, hypothesis.size - shape.size)))
    modal = modal if outside is not None else modal[: len(slow) * (2 + 2 * m)]
    mix = [modal[_order(slow, m, len(modal))], turns, *(moved.mix for moved in driving.moved)]
    return DrivenChange(filters, _in_time(signals, lines, size), np.vstack(mix))


def _sources(
    model: ModalModel, felt: tuple[Complex, int], joints: tuple[tuple[Complex, Real], ...]
) -> tuple[Complex, Complex]:
    """The few forces that drive the modes, (n_lines, n_sources), and each mode's push by them (n_modes, n_sources).

    On the model's own m excitations they are what the modes feel; what joints do inside is the force of each joint.
    """
    force, m = felt
    inside = [(one, push) for one, push in joints if push[m:].any()]
    sources = np.column_stack([force[:, :m], *(one for one, _ in inside)])
    pushes = [model.left[:, :m], *(-(model.left[:, m:] @ push[m:])[:, None] for _, push in inside)]
    return sources, np.hstack(pushes)


def _order(slow: NDArray[np.bool_], m: int, count: int) -> NDArray[np.int64]:
    """Places of the signals of :func:`driven_mix` in the order of this file: filters, then what is transformed."""
    rows = np.arange(len(slow) * (2 + 2 * m)).reshape(len(slow), 2 + 2 * m)
    own = rows[slow]
    first = [own[:, 2 : 2 + m].ravel(), own[:, 0], own[:, 2 + m :].ravel(), own[:, 1]]
    return np.concatenate([*first, rows[~slow].ravel(), np.arange(rows.size, count)])


def _fast_signals(
    model: ModalModel, chosen: NDArray[np.bool_], frequencies: Real, felt: tuple[Complex, int], along: Real
) -> Complex:
    """Signals of modes that are too fast to be followed in time."""
    force, m = felt
    signals = np.empty((len(frequencies), int(chosen.sum()) * (2 + 2 * m)), dtype=complex)
    if chosen.any():
        modes = (model.poles[chosen], model.left[chosen], (model.right @ along)[chosen])
        s = np.asarray(2j * np.pi * frequencies, dtype=complex)
        driven_basis(s, np.ascontiguousarray(force), modes, m, signals)
    return signals


def _outside_signals(outside: OutsideBand | None, frequencies: Real, outer: Complex) -> Complex:
    """The outer force through each of the terms that stand for modes outside the band."""
    if outside is None:
        return np.zeros((len(outer), 0), dtype=complex)
    basis = outside.basis(np.asarray(2j * np.pi * frequencies, dtype=complex))
    return np.concatenate([one[:, None] * outer for one in basis], axis=1)


def _angle_signals(
    model: ModalModel, joint: DrivenJoint, frequencies: Real, outer: Complex, driven: tuple[Complex, Complex]
) -> Complex:
    """What turns of the joint's axis change: where it is seen, and where it pushes.

    Its own force moves a joint through the modes alone, as in the free simulation.
    """
    (sources, pushes), path = driven, joint.path
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    seen, pushing = path.rows @ path.axis.turns, path.columns @ path.axis.turns
    signals, pushed = (np.empty((len(s), seen.shape[1]), dtype=complex) for _ in range(2))
    modal_displacement(s, model.poles, model.right @ seen, pushes, sources, signals)
    back = (model.right @ path.along)[:, None] * (model.left @ pushing)
    one = np.ones((len(back), 1), dtype=complex)
    modal_displacement(s, model.poles, back, one, np.ascontiguousarray(joint.force[:, None]), pushed)
    signals -= pushed
    if model.residuals is not None and path.axis.scales is None:
        signals += outside_displacement(combined_model(model, seen, np.eye(outer.shape[1])), frequencies, outer)
    return signals


def _moved_signal(model: ModalModel, moved: Moved, frequencies: Real, along: Real) -> NDArray[np.complexfloating]:
    """What a change of the driving forces does to the deflection."""
    if moved.spectra is None:
        seen = combined_model(model, along[:, None], np.eye(len(model.excitations)))
        return displacement_at(seen, frequencies, np.asarray(moved.push, dtype=complex))
    between = combined_model(model, along[:, None], np.real(moved.push))
    compliance = displacement_at(between, frequencies, np.ones((len(frequencies), 1), dtype=complex))
    return np.asarray(compliance.astype(moved.spectra.dtype) * moved.spectra)


def _in_time(
    signals: list[NDArray[np.complexfloating]], lines: WindowedSpectrum, size: tuple[int, bool]
) -> tuple[Signals, Signals]:
    """Deflections and velocities (n, n_signals) of spectra at padded lines; six digits are enough."""
    count, n = sum(one.shape[1] for one in signals), size[0] * lines.padded
    spectra = np.zeros((count, n // 2 + 1), dtype=np.complex64)
    used = spectra[:, : len(signals[0])]
    np.concatenate([one.T for one in signals], axis=0, out=used, casting="same_kind")
    used *= size[0]
    deflection = np.ascontiguousarray(scipy.fft.irfft(spectra, n=n, axis=1).T)
    if not size[1]:
        return deflection, deflection
    used *= np.asarray(2j * np.pi * lines.padded_frequencies[: used.shape[1]], dtype=np.complex64)
    return deflection, np.ascontiguousarray(scipy.fft.irfft(spectra, n=n, axis=1).T)
