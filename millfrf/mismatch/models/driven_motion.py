"""Derivative of the driven motion of joints by the fitted parameters."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from ..joints.joint_axis import JointPath, combined_model
from ..joints.tangent_loops import ModalFilters, modal_filters, no_filters
from .hypothesis import Hypothesis, start_pulse
from .modal_lines import displacement_at, driven_basis, modal_displacement, outside_displacement
from .model_shape import ModelShape, OutsideBand


def driven_mix(shape: ModelShape, model: ModalModel, along: Real) -> Real:
    """Return the matrix (n_signals, size) that combines signals into the derivative of a deflection by u.

    For m excitations, each mode has two signals for its pole and 2 m signals for its shape, in the order of
    :func:`millfrf.mismatch.models.modal_lines.driven_basis`. These are followed by m signals for each term of the modes
    outside the band.
    """
    n, m = shape.nominal.right.shape[1], shape.nominal.left.shape[1]
    each, per = 2 + 2 * m, 2 + 2 * n + 2 * m
    poles = shape.pole_units(model)
    units = shape.scales()
    deflections = model.right @ along
    mix = np.zeros((len(model.poles) * each, len(model.poles) * per))
    for r in range(len(model.poles)):
        own = mix[r * each : (r + 1) * each, r * per : (r + 1) * per]
        own[:2, :2] = [[unit[r].real for unit in poles], [unit[r].imag for unit in poles]]
        even, odd = np.arange(2, 2 + m), np.arange(2 + m, each)
        left, rho = model.left[r, :m], deflections[r]
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
    combined = np.zeros((len(mix) + len(beyond), shape.size))
    combined[: len(mix), : mix.shape[1]] = mix
    combined[len(mix) :, mix.shape[1] :] = beyond
    return combined


Signals = NDArray[np.float32]

SLOW = 0.6  # largest step of a pole, ``|p| h``, for a filter in time; faster modes are computed in frequency


@dataclass(frozen=True)
class DecayChange:
    """Free decays of modes, which change the driven motion of joints."""

    units: Complex  # modal coordinates at the first sample for each number, (n_numbers, n_modes)
    pulse: Complex  # spectrum of the pulse that begins a decay, (n_lines,)
    mix: Real  # matrix from the signals to the derivative by all numbers, (n_numbers, n_columns)

    def deflection(self, model: ModalModel, frequencies: Real, along: Real) -> Complex:
        """Return the change of the deflection along a joint, (n_lines, n_numbers), m per number."""
        s = np.asarray(2j * np.pi * frequencies, dtype=complex)
        pulse = (self.pulse * np.exp(-s * model.delay))[:, None]
        seen = (self.units * (model.right @ along)).T
        up, down = pulse / (s[:, None] - model.poles), pulse / (s[:, None] - model.poles.conj())
        return up @ seen + down @ seen.conj()


@dataclass(frozen=True)
class ForceChange:
    """A change of the forces that drive joints."""

    # forces on the excitations per unit of each signal, (n_excitations, 1); without ``spectra`` the change of the
    # forces itself at padded lines, N, (n_lines, n_excitations), which is then the only signal
    push: NDArray[np.number]
    # spectra of the signals, (n_lines, n_signals); None if ``push`` is the change of the forces
    spectra: NDArray[np.complexfloating] | None
    mix: Real  # matrix from the signals to the derivative by all fitted numbers, (n_signals, size)

    def deflection(self, model: ModalModel, frequencies: Real, along: Real) -> NDArray[np.complexfloating]:
        """Return the change of the deflection along a joint, (n_lines, n_signals), m."""
        if self.spectra is None:
            seen = combined_model(model, along[:, None], np.eye(len(model.excitations)))
            return displacement_at(seen, frequencies, np.asarray(self.push, dtype=complex))
        between = combined_model(model, along[:, None], np.real(self.push))
        compliance = displacement_at(between, frequencies, np.ones((len(frequencies), 1), dtype=complex))
        return np.asarray(compliance.astype(self.spectra.dtype) * self.spectra)


@dataclass(frozen=True)
class Driving:
    """Forces that drive a joint, at padded lines."""

    force: Complex  # outer force minus the forces of all other joints, (n_lines, n_excitations), N
    # for each other joint: its force, (n_lines,), N, and the forces on the excitations per unit of it
    joints: tuple[tuple[Complex, Real], ...]
    moved: tuple[ForceChange | DecayChange, ...]  # changes of ``force``, and free decays
    own: bool = True  # whether modal parameters, the joint's law and its axis change, too, or ``moved`` alone counts
    first: Complex | None = None  # modal coordinates at the first sample, (n_modes,); None: the structure is at rest


@dataclass(frozen=True)
class DrivenChange:
    """Derivative of the driven motion of a joint."""

    filters: ModalFilters
    # signals that are not modal filters: deflection (m) and, if needed, velocity (m/s), each (n_samples, n_given)
    driving: tuple[Signals, Signals]
    # matrix from the signals of the filters and those of ``driving`` to the derivative by all fitted numbers,
    # (n_signals, size)
    mix: Real


@dataclass(frozen=True)
class DrivenJoint:
    """A joint at which the derivative of the driven motion is computed."""

    path: JointPath  # path from the joint to the responses and excitations of the model
    force: Complex  # force of the joint at padded lines, (n_lines,), N
    angles: int  # column of the joint's first angle among all fitted numbers


def driven_change(
    hypothesis: Hypothesis, joint: DrivenJoint, driving: Driving, lines: WindowedSpectrum, size: tuple[int, bool]
) -> DrivenChange:
    """Return the derivative of the driven motion of a joint by all fitted numbers.

    A mode of n responses and m excitations has ``2 + 2 n + 2 m`` numbers and ``2 + 2 m`` signals. Each term for modes
    outside the band has m signals. As in the free simulation, the joint force does not act through these terms, so that
    their signals depend on the outer force alone.
    """
    oversampling, rates = size
    shape, model, along = hypothesis.shape, hypothesis.reach.model, joint.path.along
    frequencies, m = lines.padded_frequencies[: len(driving.force)], shape.nominal.left.shape[1]
    moved = [change.deflection(model, frequencies, along) for change in driving.moved]
    moved_mix = [change.mix for change in driving.moved]
    if not driving.own:
        filters = no_filters(oversampling * lines.padded, 1 / (oversampling * lines.recording.rate), rates)
        return DrivenChange(filters, _in_time(moved, lines, size), np.vstack(moved_mix))
    total_force = driving.force - joint.force[:, None] * joint.path.push
    step = 1 / (oversampling * lines.recording.rate)
    slow = np.abs(model.poles) * step <= SLOW
    sources, pushes = _sources(model, (total_force, m), (*driving.joints, (joint.force, joint.path.push)))
    if driving.first is not None:
        pulse = start_pulse(lines)[: len(sources), None]
        sources, pushes = np.hstack([sources, pulse]), np.hstack([pushes, driving.first[:, None]])
    modes = (model.poles[slow], pushes[slow], (model.right @ along)[slow])
    filters = modal_filters(oversampling * sources, (oversampling * lines.padded, step), modes, (m, rates))
    # modes outside the band do not act on a joint away from the tip
    outside_terms = None if joint.path.axis.scales is not None else shape.outside
    signals: list[NDArray[np.complexfloating]] = [
        _fast_signals(model, ~slow, frequencies, (total_force, m), along),
        _outside_signals(outside_terms, frequencies, driving.force[:, :m]),
        _angle_signals(model, joint, frequencies, driving.force, (sources, pushes)),
    ]
    angle_mix = np.eye(signals[-1].shape[1], hypothesis.size, joint.angles)
    signals += moved
    modal = np.pad(driven_mix(shape, model, along), ((0, 0), (0, hypothesis.size - shape.size)))
    modal = modal if outside_terms is not None else modal[: len(slow) * (2 + 2 * m)]
    mix = [modal[_order(slow, m, len(modal))], angle_mix, *moved_mix]
    return DrivenChange(filters, _in_time(signals, lines, size), np.vstack(mix))


def _sources(
    model: ModalModel, felt: tuple[Complex, int], joints: tuple[tuple[Complex, Real], ...]
) -> tuple[Complex, Complex]:
    """Return the forces that drive the modes, (n_lines, n_sources), and the factors from them to each mode.

    The sources are the total forces on the m excitations of the model, followed by the force of each joint away from
    the tip. The factors have the shape (n_modes, n_sources).
    """
    force, m = felt
    away_from_tip = [(joint_force, push) for joint_force, push in joints if push[m:].any()]
    sources = np.column_stack([force[:, :m], *(joint_force for joint_force, _ in away_from_tip)])
    pushes = [model.left[:, :m], *(-(model.left[:, m:] @ push[m:])[:, None] for _, push in away_from_tip)]
    return sources, np.hstack(pushes)


def _order(slow: NDArray[np.bool_], m: int, count: int) -> NDArray[np.int64]:
    """Return the order of the signals of :func:`driven_mix` in which those of the filters come first.

    ``slow`` marks the modes that are computed by filters, ``m`` is the number of excitations, ``count`` the number of
    signals.
    """
    rows = np.arange(len(slow) * (2 + 2 * m)).reshape(len(slow), 2 + 2 * m)
    own = rows[slow]
    first = [own[:, 2 : 2 + m].ravel(), own[:, 0], own[:, 2 + m :].ravel(), own[:, 1]]
    return np.concatenate([*first, rows[~slow].ravel(), np.arange(rows.size, count)])


def _fast_signals(
    model: ModalModel, chosen: NDArray[np.bool_], frequencies: Real, felt: tuple[Complex, int], along: Real
) -> Complex:
    """Return the signals of modes that are too fast for filters in time."""
    force, m = felt
    signals = np.empty((len(frequencies), int(chosen.sum()) * (2 + 2 * m)), dtype=complex)
    if chosen.any():
        modes = (model.poles[chosen], model.left[chosen], (model.right @ along)[chosen])
        s = np.asarray(2j * np.pi * frequencies, dtype=complex)
        driven_basis(s, np.ascontiguousarray(force), modes, m, signals)
    return signals


def _outside_signals(outside: OutsideBand | None, frequencies: Real, outer: Complex) -> Complex:
    """Return the outer force through each term for modes outside the band."""
    if outside is None:
        return np.zeros((len(outer), 0), dtype=complex)
    basis = outside.basis(np.asarray(2j * np.pi * frequencies, dtype=complex))
    return np.concatenate([function[:, None] * outer for function in basis], axis=1)


def _angle_signals(
    model: ModalModel, joint: DrivenJoint, frequencies: Real, outer: Complex, driven: tuple[Complex, Complex]
) -> Complex:
    """Return the derivative of the deflection by rotations of the joint axis.

    A rotation changes the combination of responses that is the deflection, and the direction of the joint force. As in
    the free simulation, the joint force acts through the modes alone.
    """
    (sources, pushes), path = driven, joint.path
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    seen, pushing = path.rows @ path.axis.angle_slopes, path.columns @ path.axis.angle_slopes
    signals, pushed = (np.empty((len(s), seen.shape[1]), dtype=complex) for _ in range(2))
    modal_displacement(s, model.poles, model.right @ seen, pushes, sources, signals)
    back = (model.right @ path.along)[:, None] * (model.left @ pushing)
    ones = np.ones((len(back), 1), dtype=complex)
    modal_displacement(s, model.poles, back, ones, np.ascontiguousarray(joint.force[:, None]), pushed)
    signals -= pushed
    if model.residuals is not None and path.axis.scales is None:
        signals += outside_displacement(combined_model(model, seen, np.eye(outer.shape[1])), frequencies, outer)
    return signals


def _in_time(
    signals: list[NDArray[np.complexfloating]], lines: WindowedSpectrum, size: tuple[int, bool]
) -> tuple[Signals, Signals]:
    """Return deflections and velocities in time, (n_samples, n_signals), of spectra at padded lines.

    Single precision suffices.
    """
    count, n = sum(signal.shape[1] for signal in signals), size[0] * lines.padded
    spectra = np.zeros((count, n // 2 + 1), dtype=np.complex64)
    used = spectra[:, : len(signals[0])]
    np.concatenate([signal.T for signal in signals], axis=0, out=used, casting="same_kind")
    used *= size[0]
    deflection = np.ascontiguousarray(scipy.fft.irfft(spectra, n=n, axis=1).T)
    if not size[1]:
        return deflection, deflection
    used *= np.asarray(2j * np.pi * lines.padded_frequencies[: used.shape[1]], dtype=np.complex64)
    return deflection, np.ascontiguousarray(scipy.fft.irfft(spectra, n=n, axis=1).T)
