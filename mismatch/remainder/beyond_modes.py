"""Doubts about a model that states no band: response outside its modes that moves with the forces and that it lacks."""

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..models import Hypothesis, predict_lines

Complex = NDArray[np.complex128]

ASIDE = 1.3
"""Frequency over the highest mode (lowest mode over frequency) from which a line lies outside the modes."""

WINDOW = 32
"""Neighbouring lines over which a receptance is taken for constant."""

CLEAR = 0.25
"""Share of the response's power outside the modes that the model must lack for a doubt."""

NOT_SMALL = 1e-3
"""Least share of a channel's whole power that the power moved by forces outside the modes must be."""


def beyond_model(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> tuple[str, ...]:
    """One doubt for each side of the modes where recordings show response that the model does not give.

    In windows of neighbouring lines the residual is regressed on the forces; what the forces explain beyond chance is
    response of the structure, not noise, and a model without modes there cannot know it.

    Parameters
    ----------
    hypothesis
        The model, refitted or not.
    lines
        Windowed lines of every recording that is compared.
    """
    model = hypothesis.model
    if model.band is not None:
        return ()
    natural = model.natural_frequencies
    sides = (
        (0.0, float(natural.min()) / ASIDE, "below the lowest mode"),
        (float(natural.max()) * ASIDE, np.inf, "above the highest mode"),
    )
    return tuple(said for low, high, place in sides if (said := _doubt(hypothesis, lines, (low, high), place)))


def _doubt(hypothesis: Hypothesis, lines: list[WindowedSpectrum], edges: tuple[float, float], place: str) -> str:
    """The sentence for one side; empty where nothing is missed there in half of the recordings."""
    lacking = []
    for one in lines:
        inside = (one.frequencies >= edges[0]) & (one.frequencies <= edges[1])
        if inside.sum() < 2 * WINDOW:
            return ""
        rest = (one.measured - predict_lines(hypothesis, one).response)[inside]
        moved = _moved_by_forces(rest, one.force_here[inside])
        here = np.sum(np.abs(one.measured[inside]) ** 2, axis=0)
        whole = np.sum(np.abs(one.measured) ** 2, axis=0)
        lacking.append(float(np.max(np.where(moved > NOT_SMALL * whole, moved / here, 0.0))))
    if np.median(lacking) < CLEAR:
        return ""
    low, high = max(edges[0], float(lines[0].frequencies[0])), min(edges[1], float(lines[0].frequencies[-1]))
    return (
        f"{place}, from {low:.3g} to {high:.3g} Hz, {100 * float(np.median(lacking)):.0f} % of the response's power "
        "moves with the forces and is not in the model, which states no band: it may have been fitted to a narrower "
        "one. Fit it again, or write band_hz into its file, and diagnose inside that band"
    )


def _moved_by_forces(rest: Complex, force: Complex) -> NDArray[np.float64]:
    """Power of a residual (n_lines, n_responses) that forces explain beyond chance, (n_responses,)."""
    total = np.zeros(rest.shape[1])
    count = force.shape[1]
    for rows in np.array_split(np.arange(len(rest)), max(1, len(rest) // WINDOW)):
        left = rest[rows] - force[rows] @ np.linalg.lstsq(force[rows], rest[rows], rcond=1e-6)[0]
        own, unmoved = (np.sum(np.abs(part) ** 2, axis=0) for part in (rest[rows], left))
        total += np.maximum(own - unmoved * len(rows) / max(len(rows) - count, 1), 0.0)
    return total
