"""Checks of files against each other: calibration FRFs, scales, models and recordings, origins."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import RecordingFile, Stream
from estimation import Frf, family_of, names_at, quantities_of_unit, refuse_shared, to_receptance
from millfrf.core import InputError, shared_band
from modal_fit import ModalModel

from .frfs import check_frf
from .models import check_model, stored_doubts
from .passivity import drive_points
from .recordings import RECORD_AGAIN, check_channels

CALIBRATIONS_ALIKE = 1e-9
"""Relative difference below which two FRFs are one: two measurements differ by their noise."""


def check_tip_and_sensor(
    model: ModalModel, tip: Frf, sensor: Frf, names: tuple[str, str] = ("the tip's FRF", "the sensor's FRF")
) -> list[str]:
    """Judge both hammer FRFs before a model is carried from sensor to tip.

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
        Doubts: neither FRF is measured where it is tapped, or a mode of the model lies outside the band of the taps.

    Raises
    ------
    InputError
        One FRF given twice, tip and sensor exchanged, unlike exponential windows, or an FRF that
        :func:`check_frf` refuses.
    """
    doubts = check_frf(tip, names[0]) + check_frf(sensor, names[1])
    if tip.exponential_time_constant != sensor.exponential_time_constant:
        raise InputError(
            f"{names[0]} and {names[1]} have different exponential windows ({_window(tip)} and {_window(sensor)}): "
            "their modes have different damping; make both with one --exponential"
        )
    if tip.values.shape == sensor.values.shape and _alike(tip, sensor):
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
        doubts.append(
            f"{names[0]} and {names[1]} both say that they are measured at {', '.join(tip.responses)}: they cannot "
            "be told apart; name the sensor's node and the tip's in the recordings"
        )
    if not at_tip and not at_sensor:
        doubts.append(
            f"{names[0]} is measured at {tip.responses[0]} and tapped at {tip.excitations[0]}: neither FRF is measured "
            "where it is tapped, so that nothing shows which is the tip's"
        )
    return [*doubts, *_modes_outside(model, tip, sensor)]


def _window(frf: Frf) -> str:
    tau = frf.exponential_time_constant
    return "none" if tau is None else f"{tau:.4g} s"


def _modes_outside(model: ModalModel, tip: Frf, sensor: Frf) -> list[str]:
    """Modes whose ratio of tip to sensor was not tapped."""
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


def _alike(tip: Frf, sensor: Frf) -> bool:
    one, other = to_receptance(tip), to_receptance(sensor)
    both = one.valid & other.valid
    size = np.abs(one.values[both]).max(initial=0.0)
    return bool(np.abs(one.values[both] - other.values[both]).max(initial=0.0) <= CALIBRATIONS_ALIKE * size)


SCALES_ALIKE = 0.8
"""Correlation from which predicted and measured are one signal but for a factor."""

NEAR = 0.15
"""Share by which a factor may differ from that of a unit."""

UNITS = (
    (9.80665, "were accelerations in g called m/s^2? Multiply them by 9.80665"),
    (1 / 9.80665, "were accelerations multiplied by 9.80665 though they were in m/s^2?"),
    (1e3, "were forces in mN called N, or motions in km called m?"),
    (1e-3, "were forces in kN called N, or motions in mm called m? Multiply forces by 1000"),
)
"""Predicted over measured, and what it most likely means."""


def check_scales(names: Sequence[str], measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> list[str]:
    """Judge each response's size and sign by comparison with the prediction.

    ``gain = <predicted, measured> / <measured, measured>``, told where the two are one signal but for a factor that a
    wrong unit or a sensor turned round gives.

    Parameters
    ----------
    names
        Names of the responses.
    measured, predicted : (n_samples, n_responses)
        Measured and predicted responses in the same unit, after the run-in.

    Returns
    -------
    list of str
        Doubts: sentences for a warning; empty where nothing is odd.
    """
    doubts = []
    centred = [(signal - signal.mean(axis=0)).T for signal in (measured, predicted)]
    for name, m, p in zip(names, *centred, strict=True):
        sizes = float(np.sqrt((m @ m) * (p @ p)))
        likeness = float(m @ p) / sizes if sizes > 0 else 0.0
        if abs(likeness) < SCALES_ALIKE:
            continue
        gain = float(p @ p) / abs(float(m @ p))
        if likeness < 0:
            doubts.append(
                f"{name}: measured is predicted with the opposite sign: was the sensor turned round? Correct its "
                "direction in the recording"
            )
        for factor, meaning in UNITS:
            if abs(gain / factor - 1) < NEAR:
                doubts.append(f"{name}: predicted is {gain:.4g} times measured: {meaning}")
    return doubts


def check_model_and_recordings(
    model_path: str | os.PathLike[str],
    model: ModalModel,
    recordings: Sequence[RecordingFile],
    stream: str | None = None,
) -> list[str]:
    """Judge a model, what its file says of its fit, and the channels of recordings at its degrees of freedom.

    Parameters
    ----------
    model_path
        File of the model.
    model
        What was read of it.
    recordings
        Files it is compared with.
    stream
        Sample clock; None: the only one.

    Returns
    -------
    list of str
        Doubts on the model, on the fit that it comes from and on each recording.

    Raises
    ------
    InputError
        As :func:`millfrf.gate.check_model` and :func:`millfrf.gate.check_recordings`.
    """
    doubts = [*check_model(model, Path(model_path).name), *stored_doubts(model_path)]
    if not recordings:
        return doubts

    response, excites = quantities_of_unit(model.unit)
    motions = family_of(response)

    def chosen(source: Stream) -> tuple[tuple[str, ...], tuple[str, ...]]:
        # those that are missing are the reader's to refuse
        channels = source.channels
        exciting = names_at(channels, model.excitations, (excites,))
        responding = names_at(channels, model.responses, motions)
        refuse_shared(exciting, responding, source.path.name)
        return exciting, responding

    return [*doubts, *check_channels(recordings, chosen, stream, remedy=RECORD_AGAIN)]


@dataclass(frozen=True)
class Given:
    """A file of a report.

    Parameters
    ----------
    name
        Name of the file without its folder.
    kind
        Kind of the file, as :class:`FileKind` names it.
    sha256
        SHA-256 hash of its bytes.
    provenance
        Sources and versions that the file states.
    """

    name: str
    kind: str
    sha256: str
    provenance: Mapping[str, Any]

    @property
    def sources(self) -> dict[str, str]:
        """Hash to name of the files it was made from."""
        stored = self.provenance.get("sources", [])
        return {str(one.get("sha256")): str(one.get("file")) for one in stored if isinstance(one, dict)}


MADE_OF: dict[str, tuple[tuple[str, ...], ...]] = {
    "frf": (("recording",),),
    "modal model": (("recording", "frf", "modal model"),),
    "lobes": (("frf", "modal model"), ("cutting data",)),
    "chatter verdicts": (("cutting data",),),
}
"""For each kind, groups of kinds that it is made of: one file of each group is expected, where any of it is given."""


def check_belonging(files: Sequence[Given]) -> list[str]:
    """Judge whether the files of a report belong together.

    A file that states its sources is held against the given files of the kinds that it is made of. One of the same
    name but other bytes has changed since; where none is a source, nor made from one of the same sources, the file
    belongs to something else. An FRF or a model may also be tied to them by other FRFs and models, as taps are that
    carried a model to the tool tip. Files that state no sources are not judged.

    Returns
    -------
    list of str
        Doubts: sentences for a warning; empty where nothing is odd.
    """
    doubts = [f"{name} is given twice" for name in _twice(files)]
    for file in files:
        if not file.sources:
            continue
        for group in MADE_OF.get(file.kind, ()):
            others = [one for one in files if one is not file and one.kind in group]
            doubts += _judged(file, others, _tied(file, files))
    return doubts


def _tied(file: Given, files: Sequence[Given]) -> set[str]:
    """Hashes of all files that FRFs and models tie to one, step by step; of a table of lobes none but itself."""
    tied, measured = {file.sha256}, [one for one in files if one.kind in ("frf", "modal model")]
    if file not in measured:
        return tied
    while True:
        families = [{one.sha256, *one.sources} for one in measured]
        grown = tied.union(*(family for family in families if family & tied))
        if grown == tied:
            return tied
        tied = grown


def _twice(files: Sequence[Given]) -> list[str]:
    hashes = [file.sha256 for file in files]
    return [file.name for i, file in enumerate(files) if file.sha256 in hashes[:i]]


def _judged(file: Given, others: Sequence[Given], tied: set[str]) -> list[str]:
    """One file against those that could be its sources."""
    changed = [one for one in others if one.name in file.sources.values() and one.sha256 not in file.sources]
    if changed:
        return [
            f"{file.name} was not made from {one.name} as it is now: the file has changed since; make {file.name} anew"
            for one in changed
        ]
    if not others or any(one.sha256 in tied or _related(file, one) for one in others):
        return []
    return [
        f"{file.name} was not made from {', '.join(one.name for one in others)} but from "
        f"{', '.join(file.sources.values())}: they may belong to different tests"
    ]


def _related(file: Given, other: Given) -> bool:
    """Made from it, made from the same files, or it from this one."""
    return other.sha256 in file.sources or file.sha256 in other.sources or bool(set(other.sources) & set(file.sources))
