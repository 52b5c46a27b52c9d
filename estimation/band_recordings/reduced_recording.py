"""`BandRecording`: forces and responses of one recording, reduced to the channels and the band that are needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, Stream, aligned_blocks, rows_left_out
from foundation import InputError

from .channel_matching import MatchedChannel
from .motion_quantities import derivative_orders, high_pass_corners, kinematic_factor
from .resampling import Resampler, resampled, widest_band
from .rest import starts_at_rest
from .room import require_room

Real = NDArray[np.float64]

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
