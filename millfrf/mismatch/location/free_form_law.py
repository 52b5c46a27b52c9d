"""The measured restoring force of a joint without an assumed law: means in bins of deflection and of velocity."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..joints.joint_axis import JointAxis
from ..joints.joint_law import JointLaw
from ..joints.joint_simulation import driven_force
from ..models.fitting import Fit
from ..models.hypothesis import Cause, Hypothesis, predict_lines
from ..models.misfit import fitted_noise, through_structure
from ..noise.noise_model import whitening
from ..physics.free_form import FreeForm
from ..physics.library import rig_of
from ..physics.protocol import answer_name
from ..screening.joint_places import SeenMotion, seen_motion
from ..screening.whitened_residual import FloorRecord
from .residual_view import StructureDetails, StructureDiagnosis

BINS = 21
LEAST_SAMPLES = 80
BLOCK = 1.0
"""Length of a piece of the record that counts as one independent sample of the scatter, s."""


@dataclass(frozen=True)
class BinnedForce:
    """Mean force of a joint in bins of its deflection or velocity.

    Parameters
    ----------
    at : (n,)
        Mean deflection (m) or velocity (m/s) of each bin.
    force, error : (n,), N
        Mean measured force and its standard error, from the scatter between pieces of the records.
    law : (n,), N
        Force of the accepted law under the same motion, filtered and averaged alike.
    textbook : (n,), N, or None
        The same of the library's law, where the accepted one has a free form, with the linear spring and damper that
        bring it nearest: they cannot be told from the structure's own.
    """

    at: Real
    force: Real
    error: Real
    law: Real
    textbook: Real | None = None


@dataclass(frozen=True)
class FreeFormLaw:
    """Measured force of one accepted joint.

    Parameters
    ----------
    name
        Name under which the accepted cause is reported.
    axis
        Where the joint gives way.
    forward, backward
        Force against deflection while it rises and while it falls; the two differ where the joint has friction or
        memory.
    damping
        Force against velocity, without the part that depends on deflection.
    explained
        Share of the measured force's power that the law gives.
    force_unit, deflection_unit
        Units of force and deflection on the rig.
    """

    name: str
    axis: JointAxis
    forward: BinnedForce
    backward: BinnedForce
    damping: BinnedForce
    explained: float
    force_unit: str = "N"
    deflection_unit: str = "m"


@dataclass(frozen=True)
class _Sample:
    """Samples of all recordings in one band: deflection, velocity, force, laws' forces and number of the piece."""

    x: Real
    v: Real
    force: Real
    law: Real
    textbook: Real
    piece: NDArray[np.int64]


def free_form_laws(diagnosis: StructureDiagnosis) -> tuple[FreeFormLaw, ...]:
    """Return the measured force of each accepted joint cause, with all other causes in the model."""
    return tuple(
        _measured(diagnosis, cause) for cause in diagnosis.details.final.hypothesis.causes if cause.axis is not None
    )


def _measured(diagnosis: StructureDiagnosis, cause: Cause) -> FreeFormLaw:
    details, final = diagnosis.details, diagnosis.details.final.hypothesis
    assert cause.axis is not None
    bare = replace(final, causes=tuple(one for one in final.causes if one is not cause))
    joint = cause.axis, (cause.law(), _library_law(details, cause).law())
    samples = _joined([_seen(details.final, bare, joint, k, one) for k, one in enumerate(details.recordings)])
    forward, backward, damping = _bins(replace(samples, textbook=_nearest(samples)), details.textbook is not None)
    share = 1 - float(np.mean((samples.force - samples.law) ** 2) / np.mean(samples.force**2))
    free = "free form of " if isinstance(cause.physics, FreeForm) else ""
    name, rig = free + answer_name(cause.physics), rig_of(final.model)
    return FreeFormLaw(name, cause.axis, forward, backward, damping, share, rig.force_unit, rig.deflection_unit)


def _library_law(details: StructureDetails, cause: Cause) -> Cause:
    """The law of the library from which a law's form was freed; the law itself where it was not."""
    if details.textbook is None:
        return cause
    place = next(k for k, one in enumerate(details.final.hypothesis.laws) if one is cause)
    return details.textbook.laws[place]


def _bins(samples: _Sample, freed: bool) -> list[BinnedForce]:
    """Forces over a rising and a falling deflection, and what is left of them over the velocity."""
    up, ends = samples.v > 0, _edges(samples.x)
    force, law, textbook = (
        one - _mean_at(samples.x, one, ends) for one in (samples.force, samples.law, samples.textbook)
    )
    rest = replace(samples, force=force, law=law, textbook=textbook)
    found = [
        _binned(samples, samples.x, ends, up),
        _binned(samples, samples.x, ends, ~up),
        _binned(rest, samples.v, _edges(samples.v), np.ones(len(up), dtype=bool)),
    ]
    return found if freed else [replace(one, textbook=None) for one in found]


def _nearest(samples: _Sample) -> Real:
    """The library's law with the spring and damper that bring it nearest to the accepted one."""
    linear = np.stack([samples.x / np.std(samples.x), samples.v / np.std(samples.v)], axis=1)
    parts = np.linalg.lstsq(linear, samples.law - samples.textbook, rcond=None)[0]
    return np.asarray(samples.textbook + linear @ parts)


def _seen(
    final: Fit,
    bare: Hypothesis,
    joint: tuple[JointAxis, tuple[JointLaw, JointLaw]],
    number: int,
    lines: WindowedSpectrum,
) -> _Sample:
    """Return motion and force along the joint in one recording, and the forces of both laws for that motion."""
    axis, laws = joint
    through = through_structure(bare, lines)
    covariance = fitted_noise(lines, through, final.noises[number])
    rest = lines.measured - predict_lines(bare, lines).response
    record = FloorRecord(lines, rest, through, whitening(covariance), np.zeros((0, 0)), np.zeros(0))
    seen: SeenMotion = seen_motion(record, bare, axis)
    kept = slice(lines.start, len(seen.force) - max(int(lines.recording.rate), 1))
    given = [driven_force(lines, seen.deflection, seen.velocity, law) for law in laws]
    force, law, textbook = (_in_band(one, lines)[kept] for one in (seen.force, *given))
    piece = np.arange(len(force)) // max(int(BLOCK * lines.recording.rate), 1)
    return _Sample(seen.deflection[kept], seen.velocity[kept], force, law, textbook, piece)


def _in_band(signal: Real, lines: WindowedSpectrum) -> Real:
    axis = np.arange(len(signal) // 2 + 1) * lines.recording.rate / len(signal)
    inside = (axis >= lines.frequencies[0]) & (axis <= lines.frequencies[-1])
    return np.asarray(scipy.fft.irfft(scipy.fft.rfft(signal) * inside, n=len(signal)))


def _joined(parts: list[_Sample]) -> _Sample:
    pieces, count = [], 0
    for part in parts:
        pieces.append(part.piece + count)
        count += int(part.piece[-1]) + 1
    names = ("x", "v", "force", "law", "textbook")
    x, v, force, law, textbook = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
    return _Sample(x, v, force, law, textbook, np.concatenate(pieces))


def _edges(values: Real) -> Real:
    """Return edges of bins that hold all but one in 500 samples, halfway between evenly wide and evenly filled."""
    shares = np.linspace(0.001, 0.999, BINS + 1)
    filled = np.quantile(values, shares)
    return np.asarray(0.5 * (filled + np.linspace(filled[0], filled[-1], BINS + 1)))


def _mean_at(values: Real, force: Real, edges: Real) -> Real:
    """Return the mean force at each sample, interpolated linearly between the middles of the bins."""
    place = np.digitize(values, edges[1:-1])
    held = np.maximum(np.bincount(place, minlength=BINS), 1)
    means = np.bincount(place, force, BINS) / held
    return np.asarray(np.interp(values, 0.5 * (edges[1:] + edges[:-1]), means))


def _binned(samples: _Sample, values: Real, edges: Real, chosen: NDArray[np.bool_]) -> BinnedForce:
    """Return means in bins, and their errors by leaving out one piece of the records at a time (jackknife)."""
    inside = chosen & (values >= edges[0]) & (values <= edges[-1])
    place = np.digitize(values[inside], edges[1:-1])
    piece = samples.piece[inside]
    count = int(samples.piece[-1]) + 1
    cell = piece * BINS + place
    held = np.bincount(cell, minlength=count * BINS).reshape(count, BINS).astype(float)
    sums = np.bincount(cell, samples.force[inside], count * BINS).reshape(count, BINS)
    total, all_sums = held.sum(axis=0), sums.sum(axis=0)
    good = total >= LEAST_SAMPLES
    left = (all_sums - sums) / np.maximum(total - held, 1)
    error = np.sqrt((count - 1) / count * np.sum((left - left.mean(axis=0)) ** 2, axis=0))
    law, textbook = (
        np.bincount(place, one[inside], BINS) / np.maximum(total, 1) for one in (samples.law, samples.textbook)
    )
    at = np.bincount(place, values[inside], BINS) / np.maximum(total, 1)
    return BinnedForce(at[good], (all_sums / np.maximum(total, 1))[good], error[good], law[good], textbook[good])
