"""The model that a diagnosis improves: refitted modes, causes, tones and limits as terms of its file."""

from dataclasses import replace

from modal_fit import ModalModel

from ...location import StructureDiagnosis
from ...models import improved_model
from ...physics import is_fault


def improved_model_of(diagnosis: StructureDiagnosis) -> ModalModel:
    """The model with everything that was accepted.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure, with its fits.
    """
    faults = tuple(
        {"name": cause.name, "location": dict(cause.location), "parameters": dict(cause.parameters)}
        for cause in diagnosis.physics
        if is_fault(cause.name)
    )
    details = diagnosis.details
    return replace(improved_model(details.final.hypothesis, faults), delay=details.delay)
