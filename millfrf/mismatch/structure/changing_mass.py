r"""Whether a mass that changes explains more than a stiffness that changes.

Near its resonance, a mode moves alike with a stiffness and with a mass along the axis b of a joint. With the measured
deflection z of the joint, both are linear in their strength,

.. math:: g(t) = \sum_{i=0}^{2} k_i\,P_i(t)\,z(t), \qquad g(t) = \sum_{i=0}^{2} m_i\,P_i(t)\,\ddot z(t),

with the Legendre polynomials P of the time from the beginning of a recording to its end, so that their gains in misfit
compare directly. Away from the resonance they differ: a stiffness changes the response below it, a mass the one above.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..joints.joint_axis import JointAxis
from ..models.cause import Cause
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..physics.joint_laws import POSE_DRIFT
from ..screening.joint_places import estimated_motion
from ..screening.score_tests import response_to_joint_force
from ..screening.whitened_residual import Floor, FloorRecord, Gain, noise_floor

SEARCH = 25  # most evaluations for each angle of an axis

FIRST_TURN = 10.0  # first change of the angles in the search, in steps of an axis

ORDERS = 3  # polynomials of the course: constant, linear and quadratic, as `PoseDrift` has them


@dataclass(frozen=True)
class ChangingMass:
    """A mass in place of a stiffness that changes during a recording."""

    gain: float  # gain in misfit beyond that of the stiffness; negative if the stiffness explains more
    # change of the mass from the beginning of a recording to its end along the axis of the joint, in the rig's unit of
    # force over acceleration (kg at a tool); only its sign is stated, as a joint away from the tip has no scale
    change: float
    needed: float  # difference of gains that decides between both

    @property
    def explains_more(self) -> bool:
        """Whether the mass explains more beyond doubt, so that the stiffness is not the cause."""
        return self.gain > self.needed

    @property
    def sentence(self) -> str:
        """Warning for the reader of a diagnosis; empty if the stiffness explains more beyond doubt."""
        if self.gain < -self.needed:
            return ""
        if self.explains_more:
            return (
                f"a moving mass that {self._course} during a recording explains more than pose_drift (misfit "
                f"{self.gain:.0f} lower): what changes is no stiffness; weigh what moves before and after"
            )
        return (
            f"pose_drift: a moving mass that {self._course} during a recording is as likely (misfit "
            f"{abs(self.gain):.0f} {'lower' if self.gain > 0 else 'higher'}); weigh what moves before and after"
        )

    @property
    def _course(self) -> str:
        return "grows" if self.change > 0 else "falls"


def changing_masses(fitted: Fit, lines: Sequence[WindowedSpectrum], needed: float) -> tuple[ChangingMass, ...]:
    """Return the mass that would take the place of each stiffness that changes during the recordings.

    Parameters
    ----------
    fitted, lines
        Fit with its causes, and the windowed spectra.
    needed
        Difference of the gains in misfit that decides.
    """
    hypothesis = fitted.hypothesis
    return tuple(
        _changing_mass(replace(fitted, hypothesis=hypothesis.without(place)), cause, list(lines), needed)
        for place, cause in enumerate(hypothesis.causes)
        if cause.physics.name == POSE_DRIFT.name
    )


def _changing_mass(without: Fit, drift: Cause, lines: list[WindowedSpectrum], needed: float) -> ChangingMass:
    assert drift.axis is not None
    floor = noise_floor(without, lines)
    stiffness, mass = (_largest_gain(floor, without.hypothesis, drift.axis, order) for order in (0, 2))
    return ChangingMass(mass.gain - stiffness.gain, 2 * float(mass.factors[1]), needed)


def _largest_gain(floor: Floor, hypothesis: Hypothesis, axis: JointAxis, order: int) -> Gain:
    """Return the gain of a changing factor on a derivative of the deflection, at its best axis near ``axis``.

    Where several modes move, a mass along one axis moves them as a stiffness along another one does.
    """

    def gain_at(angles: Real) -> Gain:
        turned = axis.rotated(angles)
        return floor.gain_of([_columns(record, hypothesis, turned, order) for record in floor.records])

    start = np.zeros(len(axis.entries) - 1)
    if not len(start):
        return gain_at(start)
    options = {"maxfev": SEARCH * len(start), "initial_simplex": FIRST_TURN * np.eye(len(start) + 1, len(start))}
    best = scipy.optimize.minimize(lambda angles: -gain_at(angles).gain, start, method="Nelder-Mead", options=options)
    return gain_at(best.x)


def _columns(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis, order: int) -> Real:
    """Return the whitened responses to the forces of each course, (2 * n_lines * n_responses, ORDERS)."""
    deflection = estimated_motion(record, hypothesis, axis).deflection
    signal = _acceleration(deflection, record) if order else deflection
    forces = [course * signal for course in _courses(record, len(signal))]
    return np.stack([response_to_joint_force(record, hypothesis, axis, force) for force in forces], axis=1)


def _acceleration(deflection: Real, record: FloorRecord) -> Real:
    """Return the second derivative of the deflection, m/s^2; the deflection has no power outside the band."""
    padded = record.lines.padded
    rates = 2j * np.pi * scipy.fft.rfftfreq(padded, 1 / record.lines.recording.rate)
    spectrum = rates**2 * scipy.fft.rfft(deflection, n=padded)
    return np.asarray(scipy.fft.irfft(spectrum, n=padded)[: len(deflection)])


def _courses(record: FloorRecord, count: int) -> Real:
    """Return the Legendre polynomials of the time over a whole recording, (ORDERS, count)."""
    recording = record.lines.recording
    time = 2 * np.arange(count) / (recording.rate * recording.duration) - 1
    return np.asarray(np.polynomial.legendre.legvander(time, ORDERS - 1).T, dtype=float)
