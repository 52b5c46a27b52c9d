"""`CutRecording`: forces, tip motion and spindle speed of a cut; `ForceSpectra`: their windowed spectra."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import scipy
from numpy.typing import NDArray

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
from millfrf.core import TIP, Complex, InputError, Real
from millfrf.cutting import MillingProcess, refuse_varied
from millfrf.stability import classify_cut
from modal_fit import ModalModel

from .motion import SpindleLaw, TipMotion, computed, corner_of, found_law, integrated, integrated_noise, stated_law

MOST_ORDERS = 8  # highest compared harmonic of the tooth passing

FINE = 32  # samples per period of the highest compared frequency, as entry and exit are sharp

MIN_REVOLUTIONS = 80  # fewer revolutions do not give blocks for the fit and for its test

TRANSIENT = 7.0  # time constants of the slowest mode after which its unknown initial motion has decayed


@dataclass(frozen=True)
class CutRecording:
    """One recording of a steady cut."""

    name: str
    rate: float  # sample rate of forces and motion, Hz; it is as high as the comparison needs
    force: Real  # forces on the tool, (n_samples, n_axes), N
    axes: tuple[int, ...]  # directions in which forces were measured: 0, 1, 2 for X, Y, Z, (n_axes,)
    motion: TipMotion | None  # motion of the tip; None where it is not known
    law: SpindleLaw
    # time at the beginning, s, in which the motion is wrong, as the earlier input of a filter or model is unknown
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

    ``motion``: samples (n, k) measured at the tip, their directions (0, 1, 2), and their orders of differentiation of
    the displacement. ``high_passes``: corner frequencies of known first-order high-passes of the motion, Hz. ``model``:
    receptance of the tip, from which the motion is computed if ``motion`` is None.
    """
    duration = len(force) / rate
    turns = stated.about(duration / 2).speed * duration / (2 * np.pi)
    if turns < MIN_REVOLUTIONS:
        raise InputError(f"{name} holds {turns:.0f} revolutions; {MIN_REVOLUTIONS} are the least, record longer")
    top = MOST_ORDERS * process.teeth * stated.about(duration / 2).speed / (2 * np.pi)
    columns = [force] if motion is None else [force, motion[0]]
    resampled_columns, rate = resampled(np.hstack(columns), rate, needed_ratio(rate, FINE * top))
    force = resampled_columns[:, : force.shape[1]]
    law = found_law(force, rate, stated, process.teeth)
    corner = corner_of(law.speed / (2 * np.pi))
    tip: TipMotion | None = None
    run_in = 1 / corner
    if motion is not None:
        tip = _measured_motion(
            resampled_columns[:, force.shape[1] :],
            motion[1],
            motion[2],
            high_passes or [0.0] * len(motion[1]),
            rate,
            corner,
        )
    elif model is not None:
        tip = _modelled_motion(name, model, force, axes, rate, corner)
        run_in = max(run_in, TRANSIENT / float((-model.poles.real).min()))
    return CutRecording(name, rate, force, tuple(axes), tip, law, run_in)


def _measured_motion(
    samples: Real, axes: Sequence[int], orders: Sequence[int], high_passes: Sequence[float], rate: float, corner: float
) -> TipMotion:
    moved, noise = np.zeros((2, len(samples), 3)), np.zeros((2, len(samples), 3))
    for column, (axis, order, high_pass) in enumerate(zip(axes, orders, high_passes, strict=True)):
        sample_column = samples[:, column : column + 1]
        moved[:, :, axis] = np.stack(integrated(sample_column, order, rate, corner, high_pass))[:, :, 0]
        noise[:, :, axis] = np.stack(integrated_noise(sample_column, order, rate, corner, axis, high_pass))[:, :, 0]
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
        Receptance of the tip, from which the motion is computed if none was measured at the tip.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A force is missing, values are not finite, no speed is stated or found, or the record is too short.
    """
    refuse_varied(
        process,
        "the comparison of cutting forces",
        "cut with straight edges at equal pitch",
        takes=("damping", "runout"),
    )
    if not process.feed_per_tooth > 0:
        raise InputError("feed_per_tooth_m = 0: without a feed no force can be computed; give it in the cutting file")
    stated = stated_law(path, speed)
    with opened(path) as recording:
        source = recording.stream(stream)
        force_channels, motion_channels, axes, motion_axes = _channels(source, process)
        # read at the recorded rate, as the necessary rate depends on the speed that is identified later
        recorded = before_force_high_pass(band_recording(source, force_channels, motion_channels, Fraction(1)))
    return cut_recording(
        recorded.name, recorded.rate, recorded.force, axes, process, stated,
        motion=(recorded.response, motion_axes, recorded.orders.tolist()) if motion_channels else None,
        high_passes=high_pass_corners(recorded.responses),
        model=model,
    )  # fmt: skip


def require_room_for_cut(path: str | os.PathLike[str], process: MillingProcess, stream: str | None = None) -> None:
    """Raise InputError if memory does not suffice for :func:`read_cut_recording`, before a sample is read.

    Parameters
    ----------
    path
        Recording with forces at ``TCP``.
    process
        Cutter and engagement, which determine the motions that are read.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A force is missing, or the recording is too long; the message states the largest length.
    """
    with opened(path) as recording:
        source = recording.stream(stream)
        force_channels, motion_channels, _, _ = _channels(source, process)
        rate = source.sample_rate
    require_room_at_rate(path, len(force_channels) + len(motion_channels), rate, stream=stream)


def _channels(
    source: Stream, process: MillingProcess
) -> tuple[list[MatchedChannel], list[MatchedChannel], tuple[int, ...], tuple[int, ...]]:
    """Return the channels of forces and motions at the tip, and the axes of both; motions are complete or left out."""
    forces = [channel_at(source.channels, label, ("force",)) for label in TIP]
    motions = [channel_at(source.channels, label, DERIVATIVE_ORDERS) for label in TIP]
    axes = tuple(axis for axis, channel in enumerate(forces) if channel is not None)
    if not {0, 1} <= set(axes):
        available = channels_in_words(source.channels)
        raise InputError(f"{source.path.name}: forces at TCP:+X and TCP:+Y are needed; it has {available}")
    motion_axes = (0, 1) if process.edge_angle > np.pi / 2 - 1e-6 else (0, 1, 2)
    motion_channels = [channel for channel in (motions[axis] for axis in motion_axes) if channel is not None]
    force_channels = [channel for channel in forces if channel is not None]
    return force_channels, motion_channels if len(motion_channels) == len(motion_axes) else [], axes, motion_axes


# results of :func:`millfrf.stability.classify_cut` for an unstable cut
UNSTABLE = ("hopf", "period-doubling")

STEADY = 0.01  # largest relative change of the speed over a recording that is classified; a sweep crosses resonances


@dataclass(frozen=True)
class CutChatter:
    """Stability of the cut of a recording."""

    name: str
    kind: str  # kind of :class:`millfrf.stability.ChatterVerdict`, or ``not judged``
    frequency: float  # chatter frequency, Hz; NaN without chatter
    share: float  # root mean square of the chatter, as a share of that of the force
    reason: str

    @property
    def unstable(self) -> bool:
        """Whether the cut chattered."""
        return self.kind in UNSTABLE


def chatter_of(recording: CutRecording, process: MillingProcess) -> CutChatter:
    """Classify the forces of a recording after its run-in."""
    law, first = recording.law, min(int(recording.run_in * recording.rate), len(recording.force) // 4)
    seconds = len(recording.force) / recording.rate
    drift = abs(law.change) * seconds / law.speed
    if drift > STEADY:
        reason = f"its speed changes by {100 * drift:.2g} %: chatter is judged at constant speed alone"
        return CutChatter(recording.name, "not judged", float("nan"), 0.0, reason)
    chatter = classify_cut(recording.force[first:], recording.rate, law.speed, process.teeth)
    return CutChatter(recording.name, chatter.kind, chatter.frequency, chatter.share, chatter.reason)


REVOLUTIONS = 16  # least number of revolutions in a block: so many spectral lines lie between neighbouring orders

MOST_BLOCKS = 16  # most blocks of a recording, as half of the blocks must suffice to fit a cause


@dataclass(frozen=True)
class ForceSpectra:
    """Spectra of one recording in blocks of time."""

    recording: CutRecording
    first: int  # sample at which the first block begins, after the run-in
    # samples of a block, and number of blocks
    size: int
    blocks: int
    band: NDArray[np.int64]  # numbers of the spectral lines that are compared, (n_lines,)
    frequencies: Real  # frequencies of these lines, (n_lines,), Hz
    # spectra of the measured forces, scaled so that white noise of variance v has variance v in each line, (n_blocks,
    # n_lines, n_axes)
    measured: Complex

    def of(self, force: Real, fine: int = 1) -> Complex:
        """Return the spectra of given forces (samples, n) in the same blocks and lines, (n_blocks, n_lines, n)."""
        window = scipy.signal.windows.tukey(self.size * fine, 0.1, sym=False)
        window = window / np.sqrt(np.sum(window[::fine] ** 2)) / fine
        samples = force[self.first * fine : (self.first + self.size * self.blocks) * fine]
        parts = samples.reshape(self.blocks, self.size * fine, -1) * window[None, :, None]
        return np.asarray(scipy.fft.rfft(parts, axis=1)[:, self.band])


def force_spectra(recording: CutRecording, teeth: int) -> ForceSpectra:
    """Return the spectra of a recording without its run-in and end, in which integrated motion is wrong."""
    rotation = recording.law.speed / (2 * np.pi)
    n = len(recording.force)
    run_in = min(int(recording.run_in * recording.rate), n // 4)
    margin = min(int(recording.rate / recording.corner), n // 16)
    usable = n - run_in - margin
    blocks = int(np.clip(usable * rotation / recording.rate // REVOLUTIONS, 4, MOST_BLOCKS))
    size = scipy.fft.prev_fast_len(usable // blocks, real=True)
    axis = np.arange(size // 2 + 1) * recording.rate / size
    top = min(0.4 * recording.rate, (MOST_ORDERS + 0.5) * teeth * rotation)
    band = np.flatnonzero((axis >= max(2.5 * recording.corner, 3 * recording.rate / size)) & (axis <= top))
    stub = ForceSpectra(recording, run_in, size, blocks, band, axis[band], np.zeros((0, 0, 0), dtype=complex))
    return ForceSpectra(recording, run_in, size, blocks, band, axis[band], stub.of(recording.force))


WIDTH = 1.5  # width over which the noise floor is smoothed, in spindle frequencies; orders occupy less than half of it

# power over the floor above which a spectral line is not used for the correlation of the noise of the channels
OUTLIER = 9.0


@dataclass(frozen=True)
class ForceNoise:
    """Noise of the force spectra of one recording."""

    floor: Real  # variance of each spectral line, N^2, (n_lines, n_axes)
    together: Real  # correlation of the channels' noise, (n_axes, n_axes)
    # matrix W with ``W V W^H = 1``, where V is the covariance of noise and of the model's usual error, 1/N,
    # (n_blocks, n_lines, n_axes, n_axes)
    whitener: Real


def noise_of(spectra: ForceSpectra, residual: Complex, predicted: Complex, error: float) -> ForceNoise:
    """Return the noise of the residual of a fit with all causes."""
    power = np.abs(residual) ** 2
    floor = _running_median(power, spectra) / np.log(2)
    scaled = residual / np.sqrt(floor)
    plain = scaled[(np.abs(scaled) ** 2 < OUTLIER).all(axis=-1)]
    together = np.real(plain.T @ plain.conj()) / max(len(plain), 1)
    size = np.sqrt(np.maximum(np.diag(together), 1e-12))
    together = together / np.outer(size, size)
    together = 0.98 * together + 0.02 * np.eye(len(size))
    spread = np.sqrt(floor)
    smooth = spread[:, :, None] * together * spread[:, None, :]
    own = spectra.blocks * error**2 * np.abs(predicted) ** 2
    covariance = smooth[None] + own[..., None] * np.eye(len(size))
    return ForceNoise(floor, together, np.linalg.inv(np.linalg.cholesky(covariance)))


def _running_median(power: Real, spectra: ForceSpectra) -> Real:
    """Return, for each line, the median of the power over all blocks and over neighbouring lines, (n_lines, n_axes)."""
    spacing = float(spectra.frequencies[1] - spectra.frequencies[0])
    rotation = spectra.recording.law.speed / (2 * np.pi)
    half = max(4, round(0.5 * WIDTH * rotation / spacing))
    count = power.shape[1]
    centres = np.unique(np.clip(np.arange(0, count + half, max(1, half // 2)), 0, count - 1))
    medians = []
    for centre in centres:
        low = int(np.clip(centre - half, 0, max(count - 2 * half - 1, 0)))
        medians.append(np.median(power[:, low : low + 2 * half + 1], axis=(0, 1)))
    logs = np.log(np.maximum(np.array(medians), 1e-30))
    columns = [np.interp(np.arange(count), centres, logs[:, c]) for c in range(power.shape[2])]
    return np.asarray(np.exp(np.stack(columns, axis=-1)))


def whitened(noise: ForceNoise, residual: Complex) -> Complex:
    """Return ``W r``, (n_blocks, n_lines, n_axes), in which pure noise has the mean power 1."""
    return np.asarray(np.einsum("bkpq,bkq->bkp", noise.whitener, residual))
