"""Reading a recording at given degrees of freedom or channels, brought down to the rate that is needed."""

import os
from collections.abc import Callable, Sequence
from fractions import Fraction

from acquisition import Channel, Recording, Stream

from .channel_matching import MatchedChannel, matched_channels, refuse_shared
from .motion_quantities import DERIVATIVE_ORDERS
from .reduced_recording import BYTES_A_VALUE, BandRecording, band_recording, before_force_high_pass, from_rest
from .resampling import needed_ratio, whole_ratio
from .room import require_room

EXCITING = ("force", "voltage")
"""Quantities that drive a structure or a transducer at a degree of freedom, where no other is named."""


MOST_LOOKED_AT = 2_000_000
"""Samples of a recording that is looked at whole before it is filtered: one with blows of a hammer is short."""


def read_band_recording(
    path: str | os.PathLike[str],
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
        Quantities of :data:`foundation.SI_UNITS` that excitations and responses may have.

    Raises
    ------
    InputError
        A channel is missing, or would excite and respond at once; values are not finite, or the recording is shorter
        than the filter.
    """
    with Recording(path) as recording:
        source = recording.stream(stream)
        forces = matched_channels(source, excitations, exciting)
        motions = matched_channels(source, responses, responding)
        refuse_shared([one.channel.name for one in forces], [one.channel.name for one in motions], source.path.name)
        ratio = needed_ratio(source.sample_rate, needed)
        found = _from_rest(source, forces, motions, ratio) or band_recording(source, forces, motions, ratio)
    return before_force_high_pass(found)


def require_room_at_rate(
    path: str | os.PathLike[str], n_channels: int, needed: float, *, stream: str | None = None
) -> None:
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
    with Recording(path) as recording:
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
