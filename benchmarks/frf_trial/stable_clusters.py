"""Automatic choice of poles from a stabilisation chart, the same for all rivals, whose own choice is by hand.

A pole of one order is stable where the order before has one within 1 % of frequency and 10 % of damping whose vector
agrees (MAC 0.8; where the rival gives vectors). Stable poles are followed from order to order, one to one, nearest
first; tracks that break off and go on at the same pole are one. A track is taken for a mode where it lasts over three
of ten orders; frequency and damping are its medians. A track that lies within a quarter of a half-power
bandwidth of a longer one, with an equal vector where there are any, is a double and left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .problem import FoundMode

Complex = NDArray[np.complex128]
FREQUENCY, DAMPING, ASSURANCE = 0.01, 0.10, 0.80
LARGEST_DAMPING = 0.2
SHARE = 0.3
"""Of the orders.

Damping, assurance and this were tried in 17 combinations (10, 20, 30 %; 0.8, 0.95; 0.15, 0.2, 0.3) on five fits of the
plane and 16 sets of seed 1001: these find the most modes less the invented ones, of sdypy-EMA and SDynPy together.
"""
CANDIDATE_ORDERS = 3
"""A track over this many orders is one that a user could pick by hand."""


@dataclass(frozen=True)
class OrderPoles:
    """Poles of one order, rad/s, (n,), and their vectors (n, n_components) or None."""

    poles: Complex
    vectors: Complex | None = None


@dataclass
class _Track:
    orders: list[int]
    poles: list[complex]
    vector: Complex | None

    @property
    def centre(self) -> complex:
        return complex(np.median(np.real(self.poles)), np.median(np.imag(self.poles)))


def choose(orders: Sequence[OrderPoles], band: tuple[float, float], share: float = SHARE) -> tuple[FoundMode, ...]:
    """Modes of a chart inside ``band`` (Hz): tracks over ``share`` of the orders, doubles left out."""
    tracks = _tracks([_usable(order, band) for order in orders])
    least = max(CANDIDATE_ORDERS, share * len(orders))
    kept: list[_Track] = []
    for track in sorted(tracks, key=lambda t: -len(t.orders)):
        if len(track.orders) >= least and not any(_double(track, other) for other in kept):
            kept.append(track)
    return tuple(_mode(track) for track in sorted(kept, key=lambda t: abs(t.centre)))


def candidates(orders: Sequence[OrderPoles], band: tuple[float, float]) -> tuple[FoundMode, ...]:
    """Every track that a user could pick."""
    tracks = _tracks([_usable(order, band) for order in orders])
    return tuple(_mode(track) for track in tracks if len(track.orders) >= CANDIDATE_ORDERS)


def _usable(order: OrderPoles, band: tuple[float, float]) -> OrderPoles:
    """Inside the band, damped, and damped little enough to be a mode; upper half plane."""
    poles = np.asarray(order.poles)
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.abs(poles)
        f, zeta = size / (2 * np.pi), -poles.real / size
        keep = np.isfinite(poles) & (poles.imag > 0) & (zeta > 0) & (zeta < LARGEST_DAMPING)
        keep &= (f >= band[0]) & (f <= band[1])
    return OrderPoles(poles[keep], None if order.vectors is None else np.asarray(order.vectors)[keep])


def _tracks(orders: list[OrderPoles]) -> list[_Track]:
    ended: list[_Track] = []
    alive: list[tuple[int, _Track]] = []  # index of the pole in the last order, and its track
    before: OrderPoles | None = None
    for number, order in enumerate(orders):
        links = {} if before is None else _links(before, order)
        owners, going = dict(alive), []
        for here, there in links.items():
            track = owners.pop(there, None) or _Track([], [], None)
            track.orders.append(number)
            track.poles.append(complex(order.poles[here]))
            track.vector = None if order.vectors is None else order.vectors[here]
            going.append((here, track))
        ended += owners.values()
        alive, before = going, order
    return _rejoined([*ended, *(track for _, track in alive)])


def _links(before: OrderPoles, after: OrderPoles) -> dict[int, int]:
    """Index of a stable pole to that of its forerunner, one to one, nearest first."""
    if not len(before.poles) or not len(after.poles):
        return {}
    a, b = after.poles[:, None], before.poles[None, :]
    zeta_a, zeta_b = -a.real / np.abs(a), -b.real / np.abs(b)
    stable = np.abs(np.abs(a) - np.abs(b)) < FREQUENCY * np.abs(b)
    stable &= np.abs(zeta_a - zeta_b) < DAMPING * zeta_b
    if after.vectors is not None and before.vectors is not None:
        stable &= _assurances(after.vectors, before.vectors) > ASSURANCE
    distance = np.where(stable, np.abs(a - b), np.inf)
    links: dict[int, int] = {}
    for flat in np.argsort(distance, axis=None):
        here, there = np.unravel_index(flat, distance.shape)
        if not np.isfinite(distance[here, there]):
            break
        if int(here) not in links and int(there) not in links.values():
            links[int(here)] = int(there)
    return links


def _assurances(a: Complex, b: Complex) -> NDArray[np.float64]:
    products = np.abs(a.conj() @ b.T) ** 2
    return np.asarray(products / np.outer(np.sum(np.abs(a) ** 2, axis=1), np.sum(np.abs(b) ** 2, axis=1)))


def _rejoined(tracks: list[_Track]) -> list[_Track]:
    """Tracks at the same pole that share no order become one; the longer keeps its place."""
    joined: list[_Track] = []
    centres = np.empty(len(tracks), dtype=complex)
    for track in sorted(tracks, key=lambda t: -len(t.orders)):
        centre, known = track.centre, centres[: len(joined)]
        near = np.flatnonzero(np.abs(centre - known) < 0.25 * np.abs(known.real))
        free = (joined[k] for k in near if not set(track.orders) & set(joined[k].orders))
        other = next((candidate for candidate in free if _agree(track, candidate)), None)
        if other is not None:
            other.orders += track.orders
            other.poles += track.poles
        else:
            centres[len(joined)] = centre
            joined.append(track)
    return joined


def _double(track: _Track, longer: _Track) -> bool:
    return bool(abs(track.centre.imag - longer.centre.imag) < 0.5 * abs(longer.centre.real) and _agree(track, longer))


def _agree(one: _Track, other: _Track) -> bool:
    if one.vector is None or other.vector is None:
        return True
    return bool(_assurances(one.vector[None], other.vector[None])[0, 0] > ASSURANCE)


def _mode(track: _Track) -> FoundMode:
    size = np.abs(track.poles)
    zeta = -np.real(track.poles) / size
    return FoundMode(float(np.median(size) / (2 * np.pi)), float(np.median(zeta)))
