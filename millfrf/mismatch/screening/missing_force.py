"""The force of one joint that the nominal model lacks, without an assumed law, and what this force follows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..inference.settings import ScreeningSettings
from ..joints.joint_law import JointLaw, JointMotion
from ..models.cause import Cause, location_of
from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.misfit import through_structure
from ..physics.protocol import JointPhysics, Parameter, reported_name
from ..physics.wider_forms import SHAPES, FreeForm
from ..records.noise_model import whitening
from .force_regression import NUISANCES, LinearProblem, evidence_of_force
from .joint_places import (
    EstimatedMotion,
    estimated_motion,
    force_variance,
    motion_of,
    response_to_force,
    static_stiffness,
)
from .law_free_refit import LawFreeFit, law_free_refit
from .score_tests import Screened
from .whitened_residual import FloorRecord

MOST_LAWS = 5  # laws that the file of a diagnosis lists

KNOWN = 0.9  # least share of the force that functions of the motion must explain for its law to be called known

FOLLOWED = {"x": "deflection", "v": "velocity", "m": "memory", "t": "time"}

FREE = range(NUISANCES, NUISANCES + sum(SHAPES[kind] for kind in FOLLOWED))  # places of the free forms among forces


@dataclass(frozen=True)
class MissingForce:
    """Force of one joint beyond the linear structure, from the recordings alone.

    Parameters
    ----------
    refit
        Modes and place of the joint, refitted for a force of any law.
    recordings
        Names of the recordings.
    motions
        Deflection, velocity and most likely force of the joint in each recording, less that of a spring and a damper.
    errors : (n_recordings,), N
        Root mean square error of the force in each recording by noise, with that of the modes left out.
    evidence
        Twice the gain in log likelihood of a force of free spectrum over refitted modes alone, less that of noise.
    needed
        Evidence above which a force is missing.
    explained
        Share of the residual beyond noise that the force of one joint explains.
    followed
        Share of the force beyond a spring and a damper that functions of the ``deflection``, ``velocity``, ``memory``
        and ``time`` each explain, and that of ``all`` together.
    screened
        Laws of the library by their gain, most promising first, each with its shapes.
    """

    refit: LawFreeFit
    recordings: tuple[str, ...]
    motions: tuple[EstimatedMotion, ...]
    errors: Real
    evidence: float
    needed: float
    explained: float
    followed: dict[str, float]
    screened: tuple[Screened, ...]

    @property
    def significant(self) -> bool:
        """Whether refitted modes alone leave a force of this joint."""
        return self.evidence > self.needed

    @property
    def law_known(self) -> bool:
        """Whether functions of the motion explain most of the force."""
        return self.followed["all"] > KNOWN

    def content(self) -> dict[str, Any]:
        """Return the entry for the file of a diagnosis."""
        direction, errors, off_tip = self.refit.direction()
        location = location_of(self.refit.axis, self.refit.hypothesis.model)
        deviations = np.sqrt(np.maximum(np.diag(self.refit.covariance), 0.0))
        return {
            "significant": self.significant,
            "evidence": round(self.evidence, 1),
            "direction": [round(float(value), 4) for value in direction],
            "direction_error": [round(float(value), 4) for value in errors],
            "off_tip": round(off_tip, 4),
            **location,
            "participation_error": [round(float(value), 4) for value in deviations],
            "force_rms": [float(f"{np.std(motion.force):.4g}") for motion in self.motions],
            "force_error": [float(f"{error:.4g}") for error in self.errors],
            "explained": round(self.explained, 4),
            "rest_over_noise": round(self.refit.rest, 3),
            "follows": {name: round(share, 4) for name, share in self.followed.items()},
            "law_known": self.law_known,
            "laws": [
                {"law": reported_name(law.causes[0].physics), "gain": round(law.gain, 1)}
                for law in self.screened[:MOST_LAWS]
            ],
        }


def missing_force(
    lines: list[WindowedSpectrum], start: Fit, laws: Sequence[JointPhysics], settings: ScreeningSettings
) -> MissingForce | None:
    """Estimate the force of one joint whatever its law, then compare it with laws; None if one response is measured.

    The place is that of `law_free_refit`. There the recordings are a linear problem: the modes within their prior, a
    spring, a damper, and the force of each law for the estimated motion. A law gains ``s^T S^-1 s`` with its shapes'
    gradient s and normal matrix S after all others are eliminated, where no shape may have the wrong sign.
    """
    refit = law_free_refit(lines, start)
    if refit is None:
        return None
    records, motions = _motions(refit, lines)
    recordings = [each.recording for each in lines]
    motion = motion_of(motions, static_stiffness(refit.hypothesis, refit.axis), recordings)
    seen = {
        each.lines.recording.name: (motion.deflection, motion.velocity)
        for each, motion in zip(records, motions, strict=True)
    }
    causes = [Cause(law, shape, "", refit.axis, motion, seen) for law in laws for shape in law.starts(motion)]
    without_name = [*_linear_forces(motion), *_free_forces(motion)]
    forces = [[*without_name, *(cause.law(recording) for cause in causes)] for recording in recordings]
    problem = LinearProblem.of(refit, lines, motions, forces)
    followed = _followed(problem)
    nuisances = problem.others(FREE if followed["all"] > KNOWN else ())
    better = replace(refit, hypothesis=replace(refit.hypothesis, u=refit.hypothesis.u + nuisances[:-NUISANCES]))
    records, motions = _motions(better, lines)
    return MissingForce(
        better,
        tuple(seen),
        _beyond_linear(lines, motions),
        np.array([_force_error(record, better) for record in records]),
        evidence_of_force(refit, start.hypothesis, lines),
        settings.direction * len(lines),
        problem.explained,
        followed,
        tuple(sorted(_screened(problem, causes), key=lambda candidate: -candidate.gain)),
    )


def _motions(refit: LawFreeFit, lines: list[WindowedSpectrum]) -> tuple[list[FloorRecord], list[EstimatedMotion]]:
    """Return the residual of each recording at the refitted modes, and the motion and force of the joint in it."""
    records = []
    for number, recording in enumerate(lines):
        through = through_structure(refit.hypothesis, recording)
        predicted = predict_lines(refit.hypothesis, recording)
        residual = recording.measured - predicted.response
        covariance = refit.noises[number].covariance(recording.frequencies, through) * max(1.0, refit.rest)
        white = whitening(covariance)
        records.append(FloorRecord(recording, predicted, residual, through, white, np.zeros((0, 0)), np.zeros(0)))
    return records, [estimated_motion(record, refit.hypothesis, refit.axis) for record in records]


def _linear_forces(motion: JointMotion) -> list[JointLaw]:
    """Return spring and damper with the force 1 at the typical deflection and velocity."""
    return [
        JointLaw(motion.reach, motion.deflections / motion.deflection, motion.speed),
        JointLaw(motion.reach, speed=motion.speed, damping=motion.velocities / motion.velocity),
    ]


def _beyond_linear(
    lines: Sequence[WindowedSpectrum], motions: Sequence[EstimatedMotion]
) -> tuple[EstimatedMotion, ...]:
    """Return the motions with the force less that of the one spring and damper that fit it best in all recordings.

    A spring and a damper cannot be distinguished from errors of the modes.
    """
    compared = [
        np.column_stack([motion.force, motion.deflection, motion.velocity])[each.start : each.start + len(each.window)]
        for each, motion in zip(lines, motions, strict=True)
    ]
    force, *linear = np.concatenate(compared).T
    sizes = np.array([signal.std() for signal in linear])
    stiffness, damping = np.linalg.lstsq(np.column_stack(linear) / sizes, force, rcond=None)[0] / sizes
    return tuple(
        replace(motion, force=motion.force - stiffness * motion.deflection - damping * motion.velocity)
        for motion in motions
    )


def _followed(problem: LinearProblem) -> dict[str, float]:
    """Return the shares of the force that functions of each family explain, and all together."""
    total = problem.available if problem.available > 0 else np.inf
    first, shares = FREE.start, {}
    for kind, name in FOLLOWED.items():
        shares[name] = problem.gain(range(first, first + SHAPES[kind])) / total
        first += SHAPES[kind]
    shares["all"] = problem.gain(FREE) / total
    return {name: float(np.clip(share, 0.0, 1.0)) for name, share in shares.items()}


class _Nothing:
    """A joint law without a force, to which free shapes are added."""

    name = reported_as = "none"
    equation = source = ""
    parameters: tuple[Parameter, ...] = ()
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return ()

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        return JointLaw(reach=motion.reach, speed=motion.speed)


def _free_forces(motion: JointMotion) -> list[JointLaw]:
    """Return forces over deflection, velocity, memory and time, of which every law is nearly a sum."""
    form, none = FreeForm(_Nothing(), "".join(FOLLOWED)), np.zeros(sum(SHAPES.values()))
    yields = form.law(none, motion).yields
    return [replace(change, yields=yields) for change in form.law_changes(none, motion)]


def _force_error(record: FloorRecord, refit: LawFreeFit) -> float:
    """Return the root mean square error of the force in the compared band, N."""
    reach = record.white @ (response_to_force(record, refit.hypothesis, refit.axis) @ refit.axis.entries)[:, :, None]
    size, force = np.sum(np.abs(reach[:, :, 0]) ** 2, axis=1), force_variance(record, refit.hypothesis, refit.axis)
    rate, n = record.lines.recording.rate, len(record.lines.window)
    step = rate / n
    # a spectrum of variance v on each line of the band has the mean square 2 v df / rate
    share = 2 * step / rate
    return float(np.sqrt(share * np.sum(force / (1 + force * size))))


def _screened(problem: LinearProblem, causes: Sequence[Cause]) -> Iterator[Screened]:
    """Yield the gain of each law, and its shapes with their best amplitudes, without those of the wrong sign."""
    for physics, own in groupby(enumerate(causes, FREE.stop), key=lambda numbered: numbered[1].physics):
        columns, signed = dict(own), physics.parameters[0].low >= 0
        single = {column: problem.gain([column], signed=signed) for column in columns}
        order = sorted((column for column in columns if single[column] > 0), key=lambda column: -single[column])
        shapes = [replace(columns[k], values=np.array([problem.factor(k), *columns[k].values[1:]])) for k in order]
        if shapes:
            yield Screened(tuple(shapes), problem.gain(list(columns), signed=signed))
