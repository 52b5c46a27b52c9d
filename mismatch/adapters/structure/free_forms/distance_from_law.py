"""How far a joint's force of free form lies from the textbook law, and what the force follows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ....joints import driven_force
from ....models import Hypothesis, predict_lines

Real = NDArray[np.float64]

BINS = 201
"""Number of bins of deflection or velocity, evenly wide, in which means of the force are taken."""

MOSTLY = 0.8
"""Share of the force's power from which it is said to follow one quantity."""


@dataclass(frozen=True)
class FormOfLaw:
    """A joint's force of free form beside a textbook law, both along the motion of the free form.

    A linear spring and damper are taken off both: they cannot be told from the structure's own.

    Parameters
    ----------
    distance
        Share of the force's root mean square that the textbook law cannot give with any amplitude, 0 to 1.
    by_deflection, by_velocity
        Shares of the force's power that a function of the deflection alone, and of the velocity alone, gives.
    lost
        Share of the power that the force could take from the motion, which it takes: 1 for a force that is in phase
        with the velocity, 0 for a spring; negative for one that feeds the motion.
    """

    distance: float
    by_deflection: float
    by_velocity: float
    lost: float

    @property
    def kind(self) -> str:
        """What the force is: ``elastic``, ``dissipative``, or neither alone.

        Examples
        --------
        >>> FormOfLaw(0.1, 0.95, 0.02, 0.01).kind
        'elastic: it follows the deflection'
        >>> FormOfLaw(0.1, 0.02, 0.9, 0.8).kind
        'dissipative: it follows the velocity'
        """
        if self.by_deflection > MOSTLY:
            return "elastic: it follows the deflection"
        if self.by_velocity > MOSTLY:
            return "dissipative: it follows the velocity"
        return "one with memory, or elastic and dissipative at once"


def form_of_law(free: Hypothesis, named: Hypothesis, place: int, lines: Sequence[WindowedSpectrum]) -> FormOfLaw:
    """Compare a law of free form with the law that it frees.

    Parameters
    ----------
    free, named
        Hypotheses with the same joints in the same order.
    place
        Number of the joint among the laws.
    lines
        Windowed spectra of the recordings, whose motion is followed.
    """
    parts = [_forces(free, named, place, one) for one in lines]
    x, v, force, law = (np.concatenate([part[k] for part in parts]) for k in range(4))
    linear = np.stack([x, v], axis=1)
    bent = _without(force, linear)
    size = float(bent @ bent)
    if size <= 0.0:
        return FormOfLaw(0.0, 0.0, 0.0, 0.0)
    other = _without(law, linear)
    missing = _without(bent, other[:, None]) if float(other @ other) > 0 else bent
    return FormOfLaw(
        float(np.sqrt(missing @ missing / size)),
        _followed(x, bent) / size,
        _followed(v, bent) / size,
        float(force @ v / np.sqrt((force @ force) * (v @ v))),
    )


def _forces(free: Hypothesis, named: Hypothesis, place: int, lines: WindowedSpectrum) -> tuple[Real, Real, Real, Real]:
    """Deflection (m), velocity (m/s) and the forces of both laws along them (N), each (n_samples,)."""
    answer = predict_lines(free, lines).joints[place]
    often = len(answer.deflection) // lines.padded
    n = often * len(lines.recording.force)
    x, v = answer.deflection[:n], answer.velocity[:n]
    force, law = (driven_force(lines, x, v, one.laws[place].law(), often=often) for one in (free, named))
    return x[::often], v[::often], force[::often], law[::often]


def _without(signal: Real, others: Real) -> Real:
    """A signal (n,) less its projection on others (n, k)."""
    sizes = np.sqrt(np.sum(others**2, axis=0))
    units = others / np.where(sizes > 0, sizes, 1.0)
    return np.asarray(signal - units @ np.linalg.lstsq(units, signal, rcond=None)[0])


def _followed(values: Real, force: Real) -> float:
    """Power of a force that its means in bins of some values give."""
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    place = np.digitize(values, edges[1:-1])
    count = np.maximum(np.bincount(place, minlength=BINS), 1)
    means = np.bincount(place, force, BINS) / count
    return float(np.sum(count * means**2))
