"""`BandRecording`: forces and responses of one recording, reduced to the channels and the band that are needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, RecordingFile, Stream, aligned_blocks, opened, rows_left_out
from millfrf.core import InputError, Real

from .channel_matching import (
    DERIVATIVE_ORDERS,
    MatchedChannel,
    derivative_orders,
    high_pass_corners,
    kinematic_factor,
    matched_channels,
    refuse_shared,
)
from .resampling import Resampler, needed_ratio, require_room, resampled, starts_at_rest, whole_ratio, widest_band

BYTES_A_VALUE = 100.0
"""Memory for each value of a band recording in the jobs that use one: simulations and transforms of all of it."""


@dataclass(frozen=True)
class BandRecording:
    """Forces and responses of one recording, in the order of given channels or degrees of freedom.

    Parameters
    ----------
    name
        Name of the recording.
    rate
        Sample rate, Hz.
    force : (n_samples, n_excitations), SI
        Samples of the forces, or of what else excites.
    response : (n_samples, n_responses), SI
        Samples of the motions, or of what else responds.
    excitations, responses
        Channels along the columns, as the samples are: along the wanted directions and without known delays.
    start
        Time of the first sample after the recording's first, s.
    """

    name: str
    rate: float
    force: Real
    response: Real
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]
    start: float = 0.0

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the excitation channels, then of the response channels."""
        return tuple(channel.name for channel in (*self.excitations, *self.responses))

    @property
    def orders(self) -> NDArray[np.int64]:
        """Derivative order of each response, (n_responses,): 0 displacement, 1 velocity, 2 acceleration."""
        return derivative_orders(self.responses)

    @cached_property
    def at_rest(self) -> bool:
        """Whether nothing moved before the first force: see ``starts_at_rest``."""
        return starts_at_rest(self.force, self.response, self.rate)

    @property
    def usable_band(self) -> float:
        """Upper end of the flat, alias-free band, Hz."""
        return widest_band(self.rate)

    @property
    def duration(self) -> float:
        """Length of the recording, s."""
        return len(self.force) / self.rate

    @property
    def level(self) -> float:
        """Root mean square of the force, all directions together, N."""
        return float(np.sqrt(np.mean(np.sum((self.force - self.force.mean(axis=0)) ** 2, axis=1))))

    def part(self, name: str, first: int, last: int) -> "BandRecording":
        """Samples ``first`` to before ``last`` as a recording of their own, called ``name``."""
        kept = slice(first, last)
        start = self.start + first / self.rate
        return replace(self, name=name, force=self.force[kept], response=self.response[kept], start=start)

    def kinematic(self, frequencies: Real) -> NDArray[np.complex128]:
        """Factor (n, n_responses) from displacement to each measured quantity at frequencies (n,), Hz.

        See :func:`kinematic_factor`; known high-passes of the responses are in it.
        """
        return kinematic_factor(frequencies, self.orders, high_pass_corners(self.responses))


def band_recording(
    stream: Stream,
    excitations: Sequence[MatchedChannel],
    responses: Sequence[MatchedChannel],
    ratio: Fraction,
    progress: Callable[[int], None] | None = None,
) -> BandRecording:
    """Read a recording once, block by block, and bring it down to a lower rate.

    Known input delays are taken out.

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
    matched = (*excitations, *responses)
    require_room(stream, len(matched), BYTES_A_VALUE, float(ratio))
    names = [one.channel.name for one in matched]
    resampler, pieces, done = Resampler(stream.sample_rate, ratio), [np.empty((0, len(names)))], 0
    signs = np.array([one.sign for one in matched])
    for block in aligned_blocks(stream, names):
        _refuse_not_finite(block, names, stream.path)
        pieces.append(resampler.add(block * signs))
        done += len(block)
        if progress is not None:
            progress(done)
    samples = np.concatenate(pieces)
    if len(samples) < 2:
        raise InputError(
            f"{stream.path}: {stream.n_samples / stream.sample_rate:.3g} s are too short for a band up to "
            f"{widest_band(resampler.rate):g} Hz; record longer"
        )
    n, start = len(excitations), rows_left_out(stream, names) / stream.sample_rate + resampler.start
    channels = tuple(replace(one.as_wanted, input_delay_s=None) for one in matched)
    name = Path(stream.path).stem
    return BandRecording(name, resampler.rate, samples[:, :n], samples[:, n:], channels[:n], channels[n:], start)


def from_rest(raw: BandRecording, ratio: Fraction) -> BandRecording:
    """Bring a recording that begins at rest down to a lower rate, with its very beginning.

    A filter loses half its length at either end, and a blow at the beginning with it. Before rest there was nothing:
    it is put before the samples.

    Parameters
    ----------
    raw
        The recording as it was sampled.
    ratio
        New over old sample rate.
    """
    lead = int(Resampler(raw.rate, ratio).start * raw.rate)
    still = [np.median(one, axis=0) for one in (raw.force, raw.response)]
    whole = np.hstack(
        [np.vstack([np.tile(a, (lead, 1)), b]) for a, b in zip(still, (raw.force, raw.response), strict=True)]
    )
    samples, rate = resampled(whole, raw.rate, ratio)
    n, start = raw.force.shape[1], raw.start + Resampler(raw.rate, ratio).start - lead / raw.rate
    return replace(raw, rate=rate, force=samples[:, :n], response=samples[:, n:], start=start)


def before_force_high_pass(recording: BandRecording) -> BandRecording:
    """Forces before their channels' known first-order high-passes, ``f + w_corner int f dt``.

    The straight drift that the integral leaves lies below every band and is taken out. Channels of the result have no
    high-pass.
    """
    corners = high_pass_corners(recording.excitations)
    if not any(corners):
        return recording
    from scipy.integrate import cumulative_trapezoid
    from scipy.signal import detrend

    whole = recording.force.copy()
    for column, corner in enumerate(corners):
        if corner > 0:
            seen = whole[:, column] - whole[:, column].mean()
            drift = cumulative_trapezoid(seen, dx=1 / recording.rate, initial=0.0)
            whole[:, column] += detrend(2 * np.pi * corner * drift)
    excitations = tuple(replace(channel, high_pass_hz=None) for channel in recording.excitations)
    return replace(recording, force=whole, excitations=excitations)


def _refuse_not_finite(samples: Real, names: Sequence[str], path: Path) -> None:
    """Refuse samples (n, n_channels) that are NaN or infinite."""
    bad = ~np.isfinite(samples).all(axis=0)
    if bad.any():
        name = names[int(np.argmax(bad))]
        raise InputError(f"{path.name}: channel {name} holds values that are not finite; cut them out first")


EXCITING = ("force", "voltage")
"""Quantities that drive a structure or a transducer at a degree of freedom, where no other is named."""


MOST_LOOKED_AT = 2_000_000
"""Samples of a recording that is looked at whole before it is filtered: one with blows of a hammer is short."""


def read_band_recording(
    path: RecordingFile,
    excitations: Sequence[str],
    responses: Sequence[str],
    needed: float,
    *,
    stream: str | None = None,
    exciting: Sequence[str] = EXCITING,
    responding: Sequence[str] = tuple(DERIVATIVE_ORDERS),
) -> BandRecording:
    """Read forces and motions at degrees of freedom, in that order and along those directions.

    Known input delays and known high-passes of the forces are taken out.

    Parameters
    ----------
    path
        File of the recording.
    excitations
        Degrees of freedom (``node:direction``) of what drives the structure.
    responses
        Degrees of freedom of what responds.
    needed
        Sample rate that is enough, Hz; a recording that was sampled much faster is brought down to about it.
    stream
        Sample clock; None: the only one.
    exciting, responding
        Quantities of :data:`millfrf.core.SI_UNITS` that excitations and responses may have.

    Raises
    ------
    InputError
        A channel is missing, or would excite and respond at once; values are not finite, or the recording is shorter
        than the filter.
    """
    with opened(path) as recording:
        source = recording.stream(stream)
        forces = matched_channels(source, excitations, exciting)
        motions = matched_channels(source, responses, responding)
        refuse_shared([one.channel.name for one in forces], [one.channel.name for one in motions], source.path.name)
        ratio = needed_ratio(source.sample_rate, needed)
        found = _from_rest(source, forces, motions, ratio) or band_recording(source, forces, motions, ratio)
    return before_force_high_pass(found)


def require_room_at_rate(path: RecordingFile, n_channels: int, needed: float, *, stream: str | None = None) -> None:
    """Refuse a recording that :func:`read_band_recording` has no memory for, before a sample is read.

    Parameters
    ----------
    path
        File of the recording.
    n_channels
        Number of channels that will be read.
    needed
        Sample rate that is enough, Hz.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        It is too long; the line says how long it may be.
    """
    with opened(path) as recording:
        source = recording.stream(stream)
        require_room(source, n_channels, BYTES_A_VALUE, float(needed_ratio(source.sample_rate, needed)))


def require_room_for_band(stream: Stream, n_channels: int, highest_frequency: float) -> None:
    """Refuse a recording that :func:`band_of_channels` has no memory for, before a sample is read.

    Parameters
    ----------
    stream
        Samples of an open recording.
    n_channels
        Number of channels that will be read.
    highest_frequency
        Upper end of the band that must stay flat, Hz.

    Raises
    ------
    InputError
        It is too long, or the band does not fit the sample rate.
    """
    require_room(stream, n_channels, BYTES_A_VALUE, float(whole_ratio(stream.sample_rate, highest_frequency)))


def _from_rest(
    source: Stream, forces: Sequence[MatchedChannel], motions: Sequence[MatchedChannel], ratio: Fraction
) -> BandRecording | None:
    """The recording with its very beginning, if it begins at rest and a filter would cost that; else None."""
    if ratio == 1 or source.n_samples > MOST_LOOKED_AT:
        return None
    raw = band_recording(source, forces, motions, Fraction(1))
    return from_rest(raw, ratio) if raw.at_rest else None


def band_of_channels(
    stream: Stream,
    excitations: Sequence[Channel],
    responses: Sequence[Channel],
    highest_frequency: float,
    progress: Callable[[int], None] | None = None,
) -> BandRecording:
    """Read chosen channels of an open recording, and keep the band up to a frequency flat.

    Known input delays are taken out. Known high-passes stay, and the channels of the result state them.

    Parameters
    ----------
    stream
        Samples of an open recording.
    excitations, responses
        Channels to keep, in the order of the columns.
    highest_frequency
        Upper end of the band that must stay flat, Hz.
    progress
        Called with the number of samples read so far.

    Raises
    ------
    InputError
        The band does not fit the sample rate, values are not finite, or the recording is shorter than the filter.
    """
    forces, motions = ([MatchedChannel(one) for one in side] for side in (excitations, responses))
    return band_recording(stream, forces, motions, whole_ratio(stream.sample_rate, highest_frequency), progress)
