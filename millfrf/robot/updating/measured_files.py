"""Recordings, FRFs and modal models as what a robot's update takes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, is_uff_number, read_frf, read_frf_uff
from millfrf.core import FileFormatError, InputError
from millfrf.robot_model import (
    PosedReceptance,
    SpatialCase,
    close_loops,
    measured_frf,
    measured_model,
    modes_at,
    tool_down,
)
from modal_fit import read_modal_model

from ...chain import LOCAL, EstimateOptions, estimate_recordings
from ...file_kinds import FRF, MODEL, RECORDING, kind_of
from ...options import check_band
from ...progress import bar
from ...provenance import read_provenance
from ..postures import Asked, posture_of
from .asking import Asking

Real = NDArray[np.float64]

LOWEST, HIGHEST = 0.4, 1.3
"""Band that is compared where none is given: from so many times the first mode to so many times the sixth."""

WINDOW_TAPS = 9
"""Half lines over which a Hann window averages an FRF: beyond them it weighs less than 0.1 %."""


def read_measured(case: SpatialCase, paths: Sequence[Path], asking: Asking) -> list[PosedReceptance]:
    """Read each file in its posture.

    Raises
    ------
    InputError
        Not one posture a file, files that are none of the three kinds, or degrees of freedom that a robot does not
        have.
    """
    if len(asking.poses) != len(paths):
        raise InputError(
            f"{len(asking.poses)} postures for {len(paths)} files; give --pose once for each, in the same order"
        )
    postures = [close_loops(case.robot.mechanism, _driven(case, pose)) for pose in asking.poses]
    band = check_band(asking.band) or _band(case, postures)
    axes = np.eye(3) if asking.feed is None else tool_down([0.0, 0.0, 0.0], np.radians(asking.feed)).axes
    sensor = None if asking.sensor is None else np.array(asking.sensor)
    return [_read(path, q, band, axes, sensor, asking.stream) for path, q in zip(paths, postures, strict=True)]


def _read(
    path: Path, q: Real, band: tuple[float, float], axes: Real, sensor: Real | None, stream: str | None
) -> PosedReceptance:
    if path.suffix.lower() in (".uff", ".unv", ".uf"):
        return measured_frf(_from_uff(path), path.name, q, band, axes=axes, sensor=sensor)
    kind = kind_of(path)
    if kind == MODEL:
        return measured_model(read_modal_model(path), path.name, q, band, axes=axes, sensor=sensor)
    if kind == FRF:
        frf = read_frf(path)
        return measured_frf(frf, path.name, q, band, axes=axes, sensor=sensor, window=_window(path, frf))
    if kind == RECORDING:
        options = EstimateOptions(estimator=LOCAL, band=band, stream=stream)
        frf = estimate_recordings([path], options, bar).frf
        return measured_frf(frf, path.name, q, band, axes=axes, sensor=sensor)
    raise FileFormatError(f"{path} is {kind}; an update takes recordings, FRFs and modal models")


def _from_uff(path: Path) -> Frf:
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    frf = read_frf_uff(path)
    numbered = [label for label in (*frf.responses, *frf.excitations) if is_uff_number(label.split(":")[0])]
    if numbered:
        raise InputError(
            f"{path.name}: nodes are numbers ({numbered[0]}); name them TCP and HOUSING with "
            "'millfrf convert IN OUT --map MAP.toml'"
        )
    return frf


def _window(path: Path, frf: Frf) -> Real | None:
    """Weights of half lines of an FRF that ``millfrf estimate`` made with a Hann window; None for every other one.

    The cross spectrum of windowed segments shows the FRF averaged over ``|W(f - f')|^2``; its inverse transform reaches
    over two segments, so that half lines give it exactly (Bendat & Piersol, Random Data, section 11.6).
    """
    options = read_provenance(path).get("options", {})
    segmented = options.get("estimator") in ("h1", "h2", "hv") and options.get("window") == "hann"
    steps = np.diff(frf.frequencies)
    if not segmented or len(steps) < 2 or abs(float(options.get("segment", 0.0)) * steps.min() - 1) > 0.01:
        return None
    bins = np.arange(-(WINDOW_TAPS // 2), WINDOW_TAPS // 2 + 1) / 2
    line = np.sinc(bins) + 0.5 * (np.sinc(bins - 1) + np.sinc(bins + 1))
    return np.asarray(line**2 / np.sum(line**2))


def _driven(case: SpatialCase, pose: str) -> Real:
    asked = Asked(joints=pose) if "," in pose else Asked(pose=pose)
    return posture_of(case, asked)[0]


def _band(case: SpatialCase, postures: Sequence[Real]) -> tuple[float, float]:
    frequencies = [modes_at(case.robot, q).frequencies for q in postures]
    return (
        LOWEST * min(float(one[0]) for one in frequencies),
        HIGHEST * max(float(one[min(5, len(one) - 1)]) for one in frequencies),
    )
