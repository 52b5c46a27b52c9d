"""Joint laws of recordings that are short for the damping of the modes, started by simulation from the nominal modes.

In a short recording, modes and free decays imitate a law: a refit of the modes leaves little of it, and the motion
that is estimated from this rest does not show whether a joint sticks. Simulations of so few samples are cheap. Each law
is therefore simulated in each of its shapes and in several strengths, and fitted from the likeliest of them.
"""

from collections.abc import Sequence
from dataclasses import replace
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
        partial(_simulated, lines, nominal.hypothesis, starts) for starts in _starts(floor, nominal, axis, possible)
    ]
    simulated = [start for start in in_processes(tasks) if np.isfinite(start.score)]
    fits = in_processes([partial(_fitted, lines, start) for start in _likeliest(simulated, settings.screening)])
    proposals = [_proposal(fitted, current) for fitted in fits if np.isfinite(fitted.score)]
    screened = [_proposal(start, current) for start in simulated]
    return proposals, [Candidate(each.name, each.evidence, SCREENED, each.location) for each in screened]


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


def _simulated(lines: list[WindowedSpectrum], nominal: Hypothesis, starts: Sequence[Cause]) -> Fit:
    """Return the likeliest strength of one shape, as simulated."""
    likeliest = min(starts, key=lambda cause: misfit_without_fit(lines, nominal.with_cause(cause)))
    return fit(lines, nominal.with_cause(likeliest), iterations=0)


def _likeliest(simulated: list[Fit], limits: ScreeningSettings) -> list[Fit]:
    """Return the likeliest shapes of the law with the likeliest simulation, and the best shape of its rival."""
    ranked = sorted(simulated, key=lambda start: start.score)
    names = [reported_name(start.hypothesis.causes[-1].physics) for start in ranked]
    own = [start for start, name in zip(ranked, names, strict=True) if name == names[0]]
    rivals = [start for start, name in zip(ranked, names, strict=True) if name != names[0]]
    return own[: limits.most_laws - 1] + rivals[:1]


def _fitted(lines: list[WindowedSpectrum], start: Fit) -> Fit:
    """Fit a law, and again with tables and limits for the motion that it then has."""
    first = fit(lines, start.hypothesis, start.noises, iterations=FITTING.restart_iterations)
    if not np.isfinite(first.score):
        return first
    hypothesis = with_motion(first.hypothesis, lines)
    again = fit(lines, hypothesis, first.noises, iterations=FITTING.restart_iterations)
    return min(first, again, key=lambda fitted: fitted.score)


def _proposal(fitted: Fit, current: Fit) -> Proposal[Fit]:
    cause = fitted.hypothesis.causes[-1]
    assert cause.axis is not None
    location = location_of(cause.axis, fitted.hypothesis.model)
    return Proposal(reported_name(cause.physics), location, fitted, current.score - fitted.score)
