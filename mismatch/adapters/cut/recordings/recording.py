"""`CutRecording`: forces at the tip, the tip's motion and the stated speed of one recording of a cut."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import needed_ratio, resampled
from foundation import TIP, InputError
from modal_fit import ModalModel

from .spindle_law import SpindleLaw, found_law
from .tip_motion import TipMotion, computed, corner_of, integrated, integrated_noise

Real = NDArray[np.float64]

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
