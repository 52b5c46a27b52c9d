"""Joint laws of recordings that are short for the damping of the modes, started by simulation from the nominal modes.

In a short recording, modes and free decays imitate a law: a refit of the modes leaves little of it, and the motion
that is estimated from this rest does not show whether a joint sticks. Simulations of so few samples are cheap. Each law
is therefore simulated in each of its shapes and in several strengths, and fitted from the likeliest of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..inference.diagnosis import SCREENED, Candidate
from ..inference.search import Proposal, in_processes
from ..inference.settings import ScreeningSettings, Settings
from ..joints.joint_axis import JointAxis
from ..joints.joint_law import driven_force
from ..models.cause import Cause, location_of
from ..models.fitting import Fit, at_nominal_modes, fit, misfit_without_fit
from ..models.hypothesis import Hypothesis
from ..models.settings import FITTING
from ..physics.protocol import JointPhysics, reported_name
from .joint_laws_fitted import laws_not_along, with_motion
from .joint_places import estimated_motion, joint_places, motion_of, static_stiffness
from .whitened_residual import Floor, linear_floor

# strengths of a law at which it is simulated, as root mean squares of its force over that of the missing force
STRENGTHS = (0.25, 0.5, 1.0, 2.0)

FIRST_STEPS = 8  # steps after which only the best fit of each name goes on


def laws_of_short_recordings(
    lines: list[WindowedSpectrum], current: Fit, laws: Sequence[JointPhysics], settings: Settings
) -> tuple[list[Proposal[Fit]], list[Candidate]]:
    """Fit the joint laws that are likeliest when they are simulated, and return all laws as simulated.

    Both lists are empty if no recording is short.
    """
    shape = current.hypothesis.shape
    if not any(recording.rings(shape.nominal.poles[: shape.nominal_modes]).any() for recording in lines):
        return [], []
    nominal = fit(lines, at_nominal_modes(current.hypothesis), iterations=0)
    if not np.isfinite(nominal.score):
        return [], []
    floor = linear_floor(nominal, lines)
    axis = joint_places(floor, nominal.hypothesis, settings.screening.place)[0].axis
    possible = laws_not_along(current.hypothesis, axis, laws)
    tasks = [
        partial(_likeliest_strength, lines, nominal.hypothesis, starts)
        for starts in _starts(floor, nominal, axis, possible)
    ]
    simulated = [start for start in in_processes(tasks) if np.isfinite(start.misfit)]
    number_cost = float(np.log(2 * sum(recording.measured.size for recording in lines)))
    likeliest = _likeliest(simulated, number_cost, settings.screening)
    begun = in_processes([partial(_begun, lines, nominal, cause) for cause in likeliest])
    fits = in_processes([partial(_finished, lines, fitted) for fitted in _best_of_each_name(begun)])
    return (
        [_proposal(fitted, current) for fitted in fits],
        [start.candidate(current, nominal, number_cost) for start in simulated],
    )


@dataclass(frozen=True)
class SimulatedLaw:
    """A law along an axis, with the misfit of its simulation from the nominal modes."""

    cause: Cause
    misfit: float

    def score(self, number_cost: float) -> float:
        """Return the misfit and the cost of the law's numbers."""
        return self.misfit + self.cause.size * number_cost

    def candidate(self, current: Fit, nominal: Fit, number_cost: float) -> Candidate:
        """Return the law as screened; ``number_cost``: what each number adds to a score."""
        assert self.cause.axis is not None
        location = location_of(self.cause.axis, nominal.hypothesis.model)
        score = nominal.score - nominal.misfit + self.score(number_cost)
        return Candidate(reported_name(self.cause.physics), current.score - score, SCREENED, location)


def _starts(floor: Floor, nominal: Fit, axis: JointAxis, laws: Sequence[JointPhysics]) -> list[list[Cause]]:
    """Return every shape of every law along an axis, each in several strengths."""
    hypothesis = nominal.hypothesis
    motions = [estimated_motion(record, hypothesis, axis) for record in floor.records]
    recordings = (record.lines.recording for record in floor.records)
    motion = motion_of(motions, static_stiffness(hypothesis, axis), recordings)
    missing = np.sqrt(np.mean([np.mean(state.force**2) for state in motions]))
    shapes = []
    for law in laws:
        for start in law.starts(motion):
            cause, first = Cause(law, start, "", axis, motion), law.parameters[0]
            forces = [
                driven_force(record.lines, state.deflection, state.velocity, cause.law(record.lines.recording))
                for record, state in zip(floor.records, motions, strict=True)
            ]
            size = np.sqrt(np.mean([np.mean(force**2) for force in forces]))
            values = [float(start[0] * share * missing / size) for share in STRENGTHS] if size > 0 else []
            shapes.append(
                [
                    replace(cause, values=np.array([value, *start[1:]]))
                    for value in values
                    if first.low < value < first.high
                ]
            )
    return [causes for causes in shapes if causes]


def _likeliest_strength(lines: list[WindowedSpectrum], nominal: Hypothesis, starts: Sequence[Cause]) -> SimulatedLaw:
    """Return the likeliest strength of one shape, as simulated."""
    misfits: dict[int, float] = {}

    def misfit(k: int) -> float:
        if k not in misfits:
            misfits[k] = misfit_without_fit(lines, nominal.with_cause(starts[k]))
        return misfits[k]

    # from the middle outwards as long as the misfit falls
    best = middle = len(starts) // 2
    for step in (-1, 1):
        while 0 <= best + step < len(starts) and misfit(best + step) < misfit(best):
            best += step
        if best != middle:
            break
    return SimulatedLaw(starts[best], misfit(best))


def _likeliest(simulated: list[SimulatedLaw], number_cost: float, limits: ScreeningSettings) -> list[Cause]:
    """Return the likeliest shapes of the law with the likeliest simulation, and the best shape of its rival."""
    ranked = sorted(simulated, key=lambda start: start.score(number_cost))
    names = [reported_name(start.cause.physics) for start in ranked]
    own = [start.cause for start, name in zip(ranked, names, strict=True) if name == names[0]]
    rivals = [start.cause for start, name in zip(ranked, names, strict=True) if name != names[0]]
    return own[: limits.most_laws - 1] + rivals[:1]


def _begun(lines: list[WindowedSpectrum], nominal: Fit, cause: Cause) -> Fit:
    return fit(lines, nominal.hypothesis.with_cause(cause), nominal.noises, iterations=FIRST_STEPS)


def _best_of_each_name(fits: Sequence[Fit]) -> list[Fit]:
    """Return the fit with the best score of each name, of those whose simulation does not diverge."""
    best: dict[str, Fit] = {}
    for fitted in sorted(fits, key=lambda fitted: fitted.score):
        if np.isfinite(fitted.score):
            best.setdefault(reported_name(fitted.hypothesis.causes[-1].physics), fitted)
    return list(best.values())


def _finished(lines: list[WindowedSpectrum], begun: Fit) -> Fit:
    """Fit a law again, with tables and limits for the motion that it then has."""
    hypothesis = with_motion(begun.hypothesis, lines)
    again = fit(lines, hypothesis, begun.noises, iterations=FITTING.restart_iterations)
    return min(begun, again, key=lambda fitted: fitted.score)


def _proposal(fitted: Fit, current: Fit) -> Proposal[Fit]:
    cause = fitted.hypothesis.causes[-1]
    assert cause.axis is not None
    location = location_of(cause.axis, fitted.hypothesis.model)
    return Proposal(reported_name(cause.physics), location, fitted, current.score - fitted.score)
