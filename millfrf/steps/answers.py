"""Results as numbers for scripts: the fields that ``--json`` prints."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation import Frf, SweepPlan
from millfrf.core.terminal import Table
from modal_fit import ModalModel, frequency_and_damping_errors

if TYPE_CHECKING:  # the solvers and the chatter verdicts load slowly
    from millfrf.stability import JudgedCut, StabilityLobes

RPM = np.pi / 30


def lobes_answer(lobes: "StabilityLobes") -> dict[str, Any]:
    """The lowest limit, and the limit at each speed with its chatter frequency, bifurcation and status.

    Parameters
    ----------
    lobes
        Stability lobes; a limit that is infinite or not known is null, and ``bifurcation`` and ``status`` say which.
    """
    known = np.isfinite(lobes.depth_limits)
    lowest = int(np.where(known, lobes.depth_limits, np.inf).argmin()) if known.any() else None
    columns = (
        lobes.spindle_speeds_rpm,
        lobes.depth_limits,
        lobes.chatter_frequencies,
        lobes.bifurcations,
        lobes.status,
    )
    names = ("spindle_speed_rpm", "depth_limit_m", "chatter_frequency_hz", "bifurcation", "status")
    return {
        "method": lobes.method,
        "lowest_depth_limit_m": None if lowest is None else lobes.depth_limits[lowest],
        "lowest_at_spindle_speed_rpm": None if lowest is None else lobes.spindle_speeds_rpm[lowest],
        "limits": [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)],
    }


def cuts_answer(cuts: "Sequence[JudgedCut]") -> dict[str, Any]:
    """The verdict on each cut with its reason and numbers.

    Parameters
    ----------
    cuts
        Cuts with their verdicts, in the order of the recordings.
    """
    return {
        "cuts": [
            {
                "recording": cut.name,
                "verdict": cut.verdict.kind,
                "reason": cut.verdict.reason,
                "frequency_hz": cut.verdict.frequency,
                "p_value": cut.verdict.p_value,
                "spindle_speed_rpm": cut.verdict.spindle_speed / RPM,
                "stated_speed_rpm": cut.stated_rpm,
                "foreign_tones": [
                    {"frequency_hz": one.frequency, "share": one.share, "name": one.name} for one in cut.verdict.foreign
                ],
            }
            for cut in cuts
        ]
    }


def model_answer(model: ModalModel) -> dict[str, Any]:
    """Modes with their standard errors, degrees of freedom, quantity and band.

    Parameters
    ----------
    model
        A modal model; errors are null where it tells none.
    """
    errors = frequency_and_damping_errors(model)
    modes = []
    for r, (frequency, ratio) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        spread = (None, None) if errors is None else (errors[0][r], errors[1][r])
        modes.append(
            {
                "frequency_hz": frequency,
                "frequency_standard_error_hz": spread[0],
                "damping_ratio": ratio,
                "damping_ratio_standard_error": spread[1],
            }
        )
    return {
        "modes": modes,
        "quantity": model.quantity,
        "unit": model.unit,
        "responses": model.responses,
        "excitations": model.excitations,
        "band_hz": model.band,
    }


def frf_answer(frf: Frf) -> dict[str, Any]:
    """Degrees of freedom, lines, band, and how well each response is explained.

    Parameters
    ----------
    frf
        An FRF; the median of the multiple coherence over its valid lines is null where it tells none.
    """
    coherence = frf.multiple_coherence
    middle = None
    if coherence is not None and frf.valid.any():
        middle = np.median(coherence[frf.valid], axis=0)
    return {
        "quantity": frf.quantity,
        "unit": frf.unit,
        "responses": frf.responses,
        "excitations": frf.excitations,
        "lines": len(frf.frequencies),
        "valid_lines": frf.valid.sum(),
        "first_frequency_hz": frf.frequencies[0],
        "last_frequency_hz": frf.frequencies[-1],
        "band_hz": frf.band,
        "median_multiple_coherence": middle,
    }


DEGREE = RPM / 6


def tables_answer(tables: Sequence[Table]) -> list[dict[str, Any]]:
    """Tables as the terminal shows them: title, headings, rows of text.

    Parameters
    ----------
    tables
        Tables in their order.
    """
    return [{"title": one.title, "columns": one.columns, "rows": one.rows} for one in tables]


def stored_answer(path: Path) -> dict[str, Any]:
    """Content of a JSON file that the command has just written, such as a diagnosis.

    Parameters
    ----------
    path
        Path of the JSON file.
    """
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def plan_answer(plan: SweepPlan) -> dict[str, Any]:
    """The sweeps to mill, and the error of the FRF that is expected over the band.

    Parameters
    ----------
    plan
        Plan of sweeps.
    """
    first, last = (speed / RPM for speed in plan.spindle_speeds)
    return {
        "sweeps": [
            {
                "start_angle_deg": process.start_angle / DEGREE,
                "exit_angle_deg": process.exit_angle / DEGREE,
                "first_speed_rpm": first,
                "last_speed_rpm": last,
                "duration_s": plan.duration,
            }
            for process in plan.processes
        ],
        "condition": plan.condition,
        "frequencies_hz": plan.frequencies,
        "frf_standard_errors_m_per_n": plan.frf_errors,
    }


def size_of(frf: Frf) -> str:
    """What an FRF matrix holds, in words: quantity, responses, excitations, valid lines."""
    return (
        f"{frf.quantity}, {len(frf.responses)} responses x {len(frf.excitations)} excitations, "
        f"{int(frf.valid.sum())} of {len(frf.frequencies)} lines valid"
    )
