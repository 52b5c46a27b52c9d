"""Measured restoring force of a joint without an assumed law: means in bins of deflection and of velocity."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..joints.joint_axis import JointAxis
from ..joints.joint_law import driven_force
from ..models.cause import Cause
from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, through_structure
from ..physics.library import rig_of
from ..physics.protocol import reported_name
from ..physics.wider_forms import FreeForm
from ..records.noise_model import whitening
from ..screening.joint_places import EstimatedMotion, estimated_motion
from ..screening.whitened_residual import FloorRecord
from .residual_view import StructureDetails, StructureDiagnosis

MOST_BINS = 21
MEAN_SAMPLES = 80  # samples for each bin on average, from which short recordings get fewer bins
MIN_SAMPLES = 20  # least number of samples in a bin
BLOCK = 1.0  # length of a piece of the recording that counts as an independent sample, s


@dataclass(frozen=True)
class BinnedForce:
    """Mean force of a joint in bins of its deflection or velocity.

    Parameters
    ----------
    at : (n,)
        Mean deflection (m) or velocity (m/s) of each bin.
    force, error : (n,), N
        Mean measured force and its standard error, from the scatter between pieces of the recordings.
    law : (n,), N
        Force of the accepted law under the same motion, filtered and averaged in the same way.
    textbook : (n,), N, or None
        Force of the law of the library, if the accepted law has a free form, averaged in the same way. The spring and
        damper that fit best are added, as the data cannot distinguish them from those of the structure.
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
        Axis of the joint.
    forward, backward
        Force against rising and falling deflection; the two differ if the joint has friction or memory.
    damping
        Force against velocity, without the part that depends on deflection.
    explained
        Share of the power of the measured force that the accepted law explains.
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
    """Samples of all recordings in the band: deflection, velocity, force, forces of both laws, number of the piece."""

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


def missing_force_law(diagnosis: StructureDiagnosis) -> FreeFormLaw | None:
    """Return the missing force, estimated before any law was fitted, and the first accepted law; None without a force.

    Deflection and force are those at the tip along the direction nearest to the joint. A spring and a damper are free,
    in the force as well as in the law. Without an accepted law, the name is empty and the law has no values.
    """
    missing, final = diagnosis.details.missing, diagnosis.details.final.hypothesis
    if missing is None or not missing.significant:
        return None
    along, cause = missing.refit.tip_deflection, next(iter(final.laws), None)
    size = float(np.linalg.norm(along))
    parts = [
        _missing_in(
            recording,
            replace(
                motion, deflection=size * motion.deflection, velocity=size * motion.velocity, force=motion.force / size
            ),
            final,
        )
        for recording, motion in zip(diagnosis.details.recordings, missing.motions, strict=True)
    ]
    samples = _joined(parts)
    samples = replace(samples, law=samples.law + _best_linear(samples, samples.force - samples.law))
    samples = replace(samples, textbook=samples.law)
    share = 1 - float(np.mean((samples.force - samples.law) ** 2) / np.mean(samples.force**2))
    name, rig = "" if cause is None else reported_name(cause.physics), rig_of(final.model)
    rising, falling, damping = _bins(samples, freed=False)
    axis = JointAxis(missing.refit.direction()[0])
    return FreeFormLaw(name, axis, rising, falling, damping, share, rig.force_unit, rig.deflection_unit)


def _missing_in(lines: WindowedSpectrum, motion: EstimatedMotion, final: Hypothesis) -> _Sample:
    """Return the missing force in one recording, and the force of the first accepted law for the same motion."""
    samples = slice(lines.start, len(motion.force) - max(int(lines.recording.rate), 1))
    law = np.full(len(motion.force), np.nan)
    if final.laws:
        # the law's own deflection is that of its axis, which may differ from the direction at the tip by a factor
        own = predict_lines(final, lines).joints[0]
        factor = float(np.std(own.deflection) / np.std(motion.deflection))
        named = final.laws[0].law(lines.recording)
        force = driven_force(lines, factor * motion.deflection, factor * motion.velocity, named)
        law = _in_band(factor * force, lines)
    force = _in_band(motion.force, lines)[samples]
    piece = np.arange(len(force)) // max(int(BLOCK * lines.recording.rate), 1)
    return _Sample(motion.deflection[samples], motion.velocity[samples], force, law[samples], law[samples], piece)


def _measured(diagnosis: StructureDiagnosis, cause: Cause) -> FreeFormLaw:
    details, final = diagnosis.details, diagnosis.details.final.hypothesis
    assert cause.axis is not None
    bare = replace(final, causes=tuple(other for other in final.causes if other is not cause))
    laws = cause, _library_law(details, cause)
    samples = _joined(
        [_forces_of(details.final, bare, laws, k, recording) for k, recording in enumerate(details.recordings)]
    )
    forward, backward, damping = _bins(
        replace(samples, textbook=samples.textbook + _best_linear(samples, samples.law - samples.textbook)),
        details.textbook is not None,
    )
    share = 1 - float(np.mean((samples.force - samples.law) ** 2) / np.mean(samples.force**2))
    free = "free form of " if isinstance(cause.physics, FreeForm) else ""
    name, rig = free + reported_name(cause.physics), rig_of(final.model)
    return FreeFormLaw(name, cause.axis, forward, backward, damping, share, rig.force_unit, rig.deflection_unit)


def _library_law(details: StructureDetails, cause: Cause) -> Cause:
    """Return the law of the library from which a free form started; ``cause`` itself if its form is not free."""
    if details.textbook is None:
        return cause
    place = next(k for k, law in enumerate(details.final.hypothesis.laws) if law is cause)
    return details.textbook.laws[place]


def _bins(samples: _Sample, freed: bool) -> list[BinnedForce]:
    """Return the force over rising and over falling deflection, and the remaining force over velocity."""
    up, ends = samples.v > 0, _edges(samples.x)
    force, law, textbook = (
        force - _mean_at(samples.x, force, ends) for force in (samples.force, samples.law, samples.textbook)
    )
    remaining = replace(samples, force=force, law=law, textbook=textbook)
    binned = [
        _binned(samples, samples.x, ends, up),
        _binned(samples, samples.x, ends, ~up),
        _binned(remaining, samples.v, _edges(samples.v), np.ones(len(up), dtype=bool)),
    ]
    return binned if freed else [replace(bins, textbook=None) for bins in binned]


def _best_linear(samples: _Sample, force: Real) -> Real:
    """Return the force of the spring and damper that fit a force best; not a number where the force is none."""
    if not np.isfinite(force).all():
        return np.full(len(force), np.nan)
    linear = np.stack([samples.x / np.std(samples.x), samples.v / np.std(samples.v)], axis=1)
    return np.asarray(linear @ np.linalg.lstsq(linear, force, rcond=None)[0])


def _forces_of(
    final: Fit,
    bare: Hypothesis,
    laws: tuple[Cause, Cause],
    number: int,
    lines: WindowedSpectrum,
) -> _Sample:
    """Return motion and force along the joint in one recording, and the forces of both laws for that motion."""
    axis = laws[0].axis
    assert axis is not None
    through = through_structure(bare, lines)
    covariance = fitted_noise(lines, through, final.noises[number])
    predicted = predict_lines(bare, lines)
    residual = lines.measured - predicted.response
    record = FloorRecord(lines, predicted, residual, through, whitening(covariance), np.zeros((0, 0)), np.zeros(0))
    motion: EstimatedMotion = estimated_motion(record, bare, axis)
    samples = slice(lines.start, len(motion.force) - max(int(lines.recording.rate), 1))
    law_forces = [driven_force(lines, motion.deflection, motion.velocity, law.law(lines.recording)) for law in laws]
    force, law, textbook = (_in_band(force_signal, lines)[samples] for force_signal in (motion.force, *law_forces))
    piece = np.arange(len(force)) // max(int(BLOCK * lines.recording.rate), 1)
    return _Sample(motion.deflection[samples], motion.velocity[samples], force, law, textbook, piece)


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
    """Return the edges of bins halfway between evenly wide and evenly filled bins; one in 500 samples is left out."""
    count = int(np.clip(len(values) // MEAN_SAMPLES, 2, MOST_BINS))
    filled = np.quantile(values, np.linspace(0.001, 0.999, count + 1))
    return np.asarray(0.5 * (filled + np.linspace(filled[0], filled[-1], count + 1)))


def _mean_at(values: Real, force: Real, edges: Real) -> Real:
    """Return the mean force at each sample, interpolated linearly between the middles of the bins."""
    place, n_bins = np.digitize(values, edges[1:-1]), len(edges) - 1
    counts = np.maximum(np.bincount(place, minlength=n_bins), 1)
    means = np.bincount(place, force, n_bins) / counts
    return np.asarray(np.interp(values, 0.5 * (edges[1:] + edges[:-1]), means))


def _binned(samples: _Sample, values: Real, edges: Real, chosen: NDArray[np.bool_]) -> BinnedForce:
    """Return means in bins, and their errors by leaving out one piece of the records at a time (jackknife)."""
    inside = chosen & (values >= edges[0]) & (values <= edges[-1])
    place, n_bins = np.digitize(values[inside], edges[1:-1]), len(edges) - 1
    piece = samples.piece[inside]
    count = int(samples.piece[-1]) + 1
    cell = piece * n_bins + place
    counts = np.bincount(cell, minlength=count * n_bins).reshape(count, n_bins).astype(float)
    sums = np.bincount(cell, samples.force[inside], count * n_bins).reshape(count, n_bins)
    total, all_sums = counts.sum(axis=0), sums.sum(axis=0)
    good = total >= MIN_SAMPLES
    others = (all_sums - sums) / np.maximum(total - counts, 1)
    error = np.sqrt((count - 1) / count * np.sum((others - others.mean(axis=0)) ** 2, axis=0))
    law, textbook = (
        np.bincount(place, force[inside], n_bins) / np.maximum(total, 1) for force in (samples.law, samples.textbook)
    )
    at = np.bincount(place, values[inside], n_bins) / np.maximum(total, 1)
    return BinnedForce(at[good], (all_sums / np.maximum(total, 1))[good], error[good], law[good], textbook[good])
