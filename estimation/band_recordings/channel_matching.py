"""Matching of channels to degrees of freedom, and conversion among displacement, velocity and acceleration."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import Channel, Stream
from millfrf.core import SI_UNITS, Complex, DegreeOfFreedom, Index, InputError, Real

# how many times a displacement or an angle is differentiated to give the quantity
DERIVATIVE_ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2, "angle": 0, "angular_velocity": 1}


@dataclass(frozen=True)
class MatchedChannel:
    """A channel that measures at a requested degree of freedom."""

    channel: Channel  # as the recording describes it
    # +1, or -1 where the channel points against the requested direction: its samples are multiplied by it
    sign: float = 1.0

    @property
    def as_requested(self) -> Channel:
        """Return the channel with the requested direction."""
        if self.sign > 0:
            return self.channel
        opposite = "-" if self.channel.direction.startswith("+") else "+"
        return replace(self.channel, direction=opposite + self.channel.direction[1:])


def channel_at(channels: Iterable[Channel], label: str, quantities: Collection[str]) -> MatchedChannel | None:
    """Find the first channel of some quantities at a degree of freedom; None where there is none.

    Parameters
    ----------
    channels
        Channels of a recording.
    label
        Degree of freedom, ``node:direction``.
    quantities
        Any of :data:`millfrf.core.SI_UNITS`.

    Examples
    --------
    >>> match = channel_at([Channel("fx", "force", "N", "TCP", "-X")], "TCP:+X", ("force",))
    >>> match.channel.name, match.sign
    ('fx', -1.0)
    """
    requested = DegreeOfFreedom.parse(label)
    for channel in channels:
        if channel.quantity in quantities and channel.node:
            measured = DegreeOfFreedom(channel.node, channel.direction)
            if (measured.node, measured.axis) == (requested.node, requested.axis):
                return MatchedChannel(channel, measured.sign * requested.sign)
    return None


def matched_channels(stream: Stream, labels: Sequence[str], quantities: Collection[str]) -> tuple[MatchedChannel, ...]:
    """Find the channel at each degree of freedom, in their order; raise an error where there is none."""
    matches = []
    for label in labels:
        match = channel_at(stream.channels, label, quantities)
        if match is None:
            raise InputError(
                f"{stream.path.name}: no {' or '.join(quantities)} at {label}, which is needed; "
                f"it has {channels_in_words(stream.channels)}"
            )
        matches.append(match)
    return tuple(matches)


def refuse_shared(exciting: Iterable[str], responding: Iterable[str], file: str) -> None:
    """Refuse channels of a file, given by name, that are both excitation and response.

    An excitation and a response of the same quantity at the same place would be matched to one channel.
    """
    shared = sorted({*exciting} & {*responding})
    if shared:
        raise InputError(
            f"{file}: {', '.join(shared)} would excite and respond at once; give excitation and response "
            "different nodes, such as BASE:+X and TIP:+X, and fit again"
        )


def names_at(channels: Iterable[Channel], labels: Sequence[str], quantities: Collection[str]) -> tuple[str, ...]:
    """List the names of all channels of given quantities at any of the given degrees of freedom, in either direction.

    A label without a node matches no channel.
    """
    places = [label for label in labels if ":" in label]
    return tuple(
        channel.name for channel in channels if any(channel_at([channel], label, quantities) for label in places)
    )


def channels_in_words(channels: Iterable[Channel]) -> str:
    """Write names, quantities and places of channels, for messages: ``fx (force TCP:+X)``."""
    return ", ".join(f"{channel.name} ({channel.quantity} {channel.degree_of_freedom})" for channel in channels)


def channels_of(quantity: str, labels: Sequence[str], names: Sequence[str] = ()) -> tuple[Channel, ...]:
    """Make channels of one quantity at degrees of freedom, for samples in memory.

    Parameters
    ----------
    quantity
        One of :data:`millfrf.core.SI_UNITS`.
    labels
        Degrees of freedom, ``node:direction``.
    names
        Names of the channels; empty: quantity and degree of freedom.

    Examples
    --------
    >>> channels_of("force", ["TCP:+X"], ["fx"])[0].degree_of_freedom
    'TCP:+X'
    """
    places = [DegreeOfFreedom.parse(label) for label in labels]
    return tuple(
        Channel(name, quantity, SI_UNITS[quantity], place.node, place.direction)
        for name, place in zip(names or [f"{quantity} {label}" for label in labels], places, strict=True)
    )


def derivative_orders(channels: Sequence[Channel]) -> Index:
    """Return the derivative order of each channel, (n_channels,); 0 for a quantity that is no motion."""
    return np.array([DERIVATIVE_ORDERS.get(channel.quantity, 0) for channel in channels], dtype=np.int64)


def high_pass_corners(channels: Sequence[Channel]) -> tuple[float, ...]:
    """Return the corner of each channel's known first-order high-pass, Hz; 0 where none is known."""
    return tuple(channel.high_pass_hz or 0.0 for channel in channels)


def kinematic_factor(frequencies: Real, orders: Index, corners: Sequence[float]) -> Complex:
    """Compute the factor from displacement to the measured quantity, ``(i w)^order  i w / (i w + w_corner)``.

    Parameters
    ----------
    frequencies : (n,), Hz
        Frequencies of the lines.
    orders : (n_channels,)
        Derivative orders: 0 displacement, 1 velocity, 2 acceleration.
    corners : (n_channels,), Hz
        Corners of known first-order high-passes; 0: none.

    Returns
    -------
    (n, n_channels)

    Examples
    --------
    >>> kinematic_factor(np.array([0.5 / np.pi]), np.array([0, 1, 2]), (0.0, 0.0, 0.0)).round(9).tolist()
    [[(1+0j), 1j, (-1+0j)]]
    """
    s = 2j * np.pi * np.asarray(frequencies, dtype=float)[:, None]
    factor = np.asarray(s**orders)
    for column, corner in enumerate(corners):
        if corner > 0:
            factor[:, column] *= s[:, 0] / (s[:, 0] + 2 * np.pi * corner)
    return factor


def before_high_pass(s: Complex, corners: Sequence[float]) -> Complex:
    """Compute the factor that undoes first-order high-passes of sensors, ``(s + w_corner) / s``.

    Parameters
    ----------
    s : (n,), 1/s
        ``i w``, or ``i w + 1/tau`` under an exponential window. At 0 Hz the factor is 1: nothing passes there.
    corners : (n_channels,), Hz
        Corners of known first-order high-passes; 0: none.

    Returns
    -------
    (n, n_channels)
    """
    factor = np.ones((len(s), len(corners)), dtype=complex)
    for column, corner in enumerate(corners):
        if corner > 0:
            np.divide(s + 2 * np.pi * corner, s, out=factor[:, column], where=s.imag > 0)
    return factor
