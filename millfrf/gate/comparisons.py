"""Checks of files against each other: calibration FRFs, scales, models and recordings, origins."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import RecordingFile, Stream
from estimation import Frf, family_of, names_at, quantities_of_unit, refuse_shared, to_receptance
from millfrf.core import InputError, shared_band
from modal_fit import ModalModel, TipCalibration

from .frfs import check_frf
from .models import check_model, stored_warnings
from .passivity import check_reciprocity, drive_points
from .recordings import RECORD_AGAIN, check_channels
from .settings import GATE


def check_tip_and_sensor(
    model: ModalModel, tip: Frf, sensor: Frf, names: tuple[str, str] = ("the tip's FRF", "the sensor's FRF")
) -> list[str]:
    """Check both hammer FRFs before a model is transferred from the sensor to the tool tip.

    Parameters
    ----------
    model
        In-process model with responses at the sensor.
    tip, sensor
        Hammer FRFs, both excited at the tip.
    names
        Names of their files, for the message.

    Returns
    -------
    list of str
        Warnings: a tip's FRF that is not reciprocal, neither FRF measured where it is tapped, or a mode of the model
        outside the band of the taps.

    Raises
    ------
    InputError
        One FRF given twice, tip and sensor exchanged, different exponential windows, or an FRF that
        :func:`check_frf` refuses.
    """
    for frf, name in zip((tip, sensor), names, strict=True):
        if frf.measured is not None:
            raise InputError(
                f"{name} lacks {frf.unmeasured} (not measured): a mode of the cut moves in all directions, and cannot "
                "be scaled with direct terms alone; measure all directions at each hit"
            )
    warnings = check_frf(tip, names[0]) + check_frf(sensor, names[1]) + check_reciprocity(tip, names[0])
    if tip.exponential_time_constant != sensor.exponential_time_constant:
        raise InputError(
            f"{names[0]} and {names[1]} have different exponential windows ({_window(tip)} and {_window(sensor)}): "
            "their modes have different damping; make both with one --exponential"
        )
    if tip.values.shape == sensor.values.shape and _equal(tip, sensor):
        raise InputError(
            f"{names[0]} and {names[1]} hold the same values: one FRF was given as tip and as sensor; give the "
            "response at the tip to --tip and that at the sensor to --sensor"
        )
    at_tip = bool(drive_points(tip.responses, tip.excitations))
    at_sensor = bool(drive_points(sensor.responses, sensor.excitations))
    if at_sensor and not at_tip:
        raise InputError(
            f"{names[1]} is measured where it is tapped ({sensor.responses[0]}) and {names[0]} is not "
            f"({tip.responses[0]}): tip and sensor are exchanged; swap --tip and --sensor"
        )
    if tip.responses == sensor.responses and not np.array_equal(tip.values, sensor.values):
        warnings.append(
            f"{names[0]} and {names[1]} both state that they are measured at {', '.join(tip.responses)}: they cannot "
            "be distinguished; name the sensor's node and the tip's in the recordings"
        )
    if not at_tip and not at_sensor:
        warnings.append(
            f"{names[0]} is measured at {tip.responses[0]} and tapped at {tip.excitations[0]}: neither FRF is measured "
            "where it is tapped, so that it is not certain which is the tip's"
        )
    return [*warnings, *_modes_outside(model, tip, sensor)]


def _window(frf: Frf) -> str:
    tau = frf.exponential_time_constant
    return "none" if tau is None else f"{tau:.4g} s"


def _modes_outside(model: ModalModel, tip: Frf, sensor: Frf) -> list[str]:
    """Return a warning about modes outside the band in which the ratio of tip to sensor is known."""
    band = shared_band(tip.band, sensor.band)
    if band is None:
        return []
    natural = model.natural_frequencies
    outside = natural[(natural < band[0]) | (natural > band[1])]
    if not len(outside):
        return []
    return [
        f"{len(outside)} of {len(natural)} modes of the model (at {', '.join(f'{f:.4g}' for f in outside)} Hz) lie "
        f"outside the {band[0]:g} to {band[1]:g} Hz in which both FRFs are known; tap with a tip that drives them"
    ]


def _equal(tip: Frf, sensor: Frf) -> bool:
    first, second = to_receptance(tip), to_receptance(sensor)
    valid = first.valid & second.valid
    size = np.abs(first.values[valid]).max(initial=0.0)
    return bool(np.abs(first.values[valid] - second.values[valid]).max(initial=0.0) <= GATE.frfs_equal * size)


def effective_masses(model: ModalModel) -> dict[str, float]:
    """Compute the mass (kg) that the modes of a receptance show at each drive point, ``1 / sum_r |phi_r|^2``.

    ``phi_r^2 = 2 w_d |A_r|`` with the residue A_r of the drive point is what mode r adds to the motion of a free mass.
    The sum grows with each mode that is measured, so that the mass falls towards that of the tool alone.
    """
    sizes = 2 * np.abs(model.poles.imag)[:, None]
    masses: dict[str, float] = {}
    for points in drive_points(model.responses, model.excitations).values():
        rows, columns = [point.row for point in points], [point.column for point in points]
        total = np.sum(sizes * np.abs(model.right[:, rows] * model.left[:, columns]), axis=0)
        masses |= {point.name: float(1 / mass) for point, mass in zip(points, total, strict=True) if mass > 0}
    return masses


def check_tip_mass(model: ModalModel) -> list[str]:
    """Return a warning if the lightest direction of the tip moves like more than a spindle with the robot's wrist.

    It is the only check of a unit that is wrong in every file alike, such as all accelerations in g.
    """
    masses = effective_masses(model)
    if not masses or min(masses.values()) <= GATE.tip_mass_max:
        return []
    listed = ", ".join(f"{mass:.3g} kg at {name}" for name, mass in masses.items())
    return [
        f"the modes move the tip like a mass of {listed}; a spindle on a robot's wrist shows 15 to "
        f"{GATE.tip_mass_max:g} kg in its lightest direction: were accelerations in g called m/s^2 in all files?"
    ]


def check_tip_phase(calibration: TipCalibration) -> list[str]:
    """Return a warning if cut and taps differ at the sensor by a phase of one sign in every mode.

    A structure changes its frequencies between rest and cut, and close modes mix with phases of both signs; a filter or
    a delay turns all modes to one side. Each mode's phase must exceed the angle that shifts a limit beyond its error.
    """
    agreement = calibration.agreement
    phases = np.angle(agreement.factors)
    errors = agreement.factor_errors / np.maximum(np.abs(agreement.factors), 1e-300)
    least = np.abs(phases) - scipy.special.ndtri(1 - GATE.p_value) * errors
    if not (least > GATE.delay_angle).all() or np.unique(np.sign(phases)).size != 1:
        return []
    listed = ", ".join(
        f"{angle:.0f}° at {frequency:.4g} Hz"
        for angle, frequency in zip(np.degrees(np.abs(phases)), agreement.frequencies[:, 0], strict=True)
    )
    return [
        f"the sensor's motion in the cut {'leads' if phases[0] > 0 else 'lags'} that in the taps in every mode "
        f"({listed}), as behind a filter or a delay in one of the two tests: state high_pass_hz and input_delay_s of "
        "the channels, or use one chain for both, and repeat fit and tap"
    ]


# predicted over measured, and the mistake that most likely causes it
UNITS = (
    (9.80665, "were accelerations in g called m/s^2? Multiply them by 9.80665"),
    (1 / 9.80665, "were accelerations multiplied by 9.80665 though they were in m/s^2?"),
    (1e3, "were forces in mN called N, or motions in km called m?"),
    (1e-3, "were forces in kN called N, or motions in mm called m? Multiply forces by 1000"),
)


def check_scales(names: Sequence[str], measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> list[str]:
    """Compare scale and sign of each measured response with the prediction, and return warnings.

    A warning is returned if measurement and prediction differ only by the factor
    ``<predicted, predicted> / <predicted, measured>``, and if a wrong unit or a reversed sensor explains this factor.

    Parameters
    ----------
    names
        Names of the responses.
    measured, predicted : (n_samples, n_responses)
        Measured and predicted responses in the same unit, after the run-in.
    """
    warnings = []
    centred = [(signal - signal.mean(axis=0)).T for signal in (measured, predicted)]
    for name, m, p in zip(names, *centred, strict=True):
        sizes = float(np.sqrt((m @ m) * (p @ p)))
        correlation = float(m @ p) / sizes if sizes > 0 else 0.0
        if abs(correlation) < GATE.scale_correlation:
            continue
        gain = float(p @ p) / abs(float(m @ p))
        if correlation < 0:
            warnings.append(
                f"{name}: the predicted response has the opposite sign: was the sensor turned round? Correct its "
                "direction in the recording"
            )
        for factor, meaning in UNITS:
            if abs(gain / factor - 1) < GATE.scale_tolerance:
                warnings.append(f"{name}: predicted is {gain:.4g} times measured: {meaning}")
    return warnings


def check_model_and_recordings(
    model_path: str | os.PathLike[str],
    model: ModalModel,
    recordings: Sequence[RecordingFile],
    stream: str | None = None,
) -> list[str]:
    """Check a model, the warnings of its fit, and the channels of recordings at its degrees of freedom.

    Parameters
    ----------
    model_path
        File of the model.
    model
        Modal model that the file contains.
    recordings
        Recordings with which the model is compared.
    stream
        Sample clock; None: the only one.

    Returns
    -------
    list of str
        Warnings about the model, about its fit and about each recording.

    Raises
    ------
    InputError
        As :func:`millfrf.gate.check_model` and :func:`millfrf.gate.check_recordings`.
    """
    warnings = [*check_model(model, Path(model_path).name), *stored_warnings(model_path)]
    if not recordings:
        return warnings

    response, excites = quantities_of_unit(model.unit)
    motions = family_of(response)

    def chosen(source: Stream) -> tuple[tuple[str, ...], tuple[str, ...]]:
        # missing channels are not an error here: the reader of the recordings refuses them
        channels = source.channels
        exciting = names_at(channels, model.excitations, (excites,))
        responding = names_at(channels, model.responses, motions)
        refuse_shared(exciting, responding, source.path.name)
        return exciting, responding

    return [*warnings, *check_channels(recordings, chosen, stream, remedy=RECORD_AGAIN)]


@dataclass(frozen=True)
class ReportFile:
    """A file of a report, with what it states of its origin."""

    name: str  # without its folder
    kind: str  # as FileKind names it
    sha256: str
    provenance: Mapping[str, Any]  # sources and versions that the file states

    @property
    def sources(self) -> dict[str, str]:
        """Names of the files from which this file was made, by their hash."""
        stored = self.provenance.get("sources", [])
        return {str(source.get("sha256")): str(source.get("file")) for source in stored if isinstance(source, dict)}


# for each kind of file, groups of kinds from which it is made; if files of a group are given, one must be a source
MADE_OF: dict[str, tuple[tuple[str, ...], ...]] = {
    "frf": (("recording",),),
    "modal model": (("recording", "frf", "modal model"),),
    "lobes": (("frf", "modal model"), ("cutting data",)),
    "chatter verdicts": (("cutting data",),),
}


def check_belonging(files: Sequence[ReportFile]) -> list[str]:
    """Check whether the files of a report belong together, and return warnings.

    A file that states its sources is compared with the files of the kinds of its sources. If one of these has the name
    of a source but another content, it has changed since. If none of these is a source, and none shares a source, the
    file belongs to another test. An FRF or a model may also be related through other FRFs and models, such as hammer
    tests with which a model was transferred to the tool tip. Files that state no sources are not checked; nor are the
    recordings of the cuts that gave the coefficients.
    """
    warnings = [f"{name} is given twice" for name in _twice(files)]
    of_cuts = {source for file in files if file.kind == "cutting data" for source in file.sources}
    for file in files:
        if not file.sources:
            continue
        related = _related_hashes(file, files)
        groups = [
            [other for other in files if other is not file and other.kind in group and other.sha256 not in of_cuts]
            for group in MADE_OF.get(file.kind, ())
        ]
        warnings += _check_sources(file, groups, related)
    return warnings


def _related_hashes(file: ReportFile, files: Sequence[ReportFile]) -> set[str]:
    """Return the hashes of all files to which common sources, in one or more steps, relate an FRF or a model.

    For a file of another kind, return only the hash of the file.
    """
    related, measured = {file.sha256}, [other for other in files if other.kind in ("frf", "modal model")]
    if file not in measured:
        return related
    families = [{other.sha256, *other.sources} for other in measured]
    while True:
        grown = related.union(*(family for family in families if family & related))
        if grown == related:
            return related
        related = grown


def _twice(files: Sequence[ReportFile]) -> list[str]:
    hashes = [file.sha256 for file in files]
    return [file.name for i, file in enumerate(files) if file.sha256 in hashes[:i]]


def _check_sources(file: ReportFile, groups: Sequence[Sequence[ReportFile]], related: set[str]) -> list[str]:
    """Compare a file with the groups of files that could be its sources, and return at most one warning."""
    names = file.sources.values()
    candidates = [other for group in groups for other in group]
    changed = [other.name for other in candidates if other.name in names and other.sha256 not in file.sources]
    if changed:
        return [
            f"{file.name} was not made from {', '.join(changed)} as it is now: the file has changed since; make "
            f"{file.name} anew"
        ]
    foreign = [
        other.name
        for group in groups
        if not any(other.sha256 in related or _related(file, other) for other in group)
        for other in group
    ]
    if not foreign:
        return []
    return [
        f"{file.name} was not made from {', '.join(foreign)} but from {', '.join(names)}: they may belong to different "
        "tests"
    ]


def _related(file: ReportFile, other: ReportFile) -> bool:
    """Return whether one of two files was made from the other file, or both were made from a common source."""
    common = set(other.sources) & set(file.sources)
    return other.sha256 in file.sources or file.sha256 in other.sources or bool(common)
