"""Diagnosis files: JSON, format ``millfrf.diagnosis`` version 1."""

import json
import os
from dataclasses import asdict
from typing import Any, Protocol

from foundation import writing_whole_file
from modal_fit import ModalModel

from ..models.model_terms import improved_model
from .diagnosis import AcceptedCause, Candidate, Diagnosis, Improvement

FORMAT = "millfrf.diagnosis"
FORMAT_VERSION = 1


class Told(Protocol):
    """What every diagnosis tells, whatever was compared; fields as of :class:`Diagnosis`."""

    @property
    def verdict(self) -> str: ...
    @property
    def physics(self) -> tuple[AcceptedCause, ...]: ...
    @property
    def candidates(self) -> tuple[Candidate, ...]: ...
    @property
    def equivalents(self) -> tuple[str, ...]: ...
    @property
    def located(self) -> dict[str, Any]: ...
    @property
    def leftover(self) -> float: ...
    @property
    def improvement(self) -> Improvement: ...


def diagnosis_content(diagnosis: Told) -> dict[str, Any]:
    """What the file of any diagnosis holds; every number is a plain one."""
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
    band = {} if diagnosis.band is None else {"compared_band": asdict(diagnosis.band)}
    write_content(path, diagnosis_content(diagnosis) | band | {"warnings": list(diagnosis.doubts)})


def write_content(path: str | os.PathLike[str], content: dict[str, Any]) -> None:
    """Write what a diagnosis' file holds whole.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    text = json.dumps(content, indent=1, allow_nan=False)
    with writing_whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def improved_model_of(diagnosis: Diagnosis) -> ModalModel:
    """The model with everything that was accepted: refitted modes, causes, a tone, a limit."""
    faults = tuple(
        {"name": cause.name, "location": cause.location, "parameters": cause.parameters}
        for cause in diagnosis.physics
        if cause.name in ("unmeasured_excitation", "clipping")
    )
    return improved_model(diagnosis.final.explanation, faults)
