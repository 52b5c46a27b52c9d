"""Diagnosis files: JSON, format ``millfrf.diagnosis`` version 1."""

import json
import os
from dataclasses import asdict
from typing import Any

from foundation import writing_whole_file
from modal_fit import ModalModel

from .diagnosis import Diagnosis
from .physics_terms import improved_model

FORMAT = "millfrf.diagnosis"
FORMAT_VERSION = 1


def diagnosis_content(diagnosis: Diagnosis) -> dict[str, Any]:
    """What the file holds; every number is a plain one."""
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "verdict": diagnosis.verdict,
        "physics": [asdict(cause) for cause in diagnosis.physics],
        "candidates": [asdict(candidate) for candidate in diagnosis.candidates],
        "equivalents": list(diagnosis.equivalents),
        "located": diagnosis.located,
        "leftover_share": diagnosis.leftover,
        "improvement": asdict(diagnosis.improvement),
    }


def write_diagnosis(path: str | os.PathLike[str], diagnosis: Diagnosis) -> None:
    """Write a diagnosis whole.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    with writing_whole_file(path) as temporary:
        temporary.write_text(json.dumps(diagnosis_content(diagnosis), indent=1, allow_nan=False), encoding="utf-8")


def improved_model_of(diagnosis: Diagnosis) -> ModalModel:
    """The model with everything that was accepted: refitted modes, causes, a tone, a limit."""
    faults = tuple(
        {"name": cause.name, "location": cause.location, "parameters": cause.parameters}
        for cause in diagnosis.physics
        if cause.name in ("unmeasured_excitation", "clipping")
    )
    return improved_model(diagnosis.final.explanation, faults)
