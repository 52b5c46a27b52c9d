"""Fields that tell what `inspect` saw, and those of a JSON file that a command wrote."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from estimation import SweepPlan, read_frf
from millfrf.stability import read_lobes
from modal_fit import read_modal_model

from ..file_kinds import FRF, LOBES, MODEL
from ..inspection import Findings
from ..tables import Table
from .limits import RPM, lobes_answer
from .models import frf_answer, model_answer

DEGREE = RPM / 6


def inspected(file: Path, findings: Findings) -> dict[str, Any]:
    """Kind, one line, notes and tables of a file; the numbers of FRFs, models and lobes.

    Parameters
    ----------
    file
        File that was looked at.
    findings
        What was seen.
    """
    fields: dict[str, Any] = {
        "file": file,
        "kind": findings.kind,
        "summary": findings.summary,
        "notes": findings.notes,
        "tables": tables_answer(findings.tables),
    }
    if findings.kind == MODEL:
        fields |= model_answer(read_modal_model(file))
    elif findings.kind == FRF:
        fields |= frf_answer(read_frf(file))
    elif findings.kind == LOBES:
        fields |= lobes_answer(read_lobes(file))
    return fields


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
