"""`CutRecording`: forces, tip motion and spindle speed of one recording of a cut."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from acquisition import Stream, opened
from estimation import (
    DERIVATIVE_ORDERS,
    MatchedChannel,
    band_recording,
    before_force_high_pass,
    channel_at,
    channels_in_words,
    high_pass_corners,
    needed_ratio,
    require_room_at_rate,
    resampled,
)
from millfrf.core import TIP, InputError, Real
from millfrf.cutting import MillingProcess, refuse_varied
from millfrf.stability import classify_cut
from modal_fit import ModalModel

from .spindle_law import SpindleLaw, found_law, stated_law
from .tip_motion import TipMotion, computed, corner_of, integrated, integrated_noise

MOST_ORDERS = 8
"""Harmonics of the tooth passing up to which forces are compared."""

FINE = 32
"""Least number of samples in a period of the highest frequency that is compared: entry and exit are sharp."""

LEAST_TURNS = 80
"""Revolutions without which blocks to fit and blocks to test cannot both be had."""

RUNG_OUT = 7.0
"""Time constants of a model's slowest mode after which its unknown first motion has died out."""


@dataclass(frozen=True)
class CutRecording:
    """One recording of a steady cut.

    Parameters
    ----------
    name
        Name of the recording.
    rate
        Sample rate of forces and motion, Hz; it is as high as the comparison needs.
    force : (n_samples, n_axes), N
        Forces on the tool.
    axes : (n_axes,)
        Directions in which forces were measured: 0, 1, 2 for X, Y, Z.
    motion
        Motion of the tip; None where it is not known.
    law
        Law of the spindle's angle; the angle itself is still unknown.
    run_in
        Seconds at the beginning in which the motion is not right yet: a filter's or a model's past is not known.
    """

    name: str
    rate: float
    force: Real
    axes: tuple[int, ...]
    motion: TipMotion | None
    law: SpindleLaw
    run_in: float

    @property
    def times(self) -> Real:
        """Instants of the samples, (n_samples,), s."""
        return np.asarray(np.arange(len(self.force)) / self.rate)

    def noisier(self) -> "CutRecording":
        """The recording with the noise of its motion added a second time."""
        return self if self.motion is None else replace(self, motion=self.motion.noisier())

    @property
    def corner(self) -> float:
        """Frequency below which motion is not known, Hz."""
        return corner_of(self.law.speed / (2 * np.pi))

    @property
    def channels(self) -> tuple[str, ...]:
        """Degrees of freedom of ``force``."""
        return tuple(TIP[axis] for axis in self.axes)


def cut_recording(
    name: str,
    rate: float,
    force: Real,
    axes: Sequence[int],
    process: MillingProcess,
    stated: SpindleLaw,
    *,
    motion: tuple[Real, Sequence[int], Sequence[int]] | None = None,
    high_passes: Sequence[float] = (),
    model: ModalModel | None = None,
) -> CutRecording:
    """Prepare a recording of a cut from samples in memory.

    Parameters
    ----------
    name, rate, force, axes
        Name, sample rate, forces and their directions, as :class:`CutRecording` describes them.
    process
        Cutter, engagement and coefficients of the cut.
    stated
        Law of the spindle as stated, its speed known roughly.
    motion
        Samples (n, k), their directions (0, 1, 2), and how often each is differentiated from displacement; measured at
        the tip.
    high_passes
        Corners of the known first-order high-passes of ``motion``, Hz; empty: none of them has one.
    model
        Receptance of the tip, for its motion where ``motion`` is None.

    Raises
    ------
    InputError
        The record is too short, no speed is found in it, or the model is not one of the tip.
    """
    duration = len(force) / rate
    turns = stated.about(duration / 2).speed * duration / (2 * np.pi)
    if turns < LEAST_TURNS:
        raise InputError(f"{name} holds {turns:.0f} revolutions; {LEAST_TURNS} are the least, record longer")
    top = MOST_ORDERS * process.teeth * stated.about(duration / 2).speed / (2 * np.pi)
    columns = [force] if motion is None else [force, motion[0]]
    brought, rate = resampled(np.hstack(columns), rate, needed_ratio(rate, FINE * top))
    force = brought[:, : force.shape[1]]
    law = found_law(force, rate, stated, process.teeth)
    corner = corner_of(law.speed / (2 * np.pi))
    tip: TipMotion | None = None
    run_in = 1 / corner
    if motion is not None:
        tip = _measured_motion(
            brought[:, force.shape[1] :], motion[1], motion[2], high_passes or [0.0] * len(motion[1]), rate, corner
        )
    elif model is not None:
        tip = _modelled_motion(name, model, force, axes, rate, corner)
        run_in = max(run_in, RUNG_OUT / float((-model.poles.real).min()))
    return CutRecording(name, rate, force, tuple(axes), tip, law, run_in)


def _measured_motion(
    samples: Real, axes: Sequence[int], orders: Sequence[int], high_passes: Sequence[float], rate: float, corner: float
) -> TipMotion:
    moved, noise = np.zeros((2, len(samples), 3)), np.zeros((2, len(samples), 3))
    for column, (axis, order, high_pass) in enumerate(zip(axes, orders, high_passes, strict=True)):
        one = samples[:, column : column + 1]
        moved[:, :, axis] = np.stack(integrated(one, order, rate, corner, high_pass))[:, :, 0]
        noise[:, :, axis] = np.stack(integrated_noise(one, order, rate, corner, axis, high_pass))[:, :, 0]
    return TipMotion(moved[0], moved[1], "measured", noise)


def _modelled_motion(
    name: str, model: ModalModel, force: Real, axes: Sequence[int], rate: float, corner: float
) -> TipMotion:
    if model.quantity != "receptance":
        raise InputError(f"the model is one of {model.quantity}; motion needs a receptance, calibrate it first")
    if tuple(axes) != (0, 1, 2):
        raise InputError(f"{name}: a model moves the tip by forces in X, Y and Z; one of them was not measured")
    missing = [label for label in TIP if label not in model.responses or label not in model.excitations]
    if missing:
        raise InputError(f"the model has no motion and force at {', '.join(missing)}; give one of the tool tip")
    rows = [model.responses.index(label) for label in TIP]
    driven = np.zeros((len(force), len(model.excitations)))
    driven[:, [model.excitations.index(label) for label in TIP]] = force
    displacement, velocity = computed(model, driven, rate, corner)
    return TipMotion(displacement[:, rows], velocity[:, rows], "model")


def read_cut_recording(
    path: str | os.PathLike[str],
    process: MillingProcess,
    *,
    speed: float | None = None,
    model: ModalModel | None = None,
    stream: str | None = None,
) -> CutRecording:
    """Read one recording of a cut.

    Parameters
    ----------
    path
        Recording with forces at ``TCP``, X and Y at least; motion at ``TCP`` if it was measured.
    process
        Cutter, engagement and coefficients of the cut.
    speed
        Spindle speed, rad/s, within two per cent; None: as the recording states it.
    model
        Receptance of the tip, for its motion where none was measured there.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A force is missing, values are not finite, no speed is stated or found, or the record is too short.
    """
    refuse_varied(
        process, "the comparison of cutting forces", "cut with straight edges at equal pitch", takes=("damping",)
    )
    if not process.feed_per_tooth > 0:
        raise InputError("feed_per_tooth_m = 0: without a feed no force can be computed; give it in the cutting file")
    stated = stated_law(path, speed)
    with opened(path) as recording:
        source = recording.stream(stream)
        pushing, moving, axes, wanted = _channels(source, process)
        # at its own rate: how much of it is needed depends on the speed that is found
        whole = before_force_high_pass(band_recording(source, pushing, moving, Fraction(1)))
    return cut_recording(
        whole.name, whole.rate, whole.force, axes, process, stated,
        motion=(whole.response, wanted, whole.orders.tolist()) if moving else None,
        high_passes=high_pass_corners(whole.responses),
        model=model,
    )  # fmt: skip


def require_room_for_cut(path: str | os.PathLike[str], process: MillingProcess, stream: str | None = None) -> None:
    """Refuse a recording of a cut that :func:`read_cut_recording` has no memory for, before a sample is read.

    Parameters
    ----------
    path
        Recording with forces at ``TCP``.
    process
        Cutter and engagement: they say which motions are read.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A force is missing, or the recording is too long; the line says how long it may be.
    """
    with opened(path) as recording:
        source = recording.stream(stream)
        pushing, moving, _, _ = _channels(source, process)
        rate = source.sample_rate
    require_room_at_rate(path, len(pushing) + len(moving), rate, stream=stream)


def _channels(
    source: Stream, process: MillingProcess
) -> tuple[list[MatchedChannel], list[MatchedChannel], tuple[int, ...], tuple[int, ...]]:
    """Channels of the forces at the tip and of all its motions, or of none; axes of the forces and of the motions."""
    forces = [channel_at(source.channels, label, ("force",)) for label in TIP]
    motions = [channel_at(source.channels, label, DERIVATIVE_ORDERS) for label in TIP]
    axes = tuple(axis for axis, found in enumerate(forces) if found is not None)
    if not {0, 1} <= set(axes):
        there = channels_in_words(source.channels)
        raise InputError(f"{source.path.name}: forces at TCP:+X and TCP:+Y are needed; it has {there}")
    wanted = (0, 1) if process.edge_angle > np.pi / 2 - 1e-6 else (0, 1, 2)
    moving = [one for one in (motions[axis] for axis in wanted) if one is not None]
    pushing = [one for one in forces if one is not None]
    return pushing, moving if len(moving) == len(wanted) else [], axes, wanted


UNSTABLE = ("hopf", "period-doubling")
"""Verdicts that :func:`millfrf.stability.classify_cut` gives for a cut that is not stable."""

STEADY = 0.01
"""Share by which the speed may change over a recording that is judged; a sweep crosses resonances."""


@dataclass(frozen=True)
class CutChatter:
    """What a recording says about the stability of its cut.

    Parameters
    ----------
    name
        Name of the recording.
    kind
        Kind of :class:`millfrf.stability.ChatterVerdict`, or ``not judged``.
    frequency
        Chatter frequency, Hz; NaN without chatter.
    share
        Share of the force's root mean square that chatter has.
    reason
        Reason of the judgement, in one sentence.
    """

    name: str
    kind: str
    frequency: float
    share: float
    reason: str

    @property
    def unstable(self) -> bool:
        """Whether the cut chattered."""
        return self.kind in UNSTABLE


def chatter_of(recording: CutRecording, process: MillingProcess) -> CutChatter:
    """Judge the forces of a recording, from where its run-in has ended.

    Parameters
    ----------
    recording
        Recording of a cut at constant or swept speed.
    process
        Cutting process; it gives the number of teeth.
    """
    law, first = recording.law, min(int(recording.run_in * recording.rate), len(recording.force) // 4)
    seconds = len(recording.force) / recording.rate
    drift = abs(law.change) * seconds / law.speed
    if drift > STEADY:
        reason = f"its speed changes by {100 * drift:.2g} %: chatter is judged at constant speed alone"
        return CutChatter(recording.name, "not judged", float("nan"), 0.0, reason)
    found = classify_cut(recording.force[first:], recording.rate, law.speed, process.teeth)
    return CutChatter(recording.name, found.kind, found.frequency, found.share, found.reason)
