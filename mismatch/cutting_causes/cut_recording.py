"""`CutRecording`: forces at the tip, the tip's motion and the stated speed of one recording of a cut."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from acquisition import Channel, Recording, Stream, aligned_samples
from cutting import MillingProcess, refuse_varied
from foundation import DegreeOfFreedom, InputError
from modal_fit import ModalModel

from ..trial import POWERS
from .spindle_law import SpindleLaw, found_law, stated_law
from .tip_motion import TipMotion, computed, corner_of, integrated, integrated_noise

Real = NDArray[np.float64]

TIP = ("TCP:+X", "TCP:+Y", "TCP:+Z")

MOST_ORDERS = 8
"""Harmonics of the tooth passing up to which forces are compared."""

FINE = 32
"""Instants a period of the highest frequency that is compared, at least: entry and exit are sharp."""

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
        Of the recording.
    rate
        Hz, of forces and motion, as far as they are needed.
    force : (n_samples, n_axes), N
        On the tool.
    axes : (n_axes,)
        0, 1, 2 for X, Y, Z: the directions that were measured.
    motion
        At the tip; None where it is not known.
    law
        Spindle, its angle still unknown.
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
        """(n_samples,), s."""
        return np.asarray(np.arange(len(self.force)) / self.rate)

    def noisier(self) -> "CutRecording":
        """With the noise of its motion a second time."""
        return self if self.motion is None else replace(self, motion=self.motion.noisier())

    @property
    def corner(self) -> float:
        """Frequency below which motion is not known, Hz."""
        return corner_of(self.law.speed / (2 * np.pi))

    @property
    def channels(self) -> tuple[str, ...]:
        """Degrees of freedom of ``force``."""
        return tuple(TIP[axis] for axis in self.axes)


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
        Cutter.
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
    with Recording(path) as recording:
        source = recording.stream(stream)
        forces = [_channel(source, label, ("force",)) for label in TIP]
        motions = [_channel(source, label, tuple(POWERS)) for label in TIP]
        axes = tuple(axis for axis, found in enumerate(forces) if found is not None)
        rate = source.sample_rate
        if not {0, 1} <= set(axes):
            there = ", ".join(f"{c.name} ({c.quantity} {c.degree_of_freedom})" for c in source.channels)
            raise InputError(f"{Path(path).name}: forces at TCP:+X and TCP:+Y are needed; it has {there}")
        force = _samples(source, [one for one in forces if one is not None])
        wanted = (0, 1) if process.edge_angle > np.pi / 2 - 1e-6 else (0, 1, 2)
        moving = [motions[axis] for axis in wanted]
        known = [one for one in moving if one is not None]
        samples = _samples(source, known) if len(known) == len(wanted) else None
    quantities = [one[0].quantity for one in known]
    return cut_recording(
        Path(path).stem, rate, force, axes, process, stated,
        motion=None if samples is None else (samples, wanted, tuple(POWERS[quantity] for quantity in quantities)),
        model=model,
    )  # fmt: skip


def cut_recording(
    name: str,
    rate: float,
    force: Real,
    axes: Sequence[int],
    process: MillingProcess,
    stated: SpindleLaw,
    *,
    motion: tuple[Real, Sequence[int], Sequence[int]] | None = None,
    model: ModalModel | None = None,
) -> CutRecording:
    """Prepare samples in memory.

    Parameters
    ----------
    name, rate, force, axes
        As in :class:`CutRecording`.
    process
        Cutter.
    stated
        Spindle's speed, roughly.
    motion
        Samples (n, k), their directions (0, 1, 2), and how often each is differentiated from displacement; measured at
        the tip.
    model
        As :func:`read_cut_recording`; used where ``motion`` is None.

    Raises
    ------
    InputError
        As :func:`read_cut_recording`.
    """
    duration = len(force) / rate
    turns = stated.about(duration / 2).speed * duration / (2 * np.pi)
    if turns < LEAST_TURNS:
        raise InputError(f"{name} holds {turns:.0f} revolutions; {LEAST_TURNS} are the least, record longer")
    top = MOST_ORDERS * process.teeth * stated.about(duration / 2).speed / (2 * np.pi)
    columns = [force] if motion is None else [force, motion[0]]
    brought, rate = _brought_down(np.hstack(columns), rate, FINE * top)
    force = brought[:, : force.shape[1]]
    law = found_law(force, rate, stated, process.teeth)
    corner = corner_of(law.speed / (2 * np.pi))
    tip: TipMotion | None = None
    run_in = 1 / corner
    if motion is not None:
        tip = _measured_motion(brought[:, force.shape[1] :], motion[1], motion[2], rate, corner)
    elif model is not None:
        tip = _modelled_motion(name, model, force, axes, rate, corner)
        run_in = max(run_in, RUNG_OUT / float((-model.poles.real).min()))
    return CutRecording(name, rate, force, tuple(axes), tip, law, run_in)


def _measured_motion(
    samples: Real, axes: Sequence[int], powers: Sequence[int], rate: float, corner: float
) -> TipMotion:
    moved, noise = np.zeros((2, len(samples), 3)), np.zeros((2, len(samples), 3))
    for column, (axis, power) in enumerate(zip(axes, powers, strict=True)):
        one = samples[:, column : column + 1]
        moved[:, :, axis] = np.stack(integrated(one, power, rate, corner))[:, :, 0]
        noise[:, :, axis] = np.stack(integrated_noise(one, power, rate, corner, axis))[:, :, 0]
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


def _channel(stream: Stream, label: str, quantities: tuple[str, ...]) -> tuple[Channel, float] | None:
    aim = DegreeOfFreedom.parse(label)
    for channel in stream.channels:
        if channel.quantity in quantities and channel.node:
            here = DegreeOfFreedom(channel.node, channel.direction)
            if (here.node, here.axis) == (aim.node, aim.axis):
                return channel, float(here.sign * aim.sign)
    return None


def _samples(stream: Stream, found: Sequence[tuple[Channel, float]]) -> Real:
    names = [channel.name for channel, _ in found]
    samples = np.asarray(aligned_samples(stream, names) * np.array([sign for _, sign in found]))
    bad = ~np.isfinite(samples).all(axis=0)
    if bad.any():
        name = names[int(np.argmax(bad))]
        raise InputError(f"{stream.path.name}: channel {name} holds values that are not finite; cut them out first")
    return samples


def _brought_down(samples: Real, rate: float, needed: float) -> tuple[Real, float]:
    """Sampled no faster than twice what is needed."""
    if rate < 1.5 * needed:
        return samples, rate
    ratio = Fraction(needed / rate).limit_denominator(50)
    if ratio.numerator == 0:
        ratio = Fraction(1, 50)
    return np.asarray(resample_poly(samples, ratio.numerator, ratio.denominator, axis=0)), rate * float(ratio)
