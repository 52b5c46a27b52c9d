"""Errors of each recording as it was measured, for the models that are fitted without the recording held out."""

from dataclasses import dataclass

import numpy as np

from ..faults import residual_lines
from ..models import known_noise, through_structure
from ..physics import is_fault
from .structure_details import StructureDiagnosis


@dataclass(frozen=True)
class RecordingError:
    """Errors of the models as shares of one recording's root mean square response.

    Parameters
    ----------
    recording
        Name of the recording.
    held_out
        Whether the models were fitted without the recording.
    force
        Root mean square of the recording's force, N.
    nominal, refitted, final
        Root mean square residual of the nominal model, of the model with refitted modal parameters alone, and of the
        final model, each as a share of the response.
    noise
        Root mean square noise as a share of the response.
    """

    recording: str
    held_out: bool
    force: float
    nominal: float
    refitted: float
    final: float
    noise: float


def recording_errors(diagnosis: StructureDiagnosis) -> tuple[RecordingError, ...]:
    """Return the errors of all recordings; those of the one held out are in the diagnosis' :class:`Improvement` too."""
    details = diagnosis.details
    linear, improved = details.elsewhere
    faults = [cause for cause in diagnosis.physics if is_fault(cause.name)]
    found = []
    unseen = details.held_out
    for one, noise in zip(details.measured, details.final.noises, strict=True):
        held = one.recording.name == unseen.recording.name
        one = unseen if held else one
        rests = (
            residual_lines(improved.nominal, one),
            residual_lines(linear, one),
            residual_lines(improved, one, faults),
        )
        power = float(np.sum(np.abs(one.measured) ** 2))
        covariance = known_noise(one, through_structure(improved, one), noise)
        nominal, refitted, final = (float(np.sqrt(np.sum(np.abs(rest) ** 2) / power)) for rest in rests)
        floor = float(np.sqrt(np.sum(np.trace(covariance, axis1=1, axis2=2).real) / power))
        found.append(
            RecordingError(
                one.recording.name, held and details.tested, one.recording.level, nominal, refitted, final, floor
            )
        )
    return tuple(found)
