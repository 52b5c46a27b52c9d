"""Score tests that rank linear causes and joint laws without fitting them."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Real

from ..joints.joint_axis import JointAxis
from ..joints.joint_law import driven_force
from ..models.cause import Cause
from ..models.hypothesis import Hypothesis, line_response
from ..models.modal_lines import receptance_at
from ..physics.protocol import ChainPhysics, JointPhysics
from .joint_places import EstimatedMotion, estimated_motion, motion_of, static_stiffness
from .whitened_residual import Floor, FloorRecord


@dataclass(frozen=True)
class ScreenedChain:
    """A linear cause at a place, with its best numbers to first order and its gain in misfit."""

    cause: Cause
    gain: float


def screen_chains(floor: Floor, hypothesis: Hypothesis, causes: list[ChainPhysics]) -> list[ScreenedChain]:
    """Rank linear causes at all their places, best first.

    The gain is ``g^T S^-1 g`` with the gradient g by the numbers of the cause, and their normal matrix S if the modal
    parameters adapt within the prior (Rao's score test).
    """
    candidates = []
    for physics in causes:
        for place in physics.places(hypothesis.shape.nominal):
            start = Cause(physics, physics.start(hypothesis.shape.nominal), place)
            gain, step = _gain(floor, hypothesis, start)
            candidates.append(ScreenedChain(start.moved(start.coordinates() + np.clip(step, -60, 60)), gain))
    return sorted(candidates, key=lambda candidate: -candidate.gain)


def gain_of_chain(floor: Floor, hypothesis: Hypothesis, absent: Cause) -> float:
    """Return the gain in misfit of one linear cause at its place."""
    return _gain(floor, hypothesis, absent)[0]


def _gain(floor: Floor, hypothesis: Hypothesis, cause: Cause) -> tuple[float, Real]:
    extended = hypothesis.with_cause(cause)
    coordinates = extended.coordinates()
    own = np.zeros((cause.size, cause.size))
    shared = np.zeros((len(floor.gradient), cause.size))
    gradient = np.zeros(cause.size)
    for record in floor.records:
        base = line_response(extended, record.lines)
        columns = []
        for k in range(len(coordinates) - cause.size, len(coordinates)):
            perturbed = coordinates.copy()
            perturbed[k] += 0.1
            changed = line_response(extended.with_causes(perturbed), record.lines)
            columns.append(record.column((changed - base) / 0.1))
        slope = np.array(columns).T
        own += 2 * slope.T @ slope
        shared += 2 * record.slope.T @ slope
        gradient += 2 * slope.T @ record.white_residual
    solved = floor.inverse @ shared
    reduced = own - shared.T @ solved
    reduced_gradient = gradient - solved.T @ floor.gradient
    step = np.asarray(np.linalg.lstsq(reduced, reduced_gradient, rcond=1e-10)[0], dtype=float)
    return float(reduced_gradient @ step), step


@dataclass(frozen=True)
class Screened:
    """The shapes of one joint law along an axis, most promising first."""

    causes: tuple[Cause, ...]  # the law in each shape, with its best amplitude, driven by the estimated motion
    gain: float  # gain in misfit of the first shape with its best amplitude and adapted modal parameters


def screen_joints(floor: Floor, hypothesis: Hypothesis, axis: JointAxis, laws: list[JointPhysics]) -> list[Screened]:
    """Rank laws along an axis, best first; laws with the wrong sign are left out.

    Parameters
    ----------
    floor
        Residual of the fit so far.
    hypothesis
        Hypothesis of the fit so far.
    axis
        Axis of the joint.
    laws
        Laws that are tried.
    """
    motions = [estimated_motion(record, hypothesis, axis) for record in floor.records]
    recordings = (record.lines.recording for record in floor.records)
    motion = motion_of(motions, static_stiffness(hypothesis, axis), recordings)
    by_name = {
        record.lines.recording.name: (state.deflection, state.velocity)
        for record, state in zip(floor.records, motions, strict=True)
    }
    candidates = []
    for law in laws:
        causes = [Cause(law, start, "", axis, motion, by_name) for start in law.starts(motion)]
        parts = [
            [_column(record, hypothesis, state, cause) for record, state in zip(floor.records, motions, strict=True)]
            for cause in causes
        ]
        results = [floor.gain_of(part) for part in parts]
        gains, factors = np.array([[result.gain, float(result.factors[0])] for result in results]).T
        low, high = law.parameters[0].low, law.parameters[0].high
        admissible = (factors > low) & (factors < high) & (factors != 0)
        order = [int(k) for k in np.argsort(-gains) if admissible[k]]
        if order:
            shapes = [replace(causes[k], values=np.array([factors[k], *causes[k].values[1:]])) for k in order]
            candidates.append(Screened(tuple(shapes), float(gains[order[0]])))
    return sorted(candidates, key=lambda candidate: -candidate.gain)


def _column(record: FloorRecord, hypothesis: Hypothesis, motion: EstimatedMotion, cause: Cause) -> Real:
    """Return the whitened response to the force of a law for the estimated motion, in a single column."""
    assert cause.axis is not None
    law = cause.law(record.lines.recording)
    force = driven_force(record.lines, motion.deflection, motion.velocity, law)
    return response_to_joint_force(record, hypothesis, cause.axis, force)[:, None]


def response_to_joint_force(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis, force: Real) -> Real:
    """Return the whitened response to a force (n_samples,), N, of a joint, real parts above imaginary parts."""
    lines = record.lines
    spectrum = scipy.fft.rfft(force, n=lines.padded)
    reach, n = hypothesis.reach_with(axis), len(hypothesis.model.responses)
    receptance = receptance_at(reach.model, lines.padded_frequencies)[:, :n] @ reach.paths[-1].push
    response = -receptance * spectrum[:, None] * lines.padded_kinematic
    return record.column(lines.cut(lines.signal(response)))
