"""Uncertainty of results after an update of a robot's file: FRFs, lobes, frequencies and deviations."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from estimation import Frf
from millfrf.core import InputError, Real, write_csv
from millfrf.cutting import MillingProcess
from millfrf.robot_model import (
    PlanarCase,
    SpatialCase,
    SpatialRobot,
    close_loops,
    derived_errors,
    frf_with_errors,
    modal_model_at,
    modes_at,
)
from millfrf.stability import LimitBand, StabilityLobes, limit_band
from modal_fit import ModalModel

from ..settings import ROBOT_STEPS, RPM


def with_errors(frf: Frf, case: PlanarCase | SpatialCase, driven: Real, axes: Real | None) -> Frf:
    """The FRF with the covariance of the update; unchanged if the file was never updated."""
    if not isinstance(case, SpatialCase) or case.uncertainty is None:
        return frf
    q = close_loops(case.robot.mechanism, driven)

    def values(robot: SpatialRobot) -> Real:
        receptance = modal_model_at(robot, q, axes=axes).receptance(frf.frequencies)
        return np.stack([receptance.real, receptance.imag])

    errors = derived_errors(case.robot, case.uncertainty, values)
    return frf_with_errors(frf, np.sqrt(np.sum(errors**2, axis=0)))


def band_of_lobes(
    model: ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float
) -> tuple[LimitBand | None, tuple[str, ...]]:
    """95 % interval of certified limits, or a warning if it cannot be computed; both empty without a covariance."""
    if model.covariance is None:
        return None, ()
    try:
        return limit_band(model, process, lobes, 1.5 * max_depth), ()
    except InputError as error:
        return None, (f"the update's covariance gives no band of these lobes: {error}",)


def band_path(out: Path) -> Path:
    """File of the band for a table of lobes: ``<lobes>_band.csv``."""
    return out.with_name(f"{out.stem}_band.csv")


def write_band(path: Path, band: LimitBand, provenance: Mapping[str, Any]) -> None:
    """Write speeds (rpm), both ends of the band (m) and how they were computed."""
    columns = ("spindle_speed_rpm", "depth_limit_low_m", "depth_limit_high_m", "basis")
    rows = zip(band.spindle_speeds / RPM, band.low, band.high, band.basis, strict=True)
    write_csv(path, columns, rows, provenance=provenance)


def frequency_errors(case: SpatialCase, postures: Sequence[Real | None]) -> Real | None:
    """Standard errors of the lowest natural frequency, (n,), Hz, NaN without a posture; None without an update."""
    if case.uncertainty is None:
        return None
    reached = [q for q in postures if q is not None]

    def lowest(robot: SpatialRobot) -> Real:
        return np.array([modes_at(robot, q).frequencies[0] for q in reached])

    errors = np.full(len(postures), np.nan)
    errors[[q is not None for q in postures]] = derived_errors(case.robot, case.uncertainty, lowest)
    return errors


def frequency_sentence(errors: Real) -> str:
    """Sentence on the uncertainty of the lowest frequency, from standard errors in Hz."""
    half = ROBOT_STEPS.normal_95 * errors
    return (
        f"uncertainty of the lowest frequency after the update: ±{np.nanmedian(half):.2g} Hz in the median, "
        f"±{np.nanmax(half):.2g} Hz at most (95 %)"
    )


def deviation_sentence(case: SpatialCase, deviations: Callable[[SpatialRobot], Real]) -> str:
    """Sentence on the uncertainty of deviations (n, 6); empty if the file was never updated."""
    if case.uncertainty is None:
        return ""
    errors = 1e3 * np.linalg.norm(derived_errors(case.robot, case.uncertainty, deviations)[:, :3], axis=1)
    half = ROBOT_STEPS.normal_95 * errors
    return (
        f"uncertainty of the deviation after the update: ±{np.nanmedian(half):.3g} mm in the median, "
        f"±{np.nanmax(half):.3g} mm at most (95 %)"
    )
