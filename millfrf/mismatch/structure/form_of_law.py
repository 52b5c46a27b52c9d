"""Comparison of a joint force of free form with the force of a law: size, what it follows, and how it grows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..joints.joint_law import driven_force
from ..models.first_motion import predict_lines
from ..models.hypothesis import Hypothesis

BINS = 201  # number of bins of deflection or velocity, evenly wide, in which means of the force are taken

LEVELS_APART = 1.2  # ratio of the largest to the smallest deflection from which the growth of a force is stated

DOMINANT = 0.8  # least share of the force's power that a quantity must explain for the force to follow this quantity


@dataclass(frozen=True)
class FormOfLaw:
    """Comparison of a joint force of free form with the force of a law of the library for the same motion.

    A linear spring and a linear damper are removed from both forces, as the data cannot distinguish them from the
    stiffness and damping of the structure.
    """

    distance: float  # share of the root mean square force that the law cannot describe with any amplitude, 0 to 1
    # shares of the power of the force that a function of the deflection, or of the velocity, alone describes
    by_deflection: float
    by_velocity: float
    # mean power taken from the motion over the largest possible one: 1 for a force in phase with the velocity, 0 for a
    # spring, negative for a force that adds energy to the motion
    lost: float
    # exponent with which the force grows with the deflection from recording to recording; NaN for one level
    growth: float = float("nan")
    law_growth: float = float("nan")  # the same exponent of the law's force

    @property
    def kind(self) -> str:
        """Description of the force: ``elastic``, ``dissipative``, or neither alone.

        Examples
        --------
        >>> FormOfLaw(0.1, 0.95, 0.02, 0.01).kind
        'elastic: it follows the deflection'
        >>> FormOfLaw(0.1, 0.02, 0.9, 0.8).kind
        'dissipative: it follows the velocity'
        """
        if self.by_deflection > DOMINANT:
            return "elastic: it follows the deflection"
        if self.by_velocity > DOMINANT:
            return "dissipative: it follows the velocity"
        return "one with memory, or elastic and dissipative at once"


def form_of_law(free: Hypothesis, named: Hypothesis, place: int, lines: Sequence[WindowedSpectrum]) -> FormOfLaw:
    """Compare a law of free form with the law from which it started.

    Both hypotheses have the same joints in the same order; ``place`` is the index of the joint among the laws.
    """
    parts = [_forces(free, named, place, recording) for recording in lines]
    x, v, force, law = (np.concatenate([part[k] for part in parts]) for k in range(4))
    linear = np.stack([x, v], axis=1)
    free_rest = _without(force, linear)
    size = float(free_rest @ free_rest)
    if size <= 0.0:
        return FormOfLaw(0.0, 0.0, 0.0, 0.0)
    sizes = [
        (np.std(part[0]), *(np.std(_without(part[k], np.stack(part[:2], axis=1))) for k in (2, 3))) for part in parts
    ]
    deflections, free_sizes, law_sizes = np.array(sizes).T
    law_rest = _without(law, linear)
    missing = _without(free_rest, law_rest[:, None]) if float(law_rest @ law_rest) > 0 else free_rest
    return FormOfLaw(
        float(np.sqrt(missing @ missing / size)),
        _power_of_means(x, free_rest) / size,
        _power_of_means(v, free_rest) / size,
        float(force @ v / np.sqrt((force @ force) * (v @ v))),
        _exponent(deflections, free_sizes),
        _exponent(deflections, law_sizes),
    )


def _exponent(deflections: Real, forces: Real) -> float:
    """Return the slope of ln force over ln deflection, (n_recordings,) each; NaN if the deflections are alike."""
    x, y = np.log(deflections), np.log(np.maximum(forces, 1e-300))
    return float(np.polyfit(x, y, 1)[0]) if np.ptp(x) > np.log(LEVELS_APART) else float("nan")


def _forces(free: Hypothesis, named: Hypothesis, place: int, lines: WindowedSpectrum) -> tuple[Real, Real, Real, Real]:
    """Return deflection (m), velocity (m/s), and forces (N) of the free form and of the named law, each (n_samples,).

    Both forces are computed for the motion that the hypothesis of free form predicts.
    """
    answer = predict_lines(free, lines).joints[place]
    often = len(answer.deflection) // lines.padded
    n = often * len(lines.recording.force)
    x, v = answer.deflection[:n], answer.velocity[:n]
    laws = (hypothesis.laws[place].law(lines.recording) for hypothesis in (free, named))
    force, law = (driven_force(lines, x, v, law, often=often) for law in laws)
    return x[::often], v[::often], force[::often], law[::often]


def _without(signal: Real, others: Real) -> Real:
    """Return a signal (n,) minus its least squares fit by k other signals (n, k)."""
    sizes = np.sqrt(np.sum(others**2, axis=0))
    units = others / np.where(sizes > 0, sizes, 1.0)
    return np.asarray(signal - units @ np.linalg.lstsq(units, signal, rcond=None)[0])


def _power_of_means(values: Real, force: Real) -> float:
    """Return the power of a force that a function of other values explains.

    The function is the mean force in each of ``BINS`` equally wide bins of ``values``.
    """
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    place = np.digitize(values, edges[1:-1])
    count = np.maximum(np.bincount(place, minlength=BINS), 1)
    means = np.bincount(place, force, BINS) / count
    return float(np.sum(count * means**2))
