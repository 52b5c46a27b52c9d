"""Matching of channels to degrees of freedom, with their signs."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from acquisition import Channel, Stream
from foundation import SI_UNITS, DegreeOfFreedom, InputError


@dataclass(frozen=True)
class MatchedChannel:
    """A channel that measures at a wanted degree of freedom.

    Parameters
    ----------
    channel
        As the recording describes it.
    sign
        +1, or -1 where the channel points against the wanted direction: its samples are multiplied by it.
    """

    channel: Channel
    sign: float = 1.0

    @property
    def as_wanted(self) -> Channel:
        """The channel with the wanted direction."""
        if self.sign > 0:
            return self.channel
        turned = "-" if self.channel.direction.startswith("+") else "+"
        return replace(self.channel, direction=turned + self.channel.direction[1:])


def channel_at(channels: Iterable[Channel], label: str, quantities: Collection[str]) -> MatchedChannel | None:
    """The first channel of some quantities at a degree of freedom; None where there is none.

    Parameters
    ----------
    channels
        Channels of a recording.
    label
        Degree of freedom, ``node:direction``.
    quantities
        Any of :data:`foundation.SI_UNITS`.

    Examples
    --------
    >>> found = channel_at([Channel("fx", "force", "N", "TCP", "-X")], "TCP:+X", ("force",))
    >>> found.channel.name, found.sign
    ('fx', -1.0)
    """
    aim = DegreeOfFreedom.parse(label)
    for channel in channels:
        if channel.quantity in quantities and channel.node:
            here = DegreeOfFreedom(channel.node, channel.direction)
            if (here.node, here.axis) == (aim.node, aim.axis):
                return MatchedChannel(channel, here.sign * aim.sign)
    return None


def matched_channels(stream: Stream, labels: Sequence[str], quantities: Collection[str]) -> tuple[MatchedChannel, ...]:
    """The channel at each degree of freedom, in that order.

    Parameters
    ----------
    stream
        Samples of an open recording.
    labels
        Degrees of freedom, ``node:direction``.
    quantities
        Any of :data:`foundation.SI_UNITS`.

    Raises
    ------
    InputError
        A degree of freedom without a channel of these quantities.
    """
    found = []
    for label in labels:
        one = channel_at(stream.channels, label, quantities)
        if one is None:
            raise InputError(
                f"{stream.path.name}: no {' or '.join(quantities)} at {label}, which is needed; "
                f"it has {channels_in_words(stream.channels)}"
            )
        found.append(one)
    return tuple(found)


def refuse_shared(exciting: Iterable[str], responding: Iterable[str], file: str) -> None:
    """Refuse channels that would excite and respond at once, as they are of one quantity and place.

    Parameters
    ----------
    exciting, responding
        Names of channels.
    file
        Name of the recording, for the message.

    Raises
    ------
    InputError
        With the names and the remedy.
    """
    shared = sorted({*exciting} & {*responding})
    if shared:
        raise InputError(
            f"{file}: {', '.join(shared)} would excite and respond at once; give what drives and what answers "
            "different nodes, such as BASE:+X and TIP:+X, and fit again"
        )


def names_at(channels: Iterable[Channel], labels: Sequence[str], quantities: Collection[str]) -> tuple[str, ...]:
    """Names of all channels of some quantities at any of some degrees of freedom, whichever way they point.

    A label without a place, as of a channel that has none, matches nothing.
    """
    placed = [label for label in labels if ":" in label]
    return tuple(
        channel.name for channel in channels if any(channel_at([channel], label, quantities) for label in placed)
    )


def channels_in_words(channels: Iterable[Channel]) -> str:
    """Names, quantities and places of channels, for messages.

    Examples
    --------
    >>> channels_in_words([Channel("fx", "force", "N", "TCP", "+X")])
    'fx (force TCP:+X)'
    """
    return ", ".join(f"{channel.name} ({channel.quantity} {channel.degree_of_freedom})" for channel in channels)


def channels_of(quantity: str, labels: Sequence[str], names: Sequence[str] = ()) -> tuple[Channel, ...]:
    """Channels of one quantity at degrees of freedom, for samples in memory.

    Parameters
    ----------
    quantity
        One of :data:`foundation.SI_UNITS`.
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
    called = names or [f"{quantity} {label}" for label in labels]
    return tuple(
        Channel(name, quantity, SI_UNITS[quantity], place.node, place.direction)
        for name, place in zip(called, places, strict=True)
    )
