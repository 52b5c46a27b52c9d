"""All figures of the page, and what there is to choose from."""

from collections.abc import Sequence

from acquisition import Channel

from ..monitor import LiveMonitor
from .drawing import Choice, Drawing
from .frequency_drawings import enough, spectrum, transfer
from .time_drawings import levels, traces

_SPECTRA_SHOWN = 4


def roles(channels: Sequence[Channel]) -> tuple[list[Channel], list[Channel]]:
    """Excitations and responses among channels, in the order of the spectra."""
    from estimation import EXCITING, RESPONDING

    excitations = [channel for channel in channels if channel.quantity in EXCITING and channel.node]
    return excitations, [channel for channel in channels if channel.quantity in RESPONDING]


def names_of(monitor: LiveMonitor) -> dict[str, list[str]]:
    """Names to choose from: excitations and responses."""
    excitations, responses = roles(monitor.channels)
    return {"excitations": [one.name for one in excitations], "responses": [one.name for one in responses]}


def first_choice(monitor: LiveMonitor) -> Choice:
    """What a page shows before anything is chosen."""
    excitations, responses = roles(monitor.channels)
    n = len(excitations) + len(responses)
    return Choice(0, 0, tuple(range(min(n, _SPECTRA_SHOWN))), len(responses), len(excitations))


def all_drawings(monitor: LiveMonitor) -> list[Drawing]:
    """Make the figures of the page; each belongs to one server."""
    excitations, responses = roles(monitor.channels)
    drawings = [traces(monitor.channels), levels(monitor.channels)]
    if not excitations or not responses:
        return drawings
    return [
        *drawings,
        spectrum([*excitations, *responses], monitor.band),
        *(transfer(kind, responses, excitations, monitor.band) for kind in ("magnitude", "phase", "coherence")),
        enough(monitor.judged_band),
    ]
