"""Files of a cutting diagnosis: JSON, format ``millfrf.diagnosis`` version 1, and the improved cutting file."""

import os
from typing import Any

import numpy as np

from cutting import write_cutting_process

from ...inference.diagnosis_file import diagnosis_content, write_content
from .cut_results import CutDiagnosis


def cut_diagnosis_content(diagnosis: CutDiagnosis) -> dict[str, Any]:
    """What the file holds: the fields of every diagnosis, and under ``cut`` what was compared."""
    setting = diagnosis.setting
    laws = diagnosis.final.attempt.laws
    return diagnosis_content(diagnosis) | {
        "cut": {
            "compared": "cutting force",
            "depth_m": setting.depth,
            "coefficient_error": setting.belief.error,
            "force_error": setting.force_error,
            "chatter": [
                {"name": one.name, "kind": one.kind, "frequency_hz": _number(one.frequency), "reason": one.reason}
                for one in diagnosis.chatter
            ],
            "recordings": [
                {
                    "name": lines.recording.name,
                    "channels": list(lines.recording.channels),
                    "band_hz": [float(lines.frequencies[0]), float(lines.frequencies[-1])],
                    "spindle_speed_rpm": law.speed * 30 / np.pi,
                    "spindle_speed_change_rpm_per_s": law.change * 30 / np.pi,
                    "motion": lines.recording.motion.origin if lines.recording.motion is not None else "none",
                }
                for lines, law in zip(setting.lines, laws, strict=True)
            ],
        },
    }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def write_cut_diagnosis(path: str | os.PathLike[str], diagnosis: CutDiagnosis) -> None:
    """Write a cutting diagnosis whole.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    write_content(path, cut_diagnosis_content(diagnosis))


def write_improved_cut(path: str | os.PathLike[str], diagnosis: CutDiagnosis) -> None:
    """Write the cutting file with refitted coefficients and the accepted causes.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    names = ", ".join(lines.recording.name for lines in diagnosis.setting.lines)
    causes = ", ".join(cause.name for cause in diagnosis.physics) or "none"
    comments = [f"refitted to {names}; verdict {diagnosis.verdict}, causes: {causes}"]
    for cause in diagnosis.physics:
        if "angle_rad" in cause.parameters:
            comments.append(
                f"runout points {cause.parameters['angle_rad']:.4g} rad from tooth 0; a cutting file says 0"
            )
    write_cutting_process(path, diagnosis.improved_process(), comments)
