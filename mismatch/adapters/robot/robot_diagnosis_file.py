"""Robot diagnosis files: JSON, format ``millfrf.robot_diagnosis`` version 1."""

import os
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ...inference.diagnosis_file import write_content
from .robot_results import RobotCause, RobotDiagnosis

FORMAT = "millfrf.robot_diagnosis"
FORMAT_VERSION = 1


def robot_diagnosis_content(diagnosis: RobotDiagnosis) -> dict[str, Any]:
    """What the file holds; every number is a plain one, angles in rad."""
    error = diagnosis.setting.error
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "verdict": diagnosis.verdict,
        "causes": [_plain(cause) for cause in diagnosis.causes],
        "equivalents": list(diagnosis.equivalents),
        "candidates": [_plain(cause) for cause in diagnosis.candidates],
        "excess": {"before": diagnosis.excess_before, "after": diagnosis.excess_after},
        "p_value": diagnosis.p_value,
        "held_out": [asdict(one) for one in diagnosis.held_out],
        "rigid_links": diagnosis.setting.rigid_links,
        "model_error": {"frequency": error.frequency, "damping": error.damping, "shape": error.shape},
        "recordings": [
            {
                "name": one.name,
                "joints_rad": one.q.tolist(),
                "band_hz": [float(one.lines.frequencies[0]), float(one.lines.frequencies[-1])],
                "responses": list(one.responses),
                "excitations": list(one.excitations),
            }
            for one in diagnosis.setting.recordings
        ],
    }


def _plain(cause: RobotCause) -> dict[str, Any]:
    content = asdict(cause)
    content["standard_error"] = cause.standard_error if np.isfinite(cause.standard_error) else None
    return content


def write_robot_diagnosis(path: str | os.PathLike[str], diagnosis: RobotDiagnosis, doubts: Sequence[str] = ()) -> None:
    """Write a robot diagnosis whole, with doubts about its recordings.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    write_content(path, robot_diagnosis_content(diagnosis) | {"warnings": list(doubts)})
