"""Results as numbers for scripts: the fields that ``--json`` prints."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation import Frf, SweepPlan
from millfrf.core.terminal import Table
from modal_fit import ModalModel

from .settings import RPM

if TYPE_CHECKING:  # the solvers and the chatter verdicts load slowly
    from millfrf.stability import JudgedCut, StabilityLobes


def lobes_answer(lobes: "StabilityLobes") -> dict[str, Any]:
    """The lowest limit, and the limit at each speed; infinite or unknown limits become null in JSON."""
    from millfrf.stability import LOBES_COLUMNS

    known = np.isfinite(lobes.depth_limits)
    lowest = int(np.where(known, lobes.depth_limits, np.inf).argmin()) if known.any() else None
    columns = (
        lobes.spindle_speeds_rpm,
        lobes.depth_limits,
        lobes.chatter_frequencies,
        lobes.bifurcations,
        lobes.status,
        lobes.numerics,
        lobes.band,
        lobes.model,
    )
    return {
        "method": lobes.method,
        "lowest_depth_limit_m": None if lowest is None else lobes.depth_limits[lowest],
        "lowest_at_spindle_speed_rpm": None if lowest is None else lobes.spindle_speeds_rpm[lowest],
        "limits": [dict(zip(LOBES_COLUMNS, row, strict=True)) for row in zip(*columns, strict=True)],
    }


def cuts_answer(cuts: "Sequence[JudgedCut]", teeth: int) -> dict[str, Any]:
    """The verdict on each cut with its reason and numbers."""
    return {
        "cuts": [
            {
                "recording": cut.name,
                "verdict": cut.verdict.kind,
                "reason": cut.verdict.reason,
                "frequency_hz": cut.verdict.frequency,
                "other_frequency_hz": cut.verdict.side_line,
                "p_value": cut.verdict.p_value,
                "spindle_speed_rpm": cut.verdict.spindle_speed / RPM,
                "stated_speed_rpm": cut.stated_rpm,
                "proposed_speeds_rpm": list(cut.proposed_rpm(teeth)),
                "foreign_tones": [
                    {"frequency_hz": tone.frequency, "share": tone.share, "name": tone.name}
                    for tone in cut.verdict.foreign
                ],
            }
            for cut in cuts
        ]
    }


def model_answer(model: ModalModel) -> dict[str, Any]:
    """Modes with standard errors (None where unknown), degrees of freedom, quantity and band."""
    errors = model.standard_errors()
    modes = []
    for r, (frequency, ratio) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        spread = (None, None) if errors is None else (errors[0][r], errors[1][r])
        modes.append(
            {
                "frequency_hz": frequency,
                "frequency_standard_error_hz": spread[0],
                "damping_ratio": ratio,
                "damping_ratio_standard_error": spread[1],
                **({"source": model.mode_sources[r]} if model.sources else {}),
            }
        )
    return {
        "modes": modes,
        "quantity": model.quantity,
        "unit": model.unit,
        "responses": model.responses,
        "excitations": model.excitations,
        "band_hz": model.band,
        "measured": model.measured,
        "band_sources": [[band.low, band.high, band.source] for band in model.sources],
        "unmeasured_flexibility_m_per_n": model.unmeasured_flexibility,
    }


def frf_answer(frf: Frf) -> dict[str, Any]:
    """Degrees of freedom, lines, band, and the median multiple coherence of each response."""
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
        "measured": frf.measured,
        "median_multiple_coherence": middle,
    }


def tables_answer(tables: Sequence[Table]) -> list[dict[str, Any]]:
    """Tables as the terminal shows them: title, headings, rows of text."""
    return [{"title": table.title, "columns": table.columns, "rows": table.rows} for table in tables]


def stored_answer(path: Path) -> dict[str, Any]:
    """Content of a JSON file that the command has just written, such as a diagnosis."""
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def plan_answer(plan: SweepPlan) -> dict[str, Any]:
    """The sweeps to mill, and the error of the FRF that is expected over the band."""
    first, last = (speed / RPM for speed in plan.spindle_speeds)
    degree = RPM / 6
    return {
        "sweeps": [
            {
                "start_angle_deg": process.start_angle / degree,
                "exit_angle_deg": process.exit_angle / degree,
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
    """Describe an FRF matrix: quantity, responses, excitations, valid lines."""
    return (
        f"{frf.quantity}, {len(frf.responses)} responses x {len(frf.excitations)} excitations, "
        f"{int(frf.valid.sum())} of {len(frf.frequencies)} lines valid"
    )
