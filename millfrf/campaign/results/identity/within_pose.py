"""Modes of the sets of one pose: which are the same."""

from collections.abc import Sequence

from .one_mode import SeenMode, mean_mode
from .pairing import Pairing, pair_modes

FREQUENCY_SCALE = 0.03
"""Difference of the logarithms of frequency in one posture that weighs one: drift and scatter are a few per cent."""

ROUNDS = 3
"""How often the means of tracks are taken anew and modes are paired with them again."""

Track = dict[int, tuple[int, Pairing]]
"""Mode number and pairing by the number of the set."""


def tracks_of_pose(sets: Sequence[Sequence[SeenMode]]) -> list[Track]:
    """Tracks of modes through the sets of a pose, in the order of their frequencies.

    The set with the most modes begins; the others are paired with the means of the tracks, and modes without a partner
    begin tracks of their own.

    Parameters
    ----------
    sets
        Modes of each set.
    """
    order = sorted(range(len(sets)), key=lambda s: (-len(sets[s]), s))
    tracks: list[Track] = []
    for turn in range(ROUNDS):
        fresh: list[Track] = [{} for _ in tracks]
        for s in order:
            means = _means(sets, tracks if turn else fresh)
            _assign(s, sets[s], means, fresh)
        tracks = [track for track in fresh if track]
    frequency = [mean_mode(_modes(sets, track)).log_frequency for track in tracks]
    return [tracks[k] for k in sorted(range(len(tracks)), key=lambda k: frequency[k])]


def _assign(s: int, modes: Sequence[SeenMode], means: Sequence[SeenMode], tracks: list[Track]) -> None:
    """Put the modes of one set into tracks; those without a partner begin new ones."""
    pairs = pair_modes(modes, means, FREQUENCY_SCALE)
    for pair in pairs:
        tracks[pair.second][s] = (pair.first, pair)
    for i in sorted(set(range(len(modes))) - {pair.first for pair in pairs}):
        tracks.append({s: (i, Pairing(i, len(tracks), 1.0, float("inf")))})


def _means(sets: Sequence[Sequence[SeenMode]], tracks: Sequence[Track]) -> list[SeenMode]:
    return [mean_mode(_modes(sets, track)) for track in tracks]


def _modes(sets: Sequence[Sequence[SeenMode]], track: Track) -> list[SeenMode]:
    return [sets[s][i] for s, (i, _) in sorted(track.items())]
