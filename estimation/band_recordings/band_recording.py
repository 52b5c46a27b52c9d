"""`BandRecording`: forces and responses of one recording, reduced to the channels and the band that are needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np

from acquisition import Channel, RecordingFile, Stream, aligned_blocks, opened, rows_left_out
from millfrf.core import Complex, Index, InputError, Real

from ..settings import RECORDINGS
from .channel_matching import (
    DERIVATIVE_ORDERS,
    MatchedChannel,
    derivative_orders,
    high_pass_corners,
    kinematic_factor,
    matched_channels,
    refuse_shared,
)
from .resampling import Resampler, needed_ratio, require_room, resampled, whole_ratio, widest_band


@dataclass(frozen=True)
class BandRecording:
    """Forces and responses of one recording, in the order of requested channels or degrees of freedom.

    Parameters
    ----------
    name
        Name of the recording.
    rate : Hz
        Sample rate of the samples.
    force : (n_samples, n_excitations), SI
        Samples of the forces, or of other excitations.
    response : (n_samples, n_responses), SI
        Samples of the motions, or of other responses.
    excitations, responses
        Channels along the columns, with the requested directions and without the delays removed from the samples.
    start : s
        Time from the first sample of the recording to the first sample here.
    rounding : (n_responses,), SI
        Standard deviation at this rate of rounding to the steps of the converter; 0 where no steps show, None where
        they were not looked for.
    swept_line : Hz
        Frequency of the forces' strongest line at the beginning and at the end, if it sweeps evenly
        (:func:`swept_line`); None if there is no such line, or it was not looked for.
    """

    name: str
    rate: float
    force: Real
    response: Real
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]
    start: float = 0.0
    rounding: Real | None = None
    swept_line: tuple[float, float] | None = None

    @property
    def channels(self) -> tuple[str, ...]:
        """Return the names of the excitation channels, then of the response channels."""
        return tuple(channel.name for channel in (*self.excitations, *self.responses))

    @property
    def orders(self) -> Index:
        """Return the derivative order of each response, (n_responses,): 0 displacement, 1 velocity, 2 acceleration."""
        return derivative_orders(self.responses)

    @cached_property
    def at_rest(self) -> bool:
        """Return whether the samples show that the structure was at rest when the recording began.

        Either the recording begins quietly (pre-trigger), or it holds blows of a hammer and nothing moved before the
        first of them, even where that is at the very beginning.
        """
        return _starts_at_rest(self.force, self.response, self.rate)

    @property
    def usable_band(self) -> float:
        """Return the upper end of the flat, alias-free band, Hz."""
        return widest_band(self.rate)

    @property
    def duration(self) -> float:
        """Return the length of the recording, s."""
        return len(self.force) / self.rate

    @property
    def level(self) -> float:
        """Return the root mean square of the force, all directions together, N."""
        return float(np.sqrt(np.mean(np.sum((self.force - self.force.mean(axis=0)) ** 2, axis=1))))

    def part(self, name: str, first: int, last: int) -> "BandRecording":
        """Cut out the samples from ``first`` to before ``last`` as a recording called ``name``."""
        inside, start, line = slice(first, last), self.start + first / self.rate, self.swept_line
        if line is not None:
            low, high = np.interp([first, last], [0, len(self.force)], line)
            line = (float(low), float(high))
        part = replace(self, name=name, start=start, swept_line=line)
        return replace(part, force=self.force[inside], response=self.response[inside])

    def kinematic(self, frequencies: Real) -> Complex:
        """Compute the factors (n, n_responses) from displacement to the measured quantities at frequencies (n,), Hz.

        See :func:`kinematic_factor`; known high-passes of the responses are included.
        """
        return kinematic_factor(frequencies, self.orders, high_pass_corners(self.responses))


def _starts_at_rest(force: Real, response: Real, rate: float) -> bool:
    """Return whether the structure was at rest when forces and responses (n_samples, n), with any offset, begin."""
    force, response = (np.abs(samples - np.median(samples, axis=0)) for samples in (force, response))
    if not (force.max(axis=0).any() and response.any()):
        return False
    loaded = (force > RECORDINGS.quiet_force * force.max()).any(axis=1)
    first = int(np.argmax(loaded))
    # a quiet beginning before the first force, as of a pre-trigger
    if first >= max(RECORDINGS.quiet_samples, RECORDINGS.quiet_seconds * rate):
        before, total = (np.mean(samples**2, axis=0) for samples in (response[:first], response))
        return bool((before <= RECORDINGS.quiet_response * total).all())
    # an acceleration follows a blow at once, in proportion to the part of the blow that has risen
    allowed = RECORDINGS.early_response + force[: first + 1].max(axis=1, keepdims=True) / force.max()
    early = (response[: first + 1] <= allowed * response.max(axis=0)).all()
    return bool(np.mean(loaded) < RECORDINGS.blow_share and early)


def band_recording(
    stream: Stream,
    excitations: Sequence[MatchedChannel],
    responses: Sequence[MatchedChannel],
    ratio: Fraction,
    progress: Callable[[int], None] | None = None,
) -> BandRecording:
    """Read a recording once, block by block, and resample it to a lower rate; known input delays are removed.

    Parameters
    ----------
    stream
        Samples of an open recording.
    excitations, responses
        Channels to keep, in the order of the columns.
    ratio
        New over old sample rate: from :func:`whole_ratio` or :func:`needed_ratio`.
    progress
        Called with the number of samples read so far.

    Raises
    ------
    InputError
        The recording is shorter than the filter, longer than memory allows, or a channel holds values that are not
        finite.
    """
    matches = (*excitations, *responses)
    require_room(stream, len(matches), RECORDINGS.bytes_per_value, float(ratio))
    names = [match.channel.name for match in matches]
    resampler, blocks, n_read = Resampler(stream.sample_rate, ratio), [np.empty((0, len(names)))], 0
    signs, steps = np.array([match.sign for match in matches]), None
    for block in aligned_blocks(stream, names):
        bad = ~np.isfinite(block).all(axis=0)
        if bad.any():
            name = names[int(np.argmax(bad))]
            raise InputError(f"{stream.path.name}: channel {name} holds values that are not finite; cut them out first")
        if steps is None and len(block) >= RECORDINGS.rounding_samples:
            steps = np.array([rounding_step(column) or 0.0 for column in block.T[len(excitations) :]])
        blocks.append(resampler.add(block * signs))
        n_read += len(block)
        if progress is not None:
            progress(n_read)
    samples = np.concatenate(blocks)
    if len(samples) < 2:
        raise InputError(
            f"{stream.path}: {stream.n_samples / stream.sample_rate:.3g} s are too short for a band up to "
            f"{widest_band(resampler.rate):g} Hz; record longer"
        )
    n, start = len(excitations), rows_left_out(stream, names) / stream.sample_rate + resampler.start
    channels = tuple(replace(match.as_requested, input_delay_s=None) for match in matches)
    name, sides = Path(stream.path).stem, (samples[:, :n], samples[:, n:], channels[:n], channels[n:])
    # the filter keeps the share ``ratio`` of the power of rounding, which is white
    rounding = None if steps is None else steps * np.sqrt(float(ratio) / 12)
    return BandRecording(name, resampler.rate, *sides, start, rounding)


def rounding_step(samples: Real) -> float | None:
    """Return the step of rounded samples: 0 where they show none, None where the samples are too few.

    All values lie on one lattice, and are few beside the samples: a finer step does not show, and does not matter.

    Parameters
    ----------
    samples : (n,)
        Samples of one channel.

    Examples
    --------
    >>> round(rounding_step(0.25 * np.rint(np.sin(np.arange(2000.0)) / 0.1)), 12)
    0.25
    """
    if len(samples) < RECORDINGS.rounding_samples:
        return None
    values = np.unique(samples)
    if not 4 <= len(values) < RECORDINGS.distinct_share * len(samples):
        return 0.0
    differences = np.diff(values)
    step = float(differences.min())
    places = (values - values[0]) / step
    return step if np.abs(places - np.rint(places)).max() < RECORDINGS.lattice else 0.0


def _resampled_from_rest(recording: BandRecording, ratio: Fraction) -> BandRecording:
    """Resample a recording that begins at rest, without losing its beginning.

    A filter loses half its length at either end, and with it a blow at the beginning. Because nothing moved before the
    recording, the resting level is placed in front of the samples.
    """
    resampler = Resampler(recording.rate, ratio)
    n_lead = int(resampler.start * recording.rate)
    levels = np.concatenate([np.median(samples, axis=0) for samples in (recording.force, recording.response)])
    joint = np.vstack([np.tile(levels, (n_lead, 1)), np.hstack([recording.force, recording.response])])
    samples, rate = resampled(joint, recording.rate, ratio)
    n, start = recording.force.shape[1], recording.start + resampler.start - n_lead / recording.rate
    return replace(recording, rate=rate, force=samples[:, :n], response=samples[:, n:], start=start)


def before_force_high_pass(recording: BandRecording) -> BandRecording:
    """Undo the known first-order high-passes of the forces' channels, ``f + w_corner int f dt``.

    The linear drift of the integral lies below every band and is removed. Channels of the result have no high-pass.
    """
    corners = high_pass_corners(recording.excitations)
    if not any(corners):
        return recording
    # not at the top: scipy.signal takes 75 MB
    from scipy.integrate import cumulative_trapezoid
    from scipy.signal import detrend

    force = recording.force.copy()
    for column, corner in enumerate(corners):
        if corner > 0:
            centred = force[:, column] - force[:, column].mean()
            drift = cumulative_trapezoid(centred, dx=1 / recording.rate, initial=0.0)
            force[:, column] += detrend(2 * np.pi * corner * drift)
    excitations = tuple(replace(channel, high_pass_hz=None) for channel in recording.excitations)
    return replace(recording, force=force, excitations=excitations)


def read_band_recording(
    path: RecordingFile,
    excitations: Sequence[str],
    responses: Sequence[str],
    needed: float,
    *,
    stream: str | None = None,
    exciting: Sequence[str] = ("force", "voltage"),
    responding: Sequence[str] = tuple(DERIVATIVE_ORDERS),
) -> BandRecording:
    """Read forces and motions at the given degrees of freedom, in their order and along their directions.

    Known input delays and known high-passes of the forces are removed.

    Parameters
    ----------
    path
        File of the recording.
    excitations
        Degrees of freedom (``node:direction``) of what drives the structure.
    responses
        Degrees of freedom of what responds.
    needed : Hz
        Sample rate that is enough; a recording with a much higher rate is resampled to about this rate.
    stream
        Sample clock; None: the only one.
    exciting, responding
        Quantities of :data:`millfrf.core.SI_UNITS` that excitations and responses may have.

    Raises
    ------
    InputError
        A channel is missing, or is both an excitation and a response; values are not finite, or the recording is
        shorter than the filter.
    """
    with opened(path) as recording:
        source = recording.stream(stream)
        forces = matched_channels(source, excitations, exciting)
        motions = matched_channels(source, responses, responding)
        refuse_shared((m.channel.name for m in forces), (m.channel.name for m in motions), source.path.name)
        ratio = needed_ratio(source.sample_rate, needed)
        reduced = None
        # a long recording is not read twice: one with blows of a hammer is short
        if ratio != 1 and source.n_samples <= RECORDINGS.longest_unfiltered:
            unfiltered = band_recording(source, forces, motions, Fraction(1))
            reduced = _resampled_from_rest(unfiltered, ratio) if unfiltered.at_rest else None
        reduced = reduced or band_recording(source, forces, motions, ratio)
    return before_force_high_pass(reduced)


def require_room_at_rate(path: RecordingFile, n_channels: int, needed: float, *, stream: str | None = None) -> None:
    """Refuse a recording for which :func:`read_band_recording` has not enough memory, before a sample is read.

    ``needed`` is the sample rate (Hz) that is enough, as in :func:`read_band_recording`.
    """
    with opened(path) as recording:
        source = recording.stream(stream)
        ratio = needed_ratio(source.sample_rate, needed)
        require_room(source, n_channels, RECORDINGS.bytes_per_value, float(ratio))


def require_room_for_band(stream: Stream, n_channels: int, highest_frequency: float) -> None:
    """Refuse a recording for which :func:`band_of_channels` has not enough memory, before a sample is read.

    ``highest_frequency`` (Hz) is the upper end of the band that must stay flat.
    """
    ratio = whole_ratio(stream.sample_rate, highest_frequency)
    require_room(stream, n_channels, RECORDINGS.bytes_per_value, float(ratio))


def band_of_channels(
    stream: Stream,
    excitations: Sequence[Channel],
    responses: Sequence[Channel],
    highest_frequency: float,
    progress: Callable[[int], None] | None = None,
) -> BandRecording:
    """Read chosen channels of an open recording, and keep the band up to a frequency flat.

    Known input delays are removed. Known high-passes remain, and the channels of the result state them.

    Parameters
    ----------
    stream
        Samples of an open recording.
    excitations, responses
        Channels to keep, in the order of the columns.
    highest_frequency : Hz
        Upper end of the band that must stay flat.
    progress
        Called with the number of samples read so far.

    Raises
    ------
    InputError
        The band does not fit the sample rate, values are not finite, or the recording is shorter than the filter.
    """
    forces, motions = ([MatchedChannel(channel) for channel in side] for side in (excitations, responses))
    return band_recording(stream, forces, motions, whole_ratio(stream.sample_rate, highest_frequency), progress)
